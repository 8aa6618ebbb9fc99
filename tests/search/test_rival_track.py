"""A second track that faces the other way: a turn costs the same however it is made, and the sum of frames decides."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.capsule_films import ADULT, BODY, Filmed, film_body, joints_of, some

from jaxskel import Pose
from jaxskel.search import Proposed, Search, Track, Tracking, make_model, track_frames, turned_rivals
from jaxskel.search._rival_track import _costs_of_turns
from jaxskel.synthetic import demo_motion

FPS, FRAMES = 24.0, 14
TRACKING = Tracking(margin=2.0, turn_margin=20.0)
BOTH_WAYS = Search().relative_to(3.0, 60.0)


@pytest.fixture(scope="module")
def filmed() -> Filmed:
    return film_body(some(demo_motion(ADULT, 120, FPS), np.arange(36, 36 + FRAMES)), FPS)


def followed(filmed: Filmed, track: Track | None, frames: slice = slice(None)):
    starts, fallback, observed = some((filmed.starts, filmed.fallback, filmed.observed), frames)
    found, _, track, _ = track_frames(
        make_model(BODY), BOTH_WAYS, TRACKING, FPS, track, lambda chosen: Proposed(some(starts, chosen), np.ones(1)),
        fallback, observed,
    )  # fmt: skip
    return np.linalg.norm(joints_of(found.best) - filmed.joints[frames], axis=-1).max(-1), found, track


def turned(pose: Pose) -> Pose:
    back = Rotation.from_euler("z", 180, degrees=True).as_matrix()
    return Pose(np.asarray(pose.root), back @ np.asarray(pose.rotations))


def lefts(*degrees: float) -> np.ndarray:
    """Directions of left sides in successive frames, of one track."""
    angles = np.radians(degrees)
    return np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1)[:, None]


def test_a_jump_costs_more_the_more_it_turns():
    left = np.concatenate([lefts(0, 0), lefts(0, 90), lefts(180, 180)], 1)
    left[1] = left[0]
    places = np.arange(3.0)[None, :, None, None] * np.ones((2, 1, 1, 3))
    costs = _costs_of_turns(TRACKING, FPS, left, places)
    np.testing.assert_allclose(costs[0], [[0, 2, 20], [2, 0, 20], [20, 20, 0]])


@pytest.mark.parametrize("fps", [24.0, 60.0])
def test_a_turn_in_parts_costs_no_less_than_a_turn_at_once(fps):
    def total(*degrees: float) -> float:
        left = lefts(*degrees)
        return float(_costs_of_turns(TRACKING, fps, left, np.zeros((len(left), 1, 1, 3))).sum())

    allowed = np.degrees(2.5 * np.pi) / fps
    assert total(0, allowed, 2 * allowed) == pytest.approx(0.0, abs=1e-9)  # a person may turn so fast
    at_once = total(0, 180)
    assert at_once == pytest.approx(TRACKING.turn_margin - TRACKING.margin)
    assert total(0, 90 + allowed / 2, 180 + allowed) == pytest.approx(at_once, rel=0.01)


@pytest.mark.slow
def test_a_film_that_begins_the_wrong_way_is_right_from_its_beginning(filmed):
    wrong = turned(some(filmed.truth, 0))
    error, found, track = followed(filmed, Track(wrong, wrong, 0, np.full(30, 3.0)))
    assert error.max() < 0.08
    # The way that is given up does not go on, and costs more in every frame until it has turned round, too.
    assert track.rival is None
    other = turned_rivals(found)[:, 1]
    assert other[0]
    assert (found.cost[:, 1] - found.cost[:, 0] > 1.0)[other].all()


@pytest.mark.slow
def test_a_film_that_is_right_has_a_rival_that_costs_more(filmed):
    error, found, track = followed(filmed, None)
    assert error.max() < 0.08
    assert found.cost.shape == (FRAMES, 4 + BOTH_WAYS.most)
    assert track.rival is None
