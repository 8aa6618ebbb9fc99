"""The collision of arms with the trunk, on cases that are computed by hand."""

import equinox as eqx
import jax
import numpy as np
import pytest
from support.phantoms import drawn_body, ideal_graph, shifted

from jaxskel import Pose, default_adult
from jaxskel.body import rest_origins
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import ArmCollision, place

ADULT = default_adult()
ORIGINS = np.asarray(rest_origins(ADULT))
HINGED = HingedLimbs()
REST = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
AT_REST = place(ADULT, REST)
GRAPH = ideal_graph(ADULT, REST)


# Arm collision

# A post in the trunk, 0.1 m wide at its foot and 0.2 m at its top, and balls of an arm beside it.
ARM = ArmCollision(
    body=drawn_body(
        [
            ("pelvis", (0, 0, 0), 0.1), ("chest", (0, 0, 0.4), 0.2),
            ("l_forearm", (0.12, 0, 0.2), 0.05),  # 30 mm inside, of its radius 30 mm must be outside
            ("l_hand", (0.5, 0, 0), 0.04),  # far outside
            ("l_upper_arm", (0.05, 0, 0.1), 0.05), ("l_clavicle", (0, 0, 0.3), 0.05),  # deep inside, as they may
        ],
        [(0, 1), (4, 2), (2, 3), (5, 4)],
    )
)  # fmt: skip


@pytest.mark.parametrize(
    ("segments", "depth"),
    [
        ({}, 0.06),
        ({"l_forearm": [-0.01, 0, 0]}, 0.07),
        ({"pelvis": [-0.02, 0, 0], "chest": [-0.02, 0, 0]}, 0.04),
        ({"chest": [-0.02, 0, 0]}, 0.05),  # half-way up the post
        ({"l_forearm": [0, 0.03, 0.01]}, 0.06),  # along the tangent plane
        ({"l_forearm": [0.07, 0, 0]}, 0.0),
        ({"l_upper_arm": [0.02, 0, 0], "l_clavicle": [0.02, 0, 0]}, 0.06),
    ],
)
def test_arm_collision_by_hand(segments, depth):
    residual = jax.jit(lambda body: ARM.residual(body, GRAPH, ARM.correspond(AT_REST, GRAPH)))
    np.testing.assert_allclose(residual(shifted(AT_REST, **segments)), [depth, 0], atol=1e-5)


def test_cost_of_arm_collision_by_hand():
    np.testing.assert_allclose(ARM.cost(AT_REST, GRAPH), 0.06**2, rtol=1e-3)
    np.testing.assert_allclose(eqx.tree_at(lambda t: t.limit, ARM, 0.05).cost(AT_REST, GRAPH), 0.05**2, rtol=1e-3)
    # Forearm and hand side by side: 60 mm and 24 + 20 mm deep.
    both = shifted(AT_REST, l_hand=[-0.42, 0, 0])
    np.testing.assert_allclose(ARM.cost(both, GRAPH), 0.06**2 + 0.044**2, rtol=1e-3)
    assert ARM.cost(shifted(AT_REST, l_forearm=[0.3, 0, 0]), GRAPH) == 0
