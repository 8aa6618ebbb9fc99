"""The body of balls and capsules that is fitted to hulls: its table, its shape, and how its parts move."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.phantoms import pose_of

from jaxskel import Pose, default_adult
from jaxskel.body import (
    BALL_NAMES,
    HEM,
    LINKS,
    SEGMENT_NAMES,
    Skeleton,
    all_distances,
    ball_centres,
    capsule_ends,
    limb_capsules,
    make_body,
    place_body,
    place_segments,
    rest_origins,
)

ADULT = default_adult()
BODY = make_body(ADULT)
AT = {name: i for i, name in enumerate(BALL_NAMES)}
LINK_NAMES = [frozenset(BALL_NAMES[ball] for ball in link) for link in LINKS]


def mirrored(name: str) -> str:
    return {"l_": "r_", "r_": "l_"}.get(name[:2], name[:2]) + name[2:]


def at_rest(body) -> np.ndarray:
    """Centres of the balls (m), by the definition of the offsets."""
    return np.asarray(body.offsets) + np.asarray(rest_origins(body.skeleton))[body.segments]


def distances(points: np.ndarray) -> np.ndarray:
    """Distances of points to the body at rest (m)."""
    ends, radii = at_rest(BODY)[LINKS], BODY.radii[LINKS]
    return np.asarray(jax.jit(all_distances)(*(jnp.asarray(a, jnp.float32) for a in (points, ends, radii)))).min(1)


def test_the_table_of_links():
    assert len(set(BALL_NAMES)) == len(BALL_NAMES) == len(BODY.radii) == len(BODY.segments)
    np.testing.assert_array_equal(BODY.links, LINKS)
    # No capsule twice, none that is a mere ball, no ball without a capsule.
    assert len(set(LINK_NAMES)) == len(LINKS)
    assert all(len(names) == 2 for names in LINK_NAMES)
    assert set(LINKS.ravel()) == set(range(len(BALL_NAMES)))
    assert {frozenset(map(mirrored, names)) for names in LINK_NAMES} == set(LINK_NAMES)


def test_body_is_symmetric():
    centres, other = at_rest(BODY), [AT[mirrored(name)] for name in BALL_NAMES]
    np.testing.assert_allclose(centres[other] * [1, -1, 1], centres, atol=1e-12)
    np.testing.assert_array_equal(BODY.radii[other], BODY.radii)
    for name, ball in AT.items():
        assert SEGMENT_NAMES[BODY.segments[AT[mirrored(name)]]] == mirrored(SEGMENT_NAMES[BODY.segments[ball]])
        assert (centres[ball, 1] > 0) == name.startswith("l_")


@pytest.mark.parametrize("factor", [0.6, 1.2])
def test_body_scales_with_the_skeleton(factor):
    scaled = make_body(ADULT.scaled(factor))
    np.testing.assert_allclose(scaled.radii, factor * BODY.radii)
    np.testing.assert_allclose(scaled.offsets, factor * BODY.offsets, atol=1e-12)
    np.testing.assert_array_equal(scaled.segments, BODY.segments)
    np.testing.assert_array_equal(scaled.links, BODY.links)


def test_limbs_follow_the_skeletons_own_lengths():
    # One forearm twice as long: balls beyond that elbow move out with it, no other ball moves.
    joints, tips = np.array(ADULT.rest_joints), np.array(ADULT.rest_tips)
    longer = joints[5] - joints[4]
    joints[5] += longer
    tips[1] += longer
    shift = at_rest(make_body(Skeleton(joints, tips))) - at_rest(BODY)
    expected = {"l_forearm": 0.28 * 0.71, "l_wrist": 0.71, "l_palm": 1.0, "l_finger": 1.0}
    for name, ball in AT.items():
        np.testing.assert_allclose(shift[ball], expected.get(name, 0.0) * longer, atol=1e-12, err_msg=name)


def test_body_holds_its_joints_and_reaches_its_tips():
    assert distances(np.concatenate([ADULT.rest_joints, ADULT.pivots])).max() < -0.01
    assert np.abs(distances(np.asarray(ADULT.rest_tips))).max() < 0.02
    # An adult of 1.72 m between lean and stout (18.5 and 27.5 kg for each square metre of stature), about as dense as
    # water.
    low, high = at_rest(BODY).min(0) - 0.12, at_rest(BODY).max(0) + 0.12
    points = np.random.default_rng(0).uniform(low, high, (60_000, 3))
    litres = 1000 * (distances(points) < 0).mean() * np.prod(high - low)
    assert 18.5 < litres / ADULT.stature**2 < 27.5


LIMBS = {
    "l_arm": ("shoulder elbow", "elbow forearm", "forearm wrist", "wrist palm", "palm finger"),
    "l_leg": ("hip knee", "knee calf", "calf hem", "hem ankle", "ankle heel", "heel ball", "ankle ball", "ball toe"),
}


@pytest.mark.parametrize("limb", ["l_arm", "r_arm", "l_leg", "r_leg"])
def test_limb_capsules_by_name(limb):
    expected = {frozenset(limb[:2] + name for name in pair.split()) for pair in LIMBS["l_" + limb[2:]]}
    chosen = {names for names, taken in zip(LINK_NAMES, limb_capsules(limb), strict=True) if taken}
    assert chosen == expected


def test_limb_capsules_of_several_limbs():
    assert not limb_capsules().any()
    single = [limb_capsules(limb) for limb in ("l_arm", "r_arm", "l_leg", "r_leg")]
    np.testing.assert_array_equal(limb_capsules("l_arm", "r_arm", "l_leg", "r_leg"), np.sum(single, 0) == 1)
    np.testing.assert_array_equal(limb_capsules("r_arm", "l_leg"), single[1] | single[2])
    # What remains is trunk and head.
    rest = LINKS[~np.any(single, 0)]
    assert {SEGMENT_NAMES[s].removeprefix("l_").removeprefix("r_") for s in BODY.segments[rest].ravel()} == {
        "pelvis", "chest", "clavicle", "head",
    }  # fmt: skip


def test_balls_turn_with_their_segments():
    pose = pose_of(3)
    before = ball_centres(BODY, np.asarray(place_segments(ADULT, pose)[2], np.float64), pose.rotations)
    turn, number = Rotation.from_euler("xyz", (0.4, 0.5, -0.7)).as_matrix(), SEGMENT_NAMES.index("r_hand")
    pose.rotations[number] = turn @ pose.rotations[number]
    after = ball_centres(BODY, np.asarray(place_segments(ADULT, pose)[2], np.float64), pose.rotations)
    moved = np.linalg.norm(after - before, axis=1) > 1e-4
    assert {name for name, ball in AT.items() if moved[ball]} == {"r_wrist", "r_palm", "r_finger"}
    pivot = np.asarray(place_segments(ADULT, pose)[2], np.float64)[number]
    np.testing.assert_allclose(after[moved] - pivot, (before[moved] - pivot) @ turn.T, atol=1e-6)


def test_placing_is_the_same_for_one_frame_or_many_in_numpy_or_jax():
    poses = [pose_of(seed) for seed in range(3)]
    stack = Pose(*(np.stack(fields) for fields in zip(*((p.root, p.rotations) for p in poses), strict=True)))
    ends, radii = place_body(BODY, stack)
    assert ends.shape == (3, len(LINKS), 2, 3)
    np.testing.assert_array_equal(radii, BODY.radii[LINKS])
    for frame, pose in enumerate(poses):
        origins = place_segments(ADULT, pose)[2]
        single = jax.jit(lambda o, r: capsule_ends(BODY, o, r))(origins, jnp.asarray(pose.rotations))
        assert isinstance(single, jax.Array)
        np.testing.assert_allclose(single, ends[frame], atol=2e-6)
    standing = Pose(np.zeros((1, 3)), np.eye(3)[None, None].repeat(17, 1))
    np.testing.assert_allclose(place_body(BODY, standing)[0][0], at_rest(BODY)[LINKS], atol=1e-6)


def test_without_trousers_the_hem_lies_on_the_way_from_calf_to_ankle():
    places = np.column_stack([at_rest(BODY), BODY.radii])
    for side in ("l_", "r_"):
        calf, hem, ankle = (places[AT[side + name]] for name in ("calf", "hem", "ankle"))
        np.testing.assert_allclose(hem, (1 - HEM) * calf + HEM * ankle, atol=0.001)
