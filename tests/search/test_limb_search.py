"""The tables of limb poses, and the choice among poses that were scored."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import pose_of

from jaxskel import default_adult, make_body
from jaxskel.body import JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, capsule_ends, limb_capsules, nearest_to_rays
from jaxskel.outlines import Contours
from jaxskel.refinement.terms import Observed, place, search_objective, volume_objective
from jaxskel.search._limb_search import (
    Scored,
    best_pairs,
    make_limb,
    none_scored,
    unexplained,
    with_limb,
    without,
)
from jaxskel.search._limb_tables import LimbTable

ADULT = default_adult()
REST: dict[str, np.ndarray] = dict(
    zip(JOINT_NAMES + PIVOT_NAMES, np.concatenate([ADULT.rest_joints, ADULT.pivots]), strict=True)
)
LIMBS = {
    name: make_limb(ADULT, name, search_objective(make_body(ADULT))) for name in ("l_arm", "l_leg", "r_arm", "r_leg")
}
# Where limbs start, bend, and end; a pivot lies between the last two.
CHAINS = {"arm": ("shoulder", "elbow", "wrist", "hand"), "leg": ("hip", "knee", "ankle", "foot")}


def table_of(name: str) -> LimbTable:
    return LIMBS[name].table


def points_of(name: str) -> np.ndarray:
    """Middle of the upper bone, hinge, middle of the lower bone, pivot and end, of each pose."""
    table = table_of(name)
    return np.concatenate([np.asarray(table.upper_points)[table.direction], table.lower_points], 1)


# Tables


@pytest.mark.parametrize("name", LIMBS)
def test_tables_keep_the_lengths_of_bones(name):
    top, middle, pivot, end = (REST[f"{name[:2]}{point}"] for point in CHAINS[name[2:]])
    points = points_of(name).astype(np.float64)
    upper_middle, hinge, lower_middle, last, tip = points.swapaxes(0, 1)
    np.testing.assert_allclose(np.linalg.norm(hinge, axis=1), np.linalg.norm(middle - top), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(last - hinge, axis=1), np.linalg.norm(pivot - middle), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(tip - hinge, axis=1), np.linalg.norm(end - middle), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(tip - last, axis=1), np.linalg.norm(end - pivot), atol=1e-5)
    np.testing.assert_allclose(upper_middle, hinge / 2, atol=1e-6)
    np.testing.assert_allclose(lower_middle, (hinge + last) / 2, atol=1e-6)


@pytest.mark.parametrize("name", LIMBS)
def test_tables_hold_rotations_that_bend_hinges_only(name):
    table = table_of(name)
    for turned in (table.upper, table.lower):
        np.testing.assert_allclose(turned @ turned.swapaxes(1, 2), np.broadcast_to(np.eye(3), turned.shape), atol=1e-5)
        np.testing.assert_allclose(np.linalg.det(turned), 1.0, atol=1e-5)
    # Upper and lower bone agree on one direction at rest: the axis of the hinge, across the upper bone.
    relative = np.asarray(table.upper).swapaxes(1, 2) @ table.lower
    top, middle = (REST[f"{name[:2]}{point}"] for point in CHAINS[name[2:]][:2])
    axis = np.cross(middle - top, [1.0, 0, 0])
    axis /= np.linalg.norm(axis)
    np.testing.assert_allclose(relative @ axis, np.broadcast_to(axis, (len(relative), 3)), atol=1e-5)


def test_elbows_bend_as_far_as_the_table_says():
    hinge, palm = points_of("l_arm")[:, 1], points_of("l_arm")[:, 4]
    cosine = (hinge * (palm - hinge)).sum(1) / np.linalg.norm(hinge, axis=1) / np.linalg.norm(palm - hinge, axis=1)
    assert set(np.arccos(cosine).astype(float).round(2)) == {0.15, 0.6, 1.05, 1.5, 1.95, 2.35}


@pytest.mark.parametrize("kind", ["arm", "leg"])
def test_right_is_the_mirror_of_left(kind):
    left, right, mirror = table_of(f"l_{kind}"), table_of(f"r_{kind}"), np.diag([1.0, -1.0, 1.0])
    np.testing.assert_allclose(points_of(f"r_{kind}"), points_of(f"l_{kind}") @ mirror, atol=1e-5)
    for one, other in ((left.upper, right.upper), (left.lower, right.lower)):
        np.testing.assert_allclose(other, mirror @ one @ mirror, atol=1e-5)


# Directions of upper and lower bone of left limbs: x to the front, y to the left, z up.
POSTURES = {
    "hanging": ("arm", (0, 0, -1), (0, 0, -1)),
    "to the side": ("arm", (0, 1, 0), (0, 1, 0)),
    "to the front": ("arm", (1, 0, 0), (1, 0, 0)),
    "raised": ("arm", (0, 0, 1), (0, 0, 1)),
    "bent to the front": ("arm", (0, 0, -1), (1, 0, 0)),
    "bent across the belly": ("arm", (0, 0, -1), (0.7, -0.7, 0)),
    "on the hip": ("arm", (-0.3, 0.7, -0.65), (0.4, -0.6, -0.7)),
    "waving": ("arm", (0, 1, 0), (0, 0, 1)),
    "on the head": ("arm", (0.3, 0.6, 0.7), (0, -1, 0.1)),
    "straight": ("leg", (0, 0, -1), (0, 0, -1)),
    "seated": ("leg", (1, 0, 0), (0, 0, -1)),
    "heel raised": ("leg", (0, 0, -1), (-1, 0, 0)),
    "astride": ("leg", (0, 0.6, -0.8), (0, 0.6, -0.8)),
    "crouching": ("leg", (0.8, 0.3, 0.4), (-0.5, 0, -0.85)),
    "a step back": ("leg", (-0.4, 0, -0.9), (-0.6, 0, -0.8)),
}  # fmt: skip


@pytest.mark.parametrize("name", POSTURES)
def test_tables_reach(name):
    kind, upper, lower = POSTURES[name]
    points = points_of(f"l_{kind}")[:, [1, 3]]
    lengths = np.linalg.norm(points[0, 0]), np.linalg.norm(points[0, 1] - points[0, 0])
    bones = [length * np.array(d) / np.linalg.norm(d) for length, d in zip(lengths, (upper, lower), strict=True)]
    apart = np.linalg.norm(points - np.cumsum(bones, 0)[None], axis=-1)
    # Directions are 15 degrees apart, so any pose is within 8 degrees, 0.13 of the length; the twist adds the same.
    assert apart.max(1).min() < 0.2 * sum(lengths)


@pytest.mark.parametrize(("kind", "back", "across"), [("arm", -0.75, -0.65), ("leg", -0.55, -0.55)])
def test_upper_bones_reach_neither_far_back_nor_far_across(kind, back, across):
    hinge = points_of(f"l_{kind}")[:, 1]
    x, y, _ = (hinge / np.linalg.norm(hinge, axis=1, keepdims=True)).T
    assert back < x.min() < back + 0.1
    assert across < y.min() < across + 0.1


def test_knees_of_hanging_thighs_open_to_the_back():
    hinge, ankle = points_of("l_leg")[:, 1], points_of("l_leg")[:, 3]
    upper, lower = (bone / np.linalg.norm(bone, axis=1, keepdims=True) for bone in (hinge, ankle - hinge))
    hanging = upper[:, 2] < -0.97
    assert hanging.sum() > 20
    # Nearly straight knees are excepted.
    assert (lower[hanging, 0] - upper[hanging, 0]).max() < 0.25
    assert lower[hanging, 0].min() < -0.8


# Poses


@pytest.mark.parametrize("name", LIMBS)
def test_a_pose_with_a_limb_has_it_where_the_table_says(name):
    pose, limb = pose_of(3), LIMBS[name]
    before = place(ADULT, pose)
    top, middle, _, end = CHAINS[limb.kind]
    at = {joint: JOINT_NAMES.index(name[:2] + joint) for joint in (top, middle, end)}
    names = ("forearm", "hand") if limb.kind == "arm" else ("shank", "foot")
    lower, hand = (SEGMENT_NAMES.index(name[:2] + segment) for segment in names)
    parent = np.asarray(pose.rotations[SEGMENT_NAMES.index("chest" if limb.kind == "arm" else "pelvis")])
    for index in (0, 100, len(limb.table.lower_points) - 1):
        after = place(ADULT, with_limb(pose, limb, jnp.asarray(index)))
        origin = after.joints[at[top]]
        points = np.stack([after.joints[at[middle]], after.origins[hand], after.joints[at[end]]]) - np.asarray(origin)
        np.testing.assert_allclose(points @ parent, points_of(name)[index][[1, 3, 4]], atol=2e-6)
        others = np.setdiff1d(np.arange(15), [at[middle], at[end]])
        np.testing.assert_allclose(after.joints[others], before.joints[others], atol=1e-6)
        np.testing.assert_array_equal(after.rotations[hand], after.rotations[lower])


def test_unexplained_rays_are_those_off_the_rest_of_the_body():
    pose, body, rng = pose_of(2, 0.3), make_body(ADULT), np.random.default_rng(0)
    placed = place(ADULT, pose)
    ends = np.asarray(capsule_ends(body, placed.origins, placed.rotations), np.float32)
    hit = rng.permutation(np.repeat(ends.reshape(-1, 3), 5, 0))[:380] + rng.normal(0, 0.06, (380, 3))
    directions = rng.normal(size=(380, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    given = [jnp.asarray(a, jnp.float32) for a in (hit - 4 * directions, directions)]
    rays = Contours(*given)
    observed = Observed(np.zeros((5, 9, 3)), np.ones(5, bool), np.zeros((2, 3)), contours=rays)
    objective = volume_objective(body)
    found, costs = eqx.filter_jit(unexplained)(body, pose, objective, observed, without("l_arm", "r_leg"))

    rest = ~limb_capsules("l_arm", "r_leg")
    capsules = ends[rest], np.asarray(body.radii, np.float32)[body.links][rest]
    distance = nearest_to_rays(*given, *(jnp.asarray(a) for a in capsules)).distance
    weight = float(objective.terms["contours"].weight) / 380
    expected = np.where(distance > 0.012, weight * np.minimum(distance, 0.06) ** 2, 0.0)
    assert 20 < (expected > 0).sum() < 256
    np.testing.assert_allclose(np.sort(costs)[::-1], np.sort(expected)[::-1][:256], rtol=1e-4, atol=1e-6)
    # Rays and costs belong together.
    chosen = [int(np.flatnonzero((rays.centres == centre[None]).all(1))[0]) for centre in found.centres]
    assert len(set(chosen)) == 256
    np.testing.assert_allclose(costs, expected[chosen], rtol=1e-4, atol=1e-6)


# Choosing


def scored(seed: int, count: int) -> Scored:
    """Poses with few places for each joint, so that two poses are often the same at one joint, or at both."""
    rng = np.random.default_rng(seed)
    places = 0.3 * np.eye(3)[rng.integers(0, 3, (count, 2))]
    return Scored(
        jnp.asarray(rng.permutation(100)[:count], jnp.int32),
        jnp.asarray(rng.uniform(size=count), jnp.float32),
        jnp.asarray(0.3 * rng.uniform(size=(count, 7)) ** 2, jnp.float32),
        jnp.asarray(places + rng.normal(0, 0.03, (count, 2, 3)), jnp.float32),
    )


def same(limb: Scored, one: int, other: int) -> bool:
    joints = np.asarray(limb.joints)
    return bool(np.linalg.norm(joints[one] - joints[other], axis=-1).max() < 0.12)


def chosen_in_turn(costs: dict[tuple[int, ...], float], limbs: tuple[Scored, ...], count: int) -> list[tuple[int, ...]]:
    """The cheapest, then the cheapest of those that differ from it in some limb, and so on: indices into the tables."""
    found: list[tuple[int, ...]] = []
    for rows in sorted(costs, key=costs.__getitem__):
        apart = all(any(not same(*args) for args in zip(limbs, rows, old, strict=True)) for old in found)
        if apart and len(found) < count:
            found.append(rows)
    assert len(found) == count
    return [tuple(int(limb.index[row]) for limb, row in zip(limbs, rows, strict=True)) for rows in found]


def test_best_pairs_are_those_of_brute_force():
    ruled_out, best = 0, jax.jit(best_pairs, static_argnums=2)
    for seed in range(8):
        left, right = scored(2 * seed, 34), scored(2 * seed + 1, 31)
        each = np.asarray(left.left)[:, None], np.asarray(right.left)[None]
        total = np.asarray(left.cost)[:, None] + np.asarray(right.cost) + np.minimum(*each).sum(-1)
        costs = {(i, j): float(total[i, j]) for i in range(34) for j in range(31)}
        expected = chosen_in_turn(costs, (left, right), 5)
        found = best(left, right, 5)
        assert list(zip(*(np.asarray(rows).tolist() for rows in found), strict=True)) == expected
        plain = sorted(costs, key=costs.__getitem__)[:5]
        ruled_out += [(int(left.index[i]), int(right.index[j])) for i, j in plain] != expected
    assert ruled_out > 2


def test_beside_a_limb_that_stays_the_best_are_those_of_brute_force():
    ruled_out, best = 0, jax.jit(best_pairs, static_argnums=2)
    for seed in range(8):
        limb = scored(seed, 40)
        stays = none_scored(jnp.asarray(limb.left).max(0))
        total = np.asarray(limb.cost) + np.asarray(limb.left).sum(1)
        costs = {(i,): float(total[i]) for i in range(40)}
        expected = chosen_in_turn(costs, (limb,), 4)
        assert [(index,) for index in np.asarray(best(limb, stays, 4)[0]).tolist()] == expected
        ruled_out += [(int(limb.index[i]),) for (i,) in sorted(costs, key=costs.__getitem__)[:4]] != expected
    assert ruled_out > 2


def test_a_ray_is_paid_once_by_whichever_limb_explains_it():
    # Two poses of each arm: the first explains the first ray, the second the other one; a pair can explain both.
    nothing, joints = jnp.zeros(2), jnp.asarray([[[0.0, 0, 0]] * 2, [[1.0, 0, 0]] * 2])
    left = Scored(jnp.asarray([10, 11], jnp.int32), nothing, jnp.asarray([[0.0, 5.0], [5.0, 0.0]]), joints)
    right = Scored(jnp.asarray([20, 21], jnp.int32), nothing + jnp.asarray([0.0, 1.0]), left.left, joints)
    first, second = best_pairs(left, right, 4)
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(11, 20), (10, 21), (10, 20), (11, 21)]
