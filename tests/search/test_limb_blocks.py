"""Normal equations of capsules, limb by limb, equal those of the whole Jacobian."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.observed_person import ADULT, BODY, HINGED
from support.phantoms import pose_of

from jaxskel.body import BALL_NAMES, Body, capsule_ends
from jaxskel.refinement.terms import place
from jaxskel.search._block_normal_equations import limbs_of, normal_equations


def linked(*pairs: tuple[str, str]) -> Body:
    """The adult with other capsules."""
    links = np.array([[BALL_NAMES.index(name) for name in pair] for pair in pairs], np.int32)
    return Body(ADULT, BODY.segments, BODY.offsets, BODY.radii, links)


BODIES = {
    "adult": BODY,
    # A capsule from an arm to a leg: unknowns that move both belong to no limb.
    "hand in a pocket": linked(*(tuple(BALL_NAMES[ball] for ball in link) for link in BODY.links), ("l_palm", "l_hip")),
    "forearm": linked(("l_elbow", "l_forearm")),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
def test_they_are_those_of_the_whole_jacobian(name):
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        double = lambda a: jnp.asarray(a, jnp.float64) if eqx.is_inexact_array_like(a) else a  # noqa: E731
        base, body = jax.tree.map(double, (pose_of(2), BODIES[name]))
        roots = rng.normal(size=(len(body.links), 6, 6))
        matrix, vector = jnp.asarray(roots @ roots.swapaxes(1, 2)), jnp.asarray(rng.normal(size=roots.shape[:2]))

        def ends(unknowns):
            placed = place(body.skeleton, HINGED.retract(unknowns, base, body.skeleton))
            return jnp.asarray(capsule_ends(body, placed.origins, placed.rotations))

        @jax.jit
        def found():
            placed = place(body.skeleton, base)
            motion = HINGED.motion(base, placed, body.skeleton)
            there = jnp.asarray(capsule_ends(body, placed.origins, placed.rotations))
            return normal_equations(motion, there, body.segments[body.links], matrix, vector)

        across = np.asarray(jax.jit(jax.jacfwd(ends))(jnp.zeros(42))).reshape(*vector.shape, 42)
        normal, gradient = found()
        np.testing.assert_allclose(normal, np.einsum("cku,ckl,clv->uv", across, matrix, across), atol=1e-9)
        np.testing.assert_allclose(gradient, -np.einsum("cku,ck->u", across, vector), atol=1e-9)


def test_limbs_of_the_adult_are_arms_legs_and_head():
    base = pose_of(0)
    motion = HINGED.motion(base, place(ADULT, base), ADULT)
    limbs = limbs_of(motion.moves_any(BODY.segments[BODY.links]))
    assert len(limbs.trunk) == 9  # position, pelvis, chest
    assert sorted((limbs.own >= 0).sum(1)) == [3, 7, 7, 8, 8]
    together = np.concatenate([limbs.trunk, limbs.own[limbs.own >= 0]])
    np.testing.assert_array_equal(np.sort(together), np.arange(42))


def test_limbs_by_hand():
    # A trunk and two limbs, of which the second has two unknowns and a capsule more.
    moved = np.array([[1, 1, 1, 1, 1], [0, 1, 0, 0, 0], [0, 0, 1, 1, 1], [0, 0, 0, 0, 1]], bool)
    limbs = limbs_of(moved)
    np.testing.assert_array_equal(limbs.trunk, [0])
    order = np.argsort(limbs.own[:, 0])
    np.testing.assert_array_equal(limbs.own[order], [[1, -1], [2, 3]])
    np.testing.assert_array_equal(limbs.capsules[order], [[1, -1, -1], [2, 3, 4]])
    # In a ring nothing is a limb; a single chain is one.
    ring = np.eye(4, dtype=bool) | np.roll(np.eye(4, dtype=bool), 1, 1)
    assert len(limbs_of(ring).trunk) == 4
    assert limbs_of(np.triu(np.ones((3, 3), bool))).own.tolist() == [[0, 1, 2]]
