"""Pose hypotheses: pooled, selected, arranged in rows."""

import jax
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from jaxskel import Pose
from jaxskel.search import Hypotheses
from jaxskel.search._hypotheses import Pool, pool_of, select_distinct


def numbered(number: np.ndarray) -> Pose:
    """Poses that can be told apart by their roots."""
    return Pose(np.repeat(number[..., None], 3, -1).astype(np.float32), np.tile(np.eye(3), (*number.shape, 17, 1, 1)))


def pool(frames: list[int], costs: list[float]) -> Pool:
    return Pool(np.array(frames, int), numbered(np.arange(len(frames))), np.array(costs, np.float32))


def numbers(found: Pool) -> list[int]:
    return found.poses.root[:, 0].astype(int).tolist()


def test_those_of_some_frames_are_replaced():
    before = Hypotheses(numbered(np.arange(6).reshape(3, 2)), np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]))
    after = before.replaced(np.array([2, 0]), Hypotheses(numbered(np.array([[7, 8], [9, 10]])), -np.ones((2, 2))))
    np.testing.assert_array_equal(after.poses.root[..., 0], [[9, 10], [2, 3], [7, 8]])
    np.testing.assert_array_equal(after.cost, [[-1.0, -1.0], [3.0, 4.0], [-1.0, -1.0]])
    np.testing.assert_array_equal(before.cost[0], [1.0, 2.0])


def test_ordered_takes_poses_and_costs_along():
    cost = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    new = Hypotheses(numbered(np.arange(6).reshape(2, 3)), cost).ordered(np.array([[2, 0], [1, 1]]))
    np.testing.assert_array_equal(new.cost, [[3.0, 1.0], [5.0, 5.0]])
    np.testing.assert_array_equal(new.poses.root[..., 1], [[2, 0], [4, 4]])
    assert new.poses.rotations.shape == (2, 2, 17, 3, 3)
    np.testing.assert_array_equal(new.best.root[:, 0], [2, 4])


def test_cheapest_of_each_frame_by_hand():
    found = pool([7, 2, 7, 2, 7], [3.0, 5.0, 1.0, 5.0, 2.0])
    assert numbers(found.cheapest(1)) == [1, 2]  # of equally cheap ones the first
    assert numbers(found.cheapest(2)) == [1, 3, 2, 4]
    assert numbers(found.of(np.array([7])).cheapest(9)) == [2, 4, 0]


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 5)), max_size=30), st.integers(1, 4))
def test_the_rest_costs_more_than_the_cheapest(members, count):
    found = pool([frame for frame, _ in members], [float(cost) for _, cost in members])
    best = found.cheapest(count)
    rest = jax.tree.map(lambda a: a[~np.isin(np.arange(len(found)), numbers(best))], found)
    assert sorted(numbers(best) + numbers(rest)) == list(range(len(found)))
    for frame in np.unique(found.frame):
        chosen, left = best.of(frame[None]), rest.of(frame[None])
        assert len(chosen) == min(count, (found.frame == frame).sum())
        assert (np.diff(chosen.cost) >= 0).all()
        assert len(left) == 0 or left.cost.min() >= chosen.cost.max()


def test_rows_are_filled_up_at_infinite_cost():
    found = pool([4, 1, 4, 1, 1], [2.0, 9.0, 1.0, 7.0, 8.0])
    rows = found.rows(np.array([1, 4]), 3)
    np.testing.assert_array_equal(rows.cost, [[7, 8, 9], [1, 2, np.inf]])
    np.testing.assert_array_equal(rows.poses.root[..., 0], [[3, 4, 1], [2, 0, 0]])


def test_pools_are_joined_and_made_of_rows():
    made = pool_of(numbered(np.arange(6).reshape(2, 3)), np.array([5, 3]))
    assert made.frame.tolist() == [5, 5, 5, 3, 3, 3]
    assert np.isinf(made.cost).all()
    both = made.joined(pool([3], [1.0]))
    assert len(both) == 7
    assert both.cheapest(1).cost.tolist() == [1.0, np.inf]


def test_promising_by_hand():
    # Poses 1 m apart, but for 0 and 2, which are alike.
    found = pool([3, 3, 3, 3, 8, 8], [5.0, 9.0, 4.0, 20.0, 1.0, 1.5])
    found.poses.root[0] = found.poses.root[2] + 0.005
    assert select_distinct(found, 10.0, 9).tolist() == [False, True, True, False, True, True]
    assert select_distinct(found, 30.0, 9).tolist() == [False, True, True, True, True, True]
    assert select_distinct(found, 10.0, 1).tolist() == [False, False, True, False, True, False]
    # Known hypotheses are compared with, but not chosen.
    known = pool([3, 8], [0.0, 3.0])
    known.poses.root[0] = found.poses.root[2]
    known.poses.root[1] = 7.0
    assert select_distinct(found, 10.0, 1, known=known).tolist() == [False, True, False, False, True, False]


def test_poses_differ_by_the_segments_asked_for():
    found = pool([0, 0], [1.0, 2.0])
    found.poses.root[1] = found.poses.root[0]
    found.poses.rotations[1, 4] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    assert select_distinct(found, 9.0, 9).tolist() == [True, True]
    assert select_distinct(found, 9.0, 9, np.array([0, 1, 2])).tolist() == [True, False]


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 9), st.integers(0, 4)), min_size=1, max_size=20))
def test_of_each_frame_the_cheapest_is_promising(members):
    found = pool([frame for frame, _, _ in members], [float(cost) for _, cost, _ in members])
    found.poses.root[:] = np.array([place for _, _, place in members])[:, None]
    chosen = select_distinct(found, 3.0, 2)
    for frame in np.unique(found.frame):
        mine = np.flatnonzero(found.frame == frame)
        went = mine[chosen[mine]]
        assert 1 <= len(went) <= 2
        assert found.cost[went].min() == found.cost[mine].min()
        assert found.cost[went].max() <= found.cost[mine].min() + 3
        places = found.poses.root[went, 0].tolist()
        assert len(set(places)) == len(places)
