"""The axis that points up: a format's habit, and how the cameras stand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.undescribed_folders import rig

from jaxskel import Cameras, make_cameras
from jaxskel.io.calibrations import Contents
from jaxskel.io.proposals._proposed_up import proposed_up

HABIT = Contents("Pose2Sim TOML", [], 1.0, "+Z")


def in_other_world(axis: list[int]) -> Cameras:
    """The rig in a world where this axis points up."""
    rotation, _ = Rotation.align_vectors([axis, np.roll(axis, 1)], [[0, 0, 1], [1, 0, 0]])
    return rig().rotated(rotation.as_matrix())


def sideways(turns: list[int]) -> Cameras:
    """Cameras that are turned by quarter turns about their own axes."""
    found = rig()
    R = Rotation.from_rotvec(np.outer(np.array(turns) * np.pi / 2, [0, 0, 1])).as_matrix()
    return make_cameras(found.K, R @ found.R, np.einsum("cij,cj->ci", R, found.t), found.size)


@pytest.mark.parametrize(
    ("axis", "wanted"), [([0, 0, 1], "+Z"), ([0, 0, -1], "-Z"), ([0, -1, 0], "-Y"), ([1, 0, 0], "+X")]
)
def test_cameras_that_stand_upright_decide(axis, wanted):
    cameras = [in_other_world(axis)] * 2
    for contents in (HABIT, Contents("Anipose TOML", [], 1.0, None)):
        found = proposed_up("rig.toml", contents, cameras)
        assert found.axis == wanted
        assert bool(found.doubts) == bool(found.comment) == (contents.up != wanted)


def test_what_a_file_states_stays_and_is_doubted():
    stated = Contents("sequence file", [], 1.0, "+Z")
    found = proposed_up("rig.npz", stated, [in_other_world([0, 0, -1])] * 2)
    assert found.axis == "+Z"
    assert "as if -Z did" in found.doubts[0]


@pytest.mark.parametrize("up", ["+Z", None])
def test_cameras_that_do_not_stand_alike_say_nothing_and_that_is_told(up):
    found = proposed_up("rig.toml", Contents("Pose2Sim TOML", [], 1.0, up), [sideways([1, 3, 1, 3, 1])] * 2)
    assert found.axis == "+Z"
    assert found.comment
    assert len(found.doubts) == 1


def test_images_that_were_turned_upright_are_looked_at_too():
    assert proposed_up("rig.toml", HABIT, [sideways([1] * 5), rig()]).doubts == ()
    assert proposed_up("rig.toml", HABIT, [rig(), sideways([2] * 5)]).doubts == ()
