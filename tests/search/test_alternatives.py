"""What searches found besides is carried on with the track, and counts until the next search."""

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.capsule_films import joints_of

from jaxskel import Pose
from jaxskel.search import Hypotheses, no_alternatives
from jaxskel.search._alternatives import Alternatives, Known, carried, facing_alike, latest, told

SEGMENTS = 17
seeds = st.integers(0, 2**32 - 1)


def some_poses(seed: int, *shape: int) -> Pose:
    rng = np.random.default_rng(seed)
    turns = Rotation.random(int(np.prod(shape)) * SEGMENTS, rng=rng).as_matrix()
    roots = rng.normal(size=(*shape, 3))
    return Pose(roots.astype(np.float32), turns.reshape(*shape, SEGMENTS, 3, 3).astype(np.float32))


def track_of(*cost: float, seed: int = 0) -> Hypotheses:
    return Hypotheses(some_poses(seed, len(cost), 1), np.array(cost, np.float32)[:, None])


@given(seeds)
def test_what_moves_rigidly_carries_alternatives_rigidly(seed):
    then, others = some_poses(seed, 1), some_poses(seed + 1, 1, 3)
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    step = np.array([0.3, -1.0, 2.0])

    def moved(pose: Pose) -> Pose:
        return Pose(pose.root @ turn.T + step, turn @ pose.rotations)

    now = jax.tree.map(lambda a: a[0], carried(others, then, moved(then)))
    before = joints_of(jax.tree.map(lambda a: a[0], others))
    np.testing.assert_allclose(joints_of(now), before @ turn.T + step, atol=1e-5)


def test_costs_are_those_of_the_search_on_top_of_the_tracks():
    track = track_of(1.0, 2.0, 3.0, 4.0)
    searched = Hypotheses(some_poses(1, 1, 3), np.array([[1.0, 5.0, np.inf]], np.float32))
    nothing = no_alternatives(jax.tree.map(lambda a: a[0, 0], track.poses), 3)
    found = told(track, latest(track, Known(searched, np.array([1]), nothing)))
    assert found.cost.shape == (4, 4)
    np.testing.assert_array_equal(found.cost[:, 0], [1, 2, 3, 4])
    assert np.isinf(found.cost[0, 1:]).all()  # nothing was searched in yet
    # What costs less than the track was no reason to leave it: it counts as if it cost as much.
    np.testing.assert_array_equal(found.cost[1:, 1:], [[3.5, 6.5, np.inf], [4.5, 7.5, np.inf], [5.5, 8.5, np.inf]])
    np.testing.assert_allclose(found.poses.rotations[1, 1:], searched.poses.rotations[0], atol=1e-5)


@given(seeds, st.integers(1, 5), st.sets(st.integers(0, 5)))
def test_a_film_in_two_parts_knows_what_the_whole_knows(seed, cut, searches):
    frames = np.array(sorted(searches), int)
    cost = np.random.default_rng(seed).uniform(0, 9, 6)
    track = track_of(*cost, seed=seed)
    searched = Hypotheses(some_poses(seed + 1, len(frames), 2), np.ones((len(frames), 2), np.float32))
    nothing = no_alternatives(jax.tree.map(lambda a: a[0, 0], track.poses), 2)
    whole = latest(track, Known(searched, frames, nothing))

    def part(start: int, end: int, before: Alternatives) -> Alternatives:
        here = (frames >= start) & (frames < end)
        found, own = (jax.tree.map(lambda a, i=i: a[i], of) for of, i in ((searched, here), (track, slice(start, end))))
        return latest(own, Known(found, frames[here] - start, before))

    first = part(0, cut, nothing)
    second = part(cut, 6, jax.tree.map(lambda a: a[-1], first))
    for a, b, c in zip(*map(jax.tree.leaves, (first, second, whole)), strict=True):
        np.testing.assert_array_equal(np.concatenate([a, b]), c)


def test_after_it_was_taken_the_first_is_the_one_that_others_are_compared_with():
    poses = some_poses(0, 3)
    excess = np.array([-7.0, -2.0, np.inf], np.float32)
    taken = Alternatives(poses, excess, jax.tree.map(lambda a: a[0], some_poses(1, 1))).taken()
    np.testing.assert_array_equal(taken.excess, [0, 5, np.inf])
    now = jax.tree.map(lambda a: a[:1], poses)  # the track stands where the first one does
    each = carried(*jax.tree.map(lambda a: a[None], (taken.poses, taken.pose)), now)
    np.testing.assert_allclose(each.rotations[0], poses.rotations, atol=1e-5)


@pytest.mark.parametrize(("turn", "counts"), [(0.0, True), (80.0, True), (100.0, False), (180.0, False)])
def test_what_faces_another_way_does_not_count_where_a_fork_tells(turn, counts):
    straight = np.tile(np.eye(3), (2, SEGMENTS, 1, 1))
    straight[1] = Rotation.from_euler("z", turn, degrees=True).as_matrix()
    found = Hypotheses(Pose(np.zeros((1, 2, 3)), straight[None]), np.array([[3.0, 4.0]]))
    assert np.isfinite(facing_alike(found).cost).tolist() == [[True, counts]]
