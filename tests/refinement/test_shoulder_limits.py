"""Upper arms do not point straight back: the limit, computed by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.phantoms import ideal_graph

from jaxskel import Pose, default_adult
from jaxskel.body import JOINT_NAMES, SEGMENT_NAMES
from jaxskel.refinement.terms import ShoulderLimits, place

ADULT = default_adult()
REST = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
GRAPH = ideal_graph(ADULT, REST)
LIMITS = ShoulderLimits(skeleton=ADULT)
LEFT_ARM = [SEGMENT_NAMES.index(f"l_{name}") for name in ("upper_arm", "forearm", "hand")]


def pointing(direction: tuple[float, float, float], turned: Rotation) -> np.ndarray:
    """Residuals of a person whose left upper arm points somewhere (body frame), all of it turned in the world."""
    rest = np.asarray(ADULT.rest_joints)
    bone = rest[JOINT_NAMES.index("l_elbow")] - rest[JOINT_NAMES.index("l_shoulder")]
    swing, _ = Rotation.align_vectors([direction], [bone / np.linalg.norm(bone)])
    rotations = np.tile(turned.as_matrix(), (17, 1, 1))
    rotations[LEFT_ARM] = (turned * swing).as_matrix()
    return np.asarray(LIMITS.residual(place(ADULT, Pose(np.zeros(3), rotations)), GRAPH, None))


@pytest.mark.parametrize("turned", [Rotation.identity(), Rotation.from_euler("xyz", [0.3, -2.0, 1.0])])
@pytest.mark.parametrize(
    ("direction", "beyond"),
    [
        ((0, 0, -1), 0.0),  # hanging
        ((1, 0, 0), 0.0),  # to the front
        ((0, 1, 0), 0.0),  # to the side
        ((-1, 0, 0), 0.25),  # straight back
        ((-0.8, 0, -0.6), 0.05),
        ((-0.6, 0, -0.8), 0.0),
    ],
)
def test_only_what_points_back_beyond_the_limit_is_punished(direction, beyond, turned):
    left, right = pointing(direction, turned)
    np.testing.assert_allclose(left, beyond, atol=1e-5)
    assert right == 0.0
