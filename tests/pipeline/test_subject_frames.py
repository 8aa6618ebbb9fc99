"""Poses of a body in the frames that a subject is looked for in: which are searched for widely, and which are kept."""

import numpy as np
import pytest

from jaxskel import Pose
from jaxskel.body import QUANTITIES, SEGMENT_NAMES, Shape
from jaxskel.pipeline._subject_frames import Given, _cheaper, typical
from jaxskel.search import Hypotheses, Search

SHAPE = Shape.of(np.zeros(len(QUANTITIES)))
FRAMES = np.arange(20)


def numbered(frames: np.ndarray, costs: np.ndarray) -> Hypotheses:
    """Two hypotheses of each frame, which stand at the frame's number."""
    root = np.zeros((len(frames), 2, 3), np.float32)
    root[..., 0] = frames[:, None]
    rotations = np.broadcast_to(np.eye(3, dtype=np.float32), (len(frames), 2, len(SEGMENT_NAMES), 3, 3))
    return Hypotheses(Pose(root, rotations), np.stack([costs, costs + 1], 1).astype(np.float32))


class Searching(Given):
    """Finds at each frame its number, and notes what it was asked for, and above which cost it searches widely."""

    asked: list[tuple[list[int], float]] = []

    def poses_of(self, shape: Shape, frames: np.ndarray) -> Hypotheses:
        self.asked.append((frames.tolist(), self.search.doubtful_cost))
        return numbered(frames, np.full(len(frames), 5.0))


@pytest.fixture
def given() -> Searching:
    Searching.asked.clear()
    sight = type("Sight", (), {"middles": np.zeros((len(FRAMES), 3))})
    return Searching(None, None, sight, None, Search())  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(("cost", "wide"), [(44.0, True), (46.0, False)])
def test_frames_on_which_no_size_is_tried_are_searched_widely_only_where_the_body_fits(given, cost, wide):
    tried = numbered(given.tried, np.full(len(given.tried), cost))
    found = given.poses_of_all(SHAPE, tried)
    np.testing.assert_array_equal(found.best.root[:, 0], FRAMES)
    np.testing.assert_array_equal(found.cost[given.tried, 0], cost)
    assert given.asked == [(np.setdiff1d(FRAMES, given.tried).tolist(), 45.0 if wide else np.inf)]


def test_where_sizes_are_tried_on_all_frames_nothing_is_searched_for(given):
    few = given._replace(sight=type("Sight", (), {"middles": np.zeros((3, 3))}))
    tried = numbered(np.arange(3), np.full(3, 50.0))
    assert few.poses_of_all(SHAPE, tried) is tried
    assert given.asked == []


def test_a_narrow_search_never_becomes_wide(given):
    assert given.narrow.search.doubtful_cost == np.inf
    assert given.search.doubtful_cost == 45.0


def test_the_cheaper_poses_of_each_frame_are_kept():
    found = numbered(np.arange(4), np.array([1.0, 50.0, 60.0, 2.0]))
    others = numbered(np.array([101, 102]), np.array([49.0, 61.0]))
    kept = _cheaper(found, others, np.array([1, 2]))
    np.testing.assert_array_equal(kept.best.root[:, 0], [0, 101, 2, 3])
    np.testing.assert_array_equal(kept.cost[:, 0], [1, 49, 60, 2])
    assert typical(kept) == 25.5
