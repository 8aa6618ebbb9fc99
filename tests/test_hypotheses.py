"""Hypotheses of poses: ordered, merged, cut off."""

import jax
import numpy as np

from jaxskel import Hypotheses, Pose


def hypotheses(costs: list[list[float]]) -> Hypotheses:
    """Poses whose roots tell which they are: frame, number, cost."""
    cost = np.array(costs)
    index = np.indices(cost.shape)
    return Hypotheses(Pose(np.stack([*index, cost], -1), np.tile(np.eye(3), (*cost.shape, 17, 1, 1))), cost)


def test_ordered_takes_poses_and_costs_along():
    new = hypotheses([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).ordered(np.array([[2, 0], [1, 1]]))
    np.testing.assert_array_equal(new.cost, [[3.0, 1.0], [5.0, 5.0]])
    np.testing.assert_array_equal(new.poses.root[..., 1], [[2, 0], [1, 1]])
    np.testing.assert_array_equal(new.poses.root[..., 2], new.cost)
    assert new.poses.rotations.shape == (2, 2, 17, 3, 3)


def test_merged_keeps_the_cheapest_of_both_where_asked():
    old = hypotheses([[2.0, 4.0], [2.0, 4.0], [2.0, 4.0]])
    frames = np.array([2, 0])
    new = hypotheses([[2.0, 5.0, 9.0], [1.0, 3.0, 9.0]])  # of these frames only
    both = old.merged(new, frames)
    np.testing.assert_array_equal(both.cost, [[1.0, 2.0], [2.0, 4.0], [2.0, 2.0]])
    np.testing.assert_array_equal(both.poses.root[..., 2], both.cost)
    # Whose they are: the second row of the new ones, then old ones; of equally cheap ones the old one is first.
    np.testing.assert_array_equal(both.poses.root[..., 0], [[1, 0], [1, 1], [2, 0]])
    np.testing.assert_array_equal(old.cost, [[2.0, 4.0]] * 3)
    nothing = jax.tree.map(lambda a: a[:0], new)
    np.testing.assert_array_equal(old.merged(nothing, frames[:0]).cost, old.cost)


def test_first_is_the_beginning_of_each_frame():
    poses = hypotheses([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]).first(2)
    np.testing.assert_array_equal(poses.root[..., 2], [[1.0, 2.0], [4.0, 5.0]])
