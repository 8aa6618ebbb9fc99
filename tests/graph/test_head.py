"""The top of the head: the paper's highest voxel and the ball of the head, on bodies drawn by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage
from support.phantoms import chain
from support.recordings import graph_settings

from jaxskel import GraphSettings, Pose, default_adult, reconstruct
from jaxskel.graph import FollowedHeights, HeadBall, HighestVoxel, RootFinder
from jaxskel.graph._followed_heights import _cheapest_path, _maxima
from jaxskel.graph._root_finders import deep_voxels
from jaxskel.hull import VisualHulls, hulls_from_dense, make_grid
from jaxskel.synthetic import demo_motion, make_scene

SPACING = 0.02
ADULT = default_adult(1.75)
LOWER, UPPER = np.array([-0.5, -0.6, -0.1]), np.array([0.6, 0.6, 2.3])
HEAD, HEAD_RADIUS = np.array([0.0, 0.0, 1.63]), 0.095
TOP = HEAD + [0, 0, HEAD_RADIUS]
BENT = np.array([0.34, 0.0, 1.2])  # where a head hangs in front of the chest
HAND = np.array([0.0, 0.3, 2.1])


def body(head=HEAD, neck=0.045, hand=HAND, arm=0.045) -> np.ndarray:
    """Balls of a standing person of 1.75 m whose left arm goes to `hand`; radii of neck and arm in metres."""
    return np.vstack(
        [
            chain((0, 0, 0.95), (0, 0, 1.3), 0.14),
            chain((0, -0.15, 1.33), (0, 0.15, 1.33), 0.09),
            chain((0, 0, 1.36), head, neck),
            np.append(head, HEAD_RADIUS),
            chain((0, 0.1, 0.05), (0, 0.1, 0.9), 0.08),
            chain((0, -0.1, 0.05), (0, -0.1, 0.9), 0.08),
            chain((0, 0.2, 1.33), hand, arm),
            chain((0, -0.2, 1.33), (0, -0.35, 0.85), arm),
        ]
    )


def thin() -> np.ndarray:
    """The person made of sticks: no part is as thick as a head."""
    return body() * [1, 1, 1, 0] + [0, 0, 0, 0.04]


def filled(*bodies: np.ndarray, spacing=SPACING, lower=LOWER, upper=UPPER) -> VisualHulls:
    """Voxels whose centre lies in a ball, one body a frame."""
    grid = make_grid(lower, upper, spacing)
    frames = np.zeros((len(bodies), *grid.shape), bool)
    for frame, balls in zip(frames, bodies, strict=True):
        for *centre, radius in balls:
            x, y, z = (np.square(axis - c) for axis, c in zip(grid.axes(), centre, strict=True))
            near = [np.flatnonzero(square < radius**2) for square in (x, y, z)]
            ball = x[near[0], None, None] + y[near[1], None] + z[near[2]] < radius**2
            frame[np.ix_(*near)] |= ball
    return hulls_from_dense(frames, grid)


def places(finder: RootFinder, hulls: VisualHulls, skeleton=ADULT) -> np.ndarray:
    return hulls.centres[finder.roots(hulls, skeleton)]


def apart(a, b) -> float:
    return float(np.linalg.norm(np.asarray(a) - np.asarray(b), axis=-1).max())


@pytest.mark.parametrize("finder", [HighestVoxel(), HeadBall(), FollowedHeights()])
def test_top_of_an_upright_head_is_found_by_both(finder):
    assert isinstance(finder, RootFinder)
    hulls = filled(body(hand=(0.0, 0.35, 0.85)))
    assert apart(places(finder, hulls), TOP) < 1.5 * SPACING


def test_raised_hand_is_the_highest_voxel_but_not_the_head():
    hulls = filled(body())
    assert apart(places(HeadBall(), hulls), TOP) < 1.5 * SPACING
    assert apart(places(HighestVoxel(), hulls), HAND + [0, 0, 0.045]) < 1.5 * SPACING


def test_bent_head_is_found_below_the_shoulders():
    hulls = filled(body(head=BENT, hand=(0.0, 0.35, 0.85)))
    assert apart(places(HeadBall(), hulls), BENT + [0, 0, HEAD_RADIUS]) < 2 * SPACING
    assert places(HighestVoxel(), hulls)[0, 2] > 1.38


def test_thick_neck_is_parted_from_the_head_at_a_greater_depth():
    hulls = filled(body(head=BENT, neck=0.06, hand=(0.0, 0.35, 0.85)), spacing=0.0125)
    assert apart(places(HeadBall(depths=(0.04, 0.065)), hulls), BENT + [0, 0, HEAD_RADIUS]) < 0.03
    # At the first depth alone, head and trunk are one core, and the back is its highest place.
    assert places(HeadBall(depths=(0.04,)), hulls)[0, 2] > 1.38


def test_a_neck_as_thick_as_the_head_never_parts_but_its_top_is_found():
    assert apart(places(HeadBall(), filled(body(neck=HEAD_RADIUS))), TOP) < 1.5 * SPACING


def test_where_no_depth_parts_them_the_first_one_stands():
    # At the second depth the head is gone, and only the trunk is left.
    ahead = np.array([0.3, 0.0, 1.55])
    hulls = filled(body(head=ahead, neck=0.09, hand=(0.0, 0.35, 0.85)))
    assert apart(places(HeadBall(depths=(0.04, 0.1)), hulls), ahead + [0, 0, HEAD_RADIUS]) < 2 * SPACING


def test_no_part_as_thick_as_a_head_leaves_the_highest_voxel():
    hulls = filled(thin())
    np.testing.assert_array_equal(HeadBall().roots(hulls, ADULT), HighestVoxel().roots(hulls, ADULT))


def test_a_knot_in_the_raised_arm_is_a_speck():
    # Its core is a ball of about 12 mm: 7 cm^3, where 20 are asked for.
    knotted = np.vstack([body(), np.append(HAND, 0.062)])
    hulls = filled(knotted, spacing=0.005)
    assert apart(places(HeadBall(), hulls), TOP) < 0.02
    assert apart(places(HeadBall(least_core=1e-6), hulls), HAND + [0, 0, 0.062]) < 0.02


def test_specks_alone_leave_the_highest_voxel():
    hulls = filled(np.vstack([thin(), [0, 0.1, 0.5, 0.062]]), spacing=0.005)
    assert deep_voxels(hulls, np.array([0]), HeadBall().depths[0]).any()
    np.testing.assert_array_equal(HeadBall().roots(hulls, ADULT), HighestVoxel().roots(hulls, ADULT))


@pytest.mark.parametrize("spacing", [0.0075, 0.015, 0.03])
def test_place_does_not_depend_on_the_spacing(spacing):
    bodies = (body(), body(head=np.array([0.2, 0.0, 1.5])))
    found = places(HeadBall(), filled(*bodies, spacing=spacing))
    heads = np.array([HEAD, [0.2, 0.0, 1.5]])
    assert apart(found, heads + [0, 0, HEAD_RADIUS]) < 0.012 + spacing


def test_sizes_go_with_the_stature():
    hulls = filled(0.5 * body(head=BENT), spacing=0.01)
    top = 0.5 * (BENT + [0, 0, HEAD_RADIUS])
    assert apart(places(HeadBall(), hulls, ADULT.scaled(0.5)), top) < 0.02
    # In a person of half the size, only the trunk is as thick as an adult's head.
    assert apart(places(HeadBall(), hulls), top) > 0.1


def test_moved_body_has_the_moved_root():
    shift = np.array([3, -4, 2]) * SPACING
    moved = filled(body() + [*shift, 0], lower=LOWER + shift, upper=UPPER + shift)
    at_rest, beside = filled(body()), filled(body() + [*shift, 0], lower=LOWER - 0.2, upper=UPPER + 0.2)
    for finder in (HeadBall(), HighestVoxel()):
        assert apart(places(finder, moved) - shift, places(finder, at_rest)) < 1e-9
        assert apart(places(finder, beside) - shift, places(finder, at_rest)) < 1e-9


@pytest.mark.parametrize("finder", [HighestVoxel(), HeadBall()])
def test_each_frame_has_its_root_by_itself(finder):
    # More than eight, as eight are eroded at once; among them an empty hull and one without a ball.
    hands = [np.array([0.0, 0.3, height]) for height in (1.5, 1.7, 1.8, 1.9, 2.0, 2.05, 2.1, 2.15)]
    bodies = [body(hand=hand) for hand in hands] + [np.zeros((0, 4)), thin(), body(neck=HEAD_RADIUS)]
    together = filled(*bodies)
    roots = finder.roots(together, ADULT)
    assert roots[8] == 0
    for f in np.delete(np.arange(len(bodies)), 8):
        alone = filled(bodies[f])
        assert together.inside[f, roots[f]]
        np.testing.assert_array_equal(together.centres[roots[f]], places(finder, alone)[0])


@pytest.mark.parametrize("finder", [HighestVoxel(), HeadBall()])
def test_no_frames_and_no_voxels_have_no_roots(finder):
    hulls = filled(body())
    none = VisualHulls(hulls.voxels, hulls.inside[:0], hulls.grid)
    assert finder.roots(none, ADULT).shape == (0,)
    nothing = VisualHulls(np.zeros((0, 3), int), np.zeros((2, 0), bool), hulls.grid)
    assert finder.roots(nothing, ADULT).tolist() == [0, 0]


def test_of_equally_high_voxels_the_middle_one_is_taken():
    occupancy = np.zeros((1, 9, 3, 4), bool)
    occupancy[0, 2:7, 1, 2] = True
    occupancy[0, :, :, 0] = True
    hulls = hulls_from_dense(occupancy, make_grid(np.zeros(3), np.array([9, 3, 4]) * SPACING, SPACING))
    assert hulls.voxels[HighestVoxel().roots(hulls, ADULT)].tolist() == [[4, 1, 2]]


@pytest.mark.parametrize("depth", [0.011, 0.031, 0.0505, 0.057, 0.083])
def test_depth_is_the_distance_from_the_nearest_empty_voxel(depth):
    # Nothing lies around the box, so that the body is cut by the edge of the grid.
    hulls = filled(body(), body(hand=(0.3, 0.1, 1.1)), lower=np.array([-0.1, -0.3, 0.8]))
    frames = np.array([1, 0])
    deep = deep_voxels(hulls, frames, depth)
    assert deep.any(1).all()
    for row, f in zip(deep, frames, strict=True):
        distance = ndimage.distance_transform_edt(np.pad(hulls.dense(int(f)), 1))[1:-1, 1:-1, 1:-1]
        np.testing.assert_array_equal(row, (distance >= depth / SPACING + 0.5)[tuple(hulls.voxels.T)] & hulls.inside[f])


@pytest.mark.slow
def test_raised_hands_and_a_crouch_from_silhouettes():
    skeleton = default_adult()
    whole = demo_motion(skeleton, 60)
    # Waving, the crane stand, the crouch.
    chosen = np.r_[17:22:2, 42:46:2, 48:52:2]
    scene = make_scene(skeleton=skeleton, motion=Pose(np.asarray(whole.root)[chosen], whole.rotations[chosen]))
    assert scene.truth is not None
    above = (scene.truth.tips[:, 1:3, 2] > scene.truth.tips[:, :1, 2]).any(1)
    assert above.sum() >= 3

    def head_errors(finder: RootFinder) -> np.ndarray:
        joints = reconstruct(scene, replace(graph_settings(), graph=GraphSettings(root_finder=finder))).joints
        return np.linalg.norm(joints[:, 2] - scene.truth.joints[:, 2], axis=-1)

    assert head_errors(HeadBall()).max() < 0.1
    assert not (head_errors(HighestVoxel())[above] < 0.1).all()  # wrong, or NaN: no match


def test_head_that_a_thick_neck_joins_to_the_trunk_is_not_lost_to_a_thick_arm():
    # Loose clothes: the neck is as thick as the head, and the elbow of a lifted arm has a core of its own.
    elbow = np.array([0.0, 0.42, 1.36])
    clothed = np.vstack([body(neck=HEAD_RADIUS, hand=elbow), np.append(elbow, 0.09)])
    assert apart(places(HeadBall(), filled(clothed)), TOP) < 1.5 * SPACING
    assert apart(places(HeadBall(overtopped=10.0), filled(clothed)), elbow) < 0.15


# --- heights followed in time


def test_a_head_is_followed_while_a_hand_rises_above_it_and_sinks():
    way = np.sin(np.linspace(0, np.pi, 13))[:, None]
    raised = filled(*(body(hand=hand) for hand in np.array([0.0, 0.55, 1.2]) * (1 - way) + HAND * way))
    assert apart(places(FollowedHeights(), raised), TOP) < 2 * SPACING
    assert apart(places(HighestVoxel(), raised), TOP) > 0.3


def test_frames_without_a_person_do_not_break_the_path():
    some = filled(body(), np.zeros((0, 4)), body(hand=HAND))
    assert FollowedHeights().roots(some, ADULT)[1] == 0
    assert apart(places(FollowedHeights(), some)[[0, 2]], TOP) < 2 * SPACING


def test_maxima_of_a_drawn_surface():
    # Columns of a row: 5 high, then 2, 4, 4, 1, 3, 2; maxima at 5, 4 and 3, which rise 2 (to the column of 2) and 2.
    heights = [5, 2, 4, 4, 1, 3, 2]
    voxels = np.array([(x, 0, z) for x, height in enumerate(heights) for z in range(height + 1)])

    def found(rise: float) -> list[tuple[int, int]]:
        return [(int(x), int(z)) for x, _, z in voxels[_maxima(voxels, rise)]]

    assert found(2.0) == [(0, 5), (2, 4), (5, 3)]
    assert found(2.5) == [(0, 5)]
    # A second body that touches nothing is higher than all around it.
    apart_from = np.concatenate([voxels, [(20, 0, 0)]])
    assert len(_maxima(apart_from, 2.5)) == 2


@pytest.mark.parametrize("seed", range(20))
def test_the_cheapest_path_is_that_of_all_paths(seed):
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 4, 5)
    away = [rng.uniform(0, 3, count) for count in counts]
    spots = [rng.integers(0, 9, (count, 3)) for count in counts]

    def cost(path) -> float:
        jumps = sum(np.linalg.norm(b[j] - a[i]) for a, b, i, j in zip(spots, spots[1:], path, path[1:], strict=False))
        return sum(own[i] for own, i in zip(away, path, strict=True)) + jumps / 2.0

    best = min(cost(path) for path in np.ndindex(*counts))
    assert cost(_cheapest_path(away, spots, 2.0)) == pytest.approx(best)
