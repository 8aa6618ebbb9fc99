"""Parametrisations: zero unknowns give the base pose, laws for any unknowns, and the effect of each unknown."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation
from support.phantoms import pose_of

from jaxskel.body import (
    JOINT_NAMES,
    JOINT_PARENTS,
    PIVOT_NAMES,
    SEGMENT_NAMES,
    SEGMENT_PARENTS,
    TIP_NAMES,
    TIP_PARENTS,
    Pose,
    ball_centres,
    default_adult,
    hinge_axes,
    make_body,
    place_segments,
)
from jaxskel.refinement.parametrisations import ExactBones, HingedLimbs, Parametrisation
from jaxskel.refinement.terms import place

ADULT = default_adult()
# With the number of unknowns.
ALL = {"exact bones": (ExactBones(), 31), "hinged limbs": (HingedLimbs(), 42)}
POSES = {name: jax.jit(parametrisation.retract) for name, (parametrisation, _) in ALL.items()}
segments = jax.jit(place_segments)
every = pytest.mark.parametrize("name", ALL)

POINT = {name: i for i, name in enumerate(JOINT_NAMES + TIP_NAMES + PIVOT_NAMES)}
CHAINS = (
    ("pelvis", "neck", "head", "head_top"),
    *(("neck", *(side + n for n in ("shoulder", "elbow", "wrist", "hand", "fingertip"))) for side in ("l_", "r_")),
    *(("pelvis", *(side + n for n in ("hip", "knee", "ankle", "foot", "toetip"))) for side in ("l_", "r_")),
)
PARTS = np.array([[POINT[a], POINT[b]] for chain in CHAINS for a, b in zip(chain[:-1], chain[1:], strict=True)])

# Unknowns of HingedLimbs by segment: three for the pelvis' position, then in the order of the segments.
FREEDOM = {"clavicle": 2, "hand": 2, "forearm": 1, "shank": 1}
COUNTS = [FREEDOM.get(name.removeprefix("l_").removeprefix("r_"), 3) for name in SEGMENT_NAMES]
SLICES = {name: slice(3 + sum(COUNTS[:i]), 3 + sum(COUNTS[: i + 1])) for i, name in enumerate(SEGMENT_NAMES)}
HINGES = ("l_forearm", "r_forearm", "l_shank", "r_shank")


def free_pose(seed) -> Pose:
    """Every segment turned at random, hands and feet too."""
    rng = np.random.default_rng(seed)
    return Pose(rng.normal(size=3), Rotation.random(17, rng).as_matrix())


def points_of(pose: Pose) -> np.ndarray:
    joints, tips, origins = segments(ADULT, pose)
    return np.concatenate([joints, tips, origins[-4:]]).astype(np.float64)


def single_unknowns(name: str, values) -> jnp.ndarray:
    """Zeros but for the unknowns of one segment."""
    return HingedLimbs().unknowns(ADULT).at[SLICES[name]].set(jnp.asarray(values))


def relative(pose: Pose) -> np.ndarray:
    """Rotation of each segment but the pelvis in the frame of its parent segment."""
    rotations = np.asarray(pose.rotations, np.float64)
    return rotations[list(SEGMENT_PARENTS[1:])].swapaxes(1, 2) @ rotations[1:]


@every
def test_zero_unknowns_are_the_base_pose(name):
    parametrisation, count = ALL[name]
    assert isinstance(parametrisation, Parametrisation)
    assert parametrisation.unknowns(ADULT).shape == (count,)
    np.testing.assert_array_equal(parametrisation.unknowns(ADULT), 0.0)
    for base in (pose_of(0), free_pose(0)):
        pose = POSES[name](parametrisation.unknowns(ADULT), base, ADULT)
        np.testing.assert_allclose(pose.root, base.root, atol=1e-6)
        np.testing.assert_allclose(pose.rotations, base.rotations, atol=1e-6)


@every
@pytest.mark.parametrize("seed", range(5))
def test_lengths_are_exact_for_any_unknowns(name, seed):
    unknowns = jnp.asarray(np.random.default_rng(seed).normal(0, 2.0, ALL[name][1]))
    pose = POSES[name](unknowns, pose_of(seed, 2.0), ADULT)
    gram = np.einsum("sij,sik->sjk", pose.rotations, pose.rotations)
    np.testing.assert_allclose(gram, np.tile(np.eye(3), (17, 1, 1)), atol=5e-6)
    rest = np.concatenate([ADULT.rest_joints, ADULT.rest_tips, ADULT.pivots])
    lengths, expected = (np.linalg.norm(p[PARTS[:, 1]] - p[PARTS[:, 0]], axis=1) for p in (points_of(pose), rest))
    np.testing.assert_allclose(lengths, expected, atol=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_whole_bones_are_exact_where_hands_and_feet_do_not_turn(seed):
    unknowns = jnp.asarray(np.random.default_rng(seed).normal(0, 2.0, 31))
    pose = POSES["exact bones"](unknowns, pose_of(seed, 2.0), ADULT)
    gram = np.einsum("sij,sik->sjk", pose.rotations, pose.rotations)
    np.testing.assert_allclose(gram, np.tile(np.eye(3), (17, 1, 1)), atol=2e-6)
    joints, tips, _ = (np.asarray(a) for a in segments(ADULT, pose))
    lengths = np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=1)
    np.testing.assert_allclose(lengths, ADULT.bone_lengths, atol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=1), ADULT.tip_lengths, atol=2e-6)


@pytest.mark.slow
@every
@pytest.mark.parametrize("at", ["base", "away"])
def test_the_derivative_is_finite_differences(name, at):
    parametrisation, count = ALL[name]
    with jax.enable_x64(True):
        base, skeleton = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (free_pose(4), ADULT))

        @jax.jit
        def body(unknowns):
            # The finite differences come as NumPy arrays.
            return parametrisation.reached(jnp.asarray(unknowns), base, skeleton)

        spread = 0.0 if at == "base" else 0.7
        unknowns = spread * jnp.asarray(np.random.default_rng(0).normal(size=count))
        check_grads(body, (unknowns,), order=1, modes=("fwd", "rev"), atol=1e-6, rtol=1e-6, eps=1e-5)
        # Every unknown moves or turns something, none by more than it should.
        moved = np.abs(np.asarray(jax.jit(jax.jacfwd(lambda u: body(u).rotations))(unknowns)[..., 3:])).max((0, 1, 2))
        assert moved.min() > 0.3
        assert moved.max() < 2.0


@pytest.mark.slow
@every
def test_what_the_unknowns_reach_depends_on_base_and_template_too(name):
    parametrisation, count = ALL[name]
    unknowns = 0.7 * jnp.asarray(np.random.default_rng(1).normal(size=count))
    ends = []
    for body in (
        lambda given: parametrisation.reached(given[0], *given[1:]),
        lambda given: place(given[2], parametrisation.retract(*given)),
    ):
        given = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), (unknowns, free_pose(5), ADULT))
        ends.append(jax.jit(jax.jacrev(lambda given, body=body: body(given).joints[5]))(given))
    for one, other in zip(*map(jax.tree.leaves, ends), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)
    assert all(np.abs(leaf).max() > 0.1 for leaf in jax.tree.leaves(ends[0][:2]))


def test_nearby_is_the_pose_to_first_order():
    hinged = HingedLimbs()
    with jax.enable_x64(True):
        base, skeleton = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (free_pose(4), ADULT))
        nearby, pose = (jax.jit(lambda u, of=of: of(u, base, skeleton)) for of in (hinged.nearby, hinged.retract))
        unknowns = jnp.asarray(np.random.default_rng(2).normal(size=42))
        for at_zero, expected in zip(jax.tree.leaves(nearby(0 * unknowns)), jax.tree.leaves(base), strict=True):
            np.testing.assert_allclose(at_zero, expected, atol=1e-12)
        # A tenth of the step leaves a hundredth of the error.
        apart = [
            float(jnp.abs(nearby(s * unknowns).rotations - pose(s * unknowns).rotations).max()) for s in (0.1, 0.01)
        ]
        assert apart[0] > 1e-2
        np.testing.assert_allclose(apart[1], apart[0] / 100, rtol=0.3)
        exact, cheap = (jax.tree.leaves(jax.jit(jax.jacfwd(of))(0 * unknowns)) for of in (pose, nearby))
        for one, other in zip(exact, cheap, strict=True):
            np.testing.assert_allclose(other, one, atol=1e-9)


@pytest.mark.slow
def test_motion_is_the_derivative_of_the_placed_body():
    hinged = HingedLimbs()
    with jax.enable_x64(True):
        base, skeleton = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (free_pose(5), ADULT))
        body = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), make_body(ADULT))
        placed = jax.jit(place)(skeleton, base)
        motion = hinged.motion(base, placed, skeleton)
        expected = jax.jit(jax.jacfwd(lambda u: place(skeleton, hinged.retract(u, base, skeleton))))(jnp.zeros(42))
        for name in ("joints", "tips", "rotations", "origins"):
            found = getattr(motion.of_body(placed), name)
            np.testing.assert_allclose(found, getattr(expected, name), atol=1e-9)
        # And of points that are no joints.
        centres = ball_centres(body, placed.origins, placed.rotations)
        expected = ball_centres(body, *(jnp.moveaxis(a, -1, 0) for a in (expected.origins, expected.rotations)))
        found = motion.of_points(centres, body.segments)
        np.testing.assert_allclose(jnp.moveaxis(found, -1, 0), expected, atol=1e-9)
        # Stacks of some unknowns, each at points of its own.
        some, where = np.array([[3, 40], [20, 0]], np.int32), np.array([[5, 1, 30], [36, 12, 5]], np.int32)
        stacked = motion.some(some).of_points(centres[where], body.segments[where])
        for one, unknowns, points in zip(stacked, some, where, strict=True):
            np.testing.assert_allclose(one, found[points][:, :, unknowns], atol=1e-12)


@every
def test_no_two_unknowns_do_the_same(name):
    # Tilting the pelvis about its hips and twisting the chest move no joint of the segment, but move its descendants.
    parametrisation, count = ALL[name]

    def body(unknowns):
        placed = place(ADULT, parametrisation.retract(unknowns, base, ADULT))
        return jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(placed)])

    base = jax.tree.map(jnp.asarray, pose_of(1))
    singular = np.linalg.svd(np.asarray(jax.jit(jax.jacfwd(body))(parametrisation.unknowns(ADULT))), compute_uv=False)
    assert singular.shape == (count,)
    assert singular.min() > 0.1


def test_each_unknown_of_exact_bones_turns_its_bone_by_as_many_radians():
    base, count = pose_of(3), 31

    def directions(unknowns):
        joints = np.asarray(segments(ADULT, POSES["exact bones"](jnp.asarray(unknowns), base, ADULT))[0])
        bones = joints[1:] - joints[list(JOINT_PARENTS[1:])]
        return bones / np.linalg.norm(bones, axis=1, keepdims=True)

    rest, turned = directions(np.zeros(count)), []
    for unknown in range(9, count):  # after position, pelvis and chest
        angles = np.arccos(np.clip((directions(0.3 * (np.arange(count) == unknown)) * rest).sum(1), -1, 1))
        turned.append(int(angles.argmax()))
        np.testing.assert_allclose(angles[turned[-1]], 0.3, atol=1e-3)
        np.testing.assert_allclose(np.delete(angles, turned[-1]), 0.0, atol=1e-3)
    assert turned[::2] == turned[1::2] == sorted(set(turned))  # two for each bone


@pytest.mark.parametrize("segment", HINGES)
def test_flexion_turns_about_the_hinge_only(segment):
    base, number = free_pose(5), SEGMENT_NAMES.index(segment)
    axis = hinge_axes(ADULT)[HINGES.index(segment)]
    for angle in (0.8, -1.7):
        pose = POSES["hinged limbs"](single_unknowns(segment, [angle]), base, ADULT)
        before, after = relative(base), relative(pose)
        turn = Rotation.from_rotvec(angle * axis).as_matrix()
        np.testing.assert_allclose(after[number - 1], turn @ before[number - 1], atol=2e-6)
        # Hand or foot comes along, all else stays.
        np.testing.assert_allclose(np.delete(after, number - 1, 0), np.delete(before, number - 1, 0), atol=2e-6)
        np.testing.assert_allclose(pose.root, base.root)


@pytest.mark.parametrize("segment", SEGMENT_NAMES)
def test_what_turns_a_segment_turns_all_that_hang_on_it(segment):
    base, number = free_pose(6), SEGMENT_NAMES.index(segment)
    count = COUNTS[number]
    values = 0.9 * np.ones(count) / np.sqrt(count)
    pose = POSES["hinged limbs"](single_unknowns(segment, values), base, ADULT)
    carried = [i == number for i in range(17)]
    for i in range(1, 17):
        carried[i] |= carried[SEGMENT_PARENTS[i]]
    turns = np.asarray(pose.rotations, np.float64) @ base.rotations.swapaxes(1, 2)
    np.testing.assert_allclose(turns[~np.array(carried)], np.tile(np.eye(3), (17 - sum(carried), 1, 1)), atol=2e-6)
    np.testing.assert_allclose(turns[carried], np.tile(turns[number], (sum(carried), 1, 1)), atol=2e-6)
    np.testing.assert_allclose(Rotation.from_matrix(turns[number]).magnitude(), 0.9, atol=1e-5)
    # Segments stay connected: the segment's own origin does not move.
    origins = [np.asarray(segments(ADULT, p)[2])[number] for p in (base, pose)]
    np.testing.assert_allclose(origins[1], origins[0], atol=1e-6)


@pytest.mark.parametrize(
    ("segment", "start", "end"),
    [("l_clavicle", "neck", "l_shoulder"), ("r_clavicle", "neck", "r_shoulder"),
     ("l_hand", "l_wrist", "l_hand"), ("r_hand", "r_wrist", "r_hand")],
)  # fmt: skip
def test_shoulder_blades_and_hands_do_not_twist(segment, start, end):
    base, number = free_pose(8), SEGMENT_NAMES.index(segment)
    points = points_of(base)
    bone = points[POINT[end]] - points[POINT[start]]
    axes = []
    for values in ([0.6, 0.0], [0.0, 0.6]):
        pose = POSES["hinged limbs"](single_unknowns(segment, values), base, ADULT)
        turn = np.asarray(pose.rotations[number], np.float64) @ base.rotations[number].T
        axes.append(Rotation.from_matrix(turn).as_rotvec() / 0.6)
    np.testing.assert_allclose(np.array(axes) @ np.array(axes).T, np.eye(2), atol=1e-5)
    np.testing.assert_allclose(np.array(axes) @ bone / np.linalg.norm(bone), 0.0, atol=1e-5)


@every
def test_the_position_shifts_the_whole_body(name):
    parametrisation, _ = ALL[name]
    base = pose_of(9)
    shifted = POSES[name](parametrisation.unknowns(ADULT).at[:3].set(jnp.array([0.1, -0.2, 0.3])), base, ADULT)
    np.testing.assert_allclose(points_of(shifted) - points_of(base), np.tile([0.1, -0.2, 0.3], (24, 1)), atol=1e-6)


def test_the_pelvis_turns_the_whole_hinged_body():
    base, vector = free_pose(10), np.array([0.3, -0.5, 0.4])
    pose = POSES["hinged limbs"](single_unknowns("pelvis", vector), base, ADULT)
    turn = Rotation.from_rotvec(vector).as_matrix()
    before, after = points_of(base) - base.root, points_of(pose) - np.asarray(pose.root)
    np.testing.assert_allclose(after, before @ turn.T, atol=3e-6)
