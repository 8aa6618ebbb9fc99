"""Which way bodies face: rivals that face the other way."""

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.capsule_films import ADULT, joints_of, some

from jaxskel import Pose
from jaxskel.search import Hypotheses, turned_rivals
from jaxskel.search._facing import angles_between, both_ways, cheapest_each_way, left_of, turned_starts
from jaxskel.search._hypotheses import Pool
from jaxskel.synthetic import demo_motion

STANDING = some(demo_motion(ADULT, 120, 24.0), 40)


def facing(*degrees: float) -> Pose:
    """Bodies that face these ways (degrees from the first one's), each in a place of its own."""
    turns = Rotation.from_rotvec(np.radians(degrees)[:, None] * [0.0, 0.0, 1.0]).as_matrix()[:, None]
    roots = np.asarray(STANDING.root) + 0.1 * np.arange(len(degrees))[:, None] * [1.0, 0.0, 0.0]
    poses = Pose(roots, turns @ np.asarray(STANDING.rotations))
    return jax.tree.map(lambda a: np.asarray(a, np.float32), poses)


def pool(frames: list[int], costs: list[float], *degrees: float) -> Pool:
    return Pool(np.array(frames), facing(*degrees), np.array(costs, np.float32))


def test_angles_between_bodies():
    left = np.asarray(left_of(facing(0, 30, 90, 180, 300)))
    np.testing.assert_allclose(np.degrees(angles_between(left, left[0])), [0, 30, 90, 180, 60], atol=0.5)


def test_rivals_face_another_way_than_the_cheapest():
    poses = jax.tree.map(lambda a: a[None], facing(10, 60, 120, 180, 290))
    found = Hypotheses(poses, np.arange(5.0, dtype=np.float32)[None])
    assert turned_rivals(found).tolist() == [[False, False, True, True, False]]


def test_what_is_kept_faces_both_ways():
    found = pool([0, 0, 0, 0, 1, 1], [3, 1, 2, 9, 5, 4], 20, 0, 10, 170, 0, 180)
    kept = both_ways(found, 2)
    assert kept.frame.tolist() == [0, 0, 1, 1]
    assert kept.cost.tolist() == [1, 9, 4, 5]  # not the second cheapest of frame 0, which faces the same way
    assert both_ways(found, 4).cost.tolist() == [1, 2, 3, 9, 4, 5]


def test_nothing_is_made_up_where_all_face_one_way():
    assert both_ways(pool([0, 0, 0], [3, 1, 2], 20, 0, 10), 2).cost.tolist() == [1, 2]


def test_the_cheapest_each_way():
    poses = jax.tree.map(lambda a: a.reshape(2, 3, *a.shape[1:]), facing(0, 10, 175, 180, 170, 160))
    found = Hypotheses(poses, np.array([[1, 2, 3], [5, 6, np.inf]], np.float32))
    two = cheapest_each_way(found.pool(np.array([4, 7])))
    assert sorted(zip(two.frame.tolist(), two.cost.tolist(), strict=True)) == [(4, 1), (4, 3), (7, 5)]


@pytest.mark.parametrize("lean", [0.0, 40.0, 90.0])
def test_starts_face_the_other_way_in_the_same_place(lean):
    tilt = Rotation.from_euler("x", lean, degrees=True).as_matrix()
    pose = Pose(np.asarray(STANDING.root)[None], tilt @ np.asarray(STANDING.rotations)[None])
    joints = joints_of(pose)
    starts = turned_starts(joints, ADULT)
    assert starts.root.shape == (1, 2, 3)
    angles = angles_between(np.asarray(left_of(starts))[0], np.asarray(left_of(pose))[0])
    assert (np.degrees(angles) > 150).all()
    pelvis_and_neck = joints_of(some(starts, 0))[:, :2]
    np.testing.assert_allclose(pelvis_and_neck - joints[0, :2], 0.0, atol=0.02)
