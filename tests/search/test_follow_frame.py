"""Following in a stream: a search that lasts over several frames mends a wrong track."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.capsule_films import ADULT, BODY, Filmed, film_body, joints_of, some

from jaxskel import Pose
from jaxskel._runtime.batching import on_device
from jaxskel.body import SEGMENT_NAMES
from jaxskel.search import (
    Searched,
    Track,
    Tracking,
    doubt_arises,
    follow_frame,
    hurried,
    lost,
    make_model,
    must_be_found,
    search_in_doubt,
    search_is_due,
)
from jaxskel.search._follow_frame import search_on
from jaxskel.search._track_state import Ongoing
from jaxskel.synthetic import demo_motion

pytestmark = pytest.mark.slow

FPS, FRAMES = 24.0, 20


@pytest.fixture(scope="module")
def filmed() -> Filmed:
    """A second of a walk."""
    return film_body(some(demo_motion(ADULT, 120, FPS), np.arange(36, 36 + FRAMES)), FPS)


def test_a_search_begins_at_intervals_and_once_only(filmed):
    pose = some(filmed.truth, 0)
    track = Track(pose, pose, 4, np.full(30, 3.0))
    assert not search_is_due(Tracking(), FPS, track)
    track = replace(track, since=5)  # a quarter of a second at 24 frames per second
    assert search_is_due(Tracking(), FPS, track)
    assert not search_is_due(Tracking(), FPS, replace(track, ongoing=Ongoing(found_at(pose, 3.0), pose, 3.0)))
    assert not search_is_due(Tracking(), FPS, hurried(track))
    assert not must_be_found(track)
    assert must_be_found(lost(track))


@pytest.mark.parametrize("in_doubt", [False, True])
@pytest.mark.parametrize("same", [False, True])
def test_the_next_search_is_twice_as_far_after_one_that_ended_at_the_tracks_pose(filmed, same, in_doubt):
    there = some(filmed.truth, 5)
    ongoing = Ongoing(found_at(there if same else raised_arm(there), 3.0), there, 3.0, in_doubt)
    track = Track(some(filmed.truth, 6), there, 2, np.full(30, 3.0), 0.5, ongoing, calm=True)
    stack = on_device(some(filmed.observed, [7]), 1)
    while track.ongoing is not None:
        track, _ = search_on(make_model(BODY), Tracking(), track, stack)
    assert track.calm == (same and not in_doubt)
    assert search_is_due(Tracking(), FPS, replace(track, since=5)) == (not track.calm)
    assert search_is_due(Tracking(), FPS, replace(track, since=11))


def test_a_search_is_put_off_in_a_hurry(filmed):
    pose = some(filmed.truth, 5)
    track = Track(pose, some(filmed.truth, 4), 0, np.full(30, 3.0), 0.5, Ongoing(found_at(pose, 3.0), pose, 3.0))
    stack = on_device(some(filmed.observed, [6]), 1)
    for _ in range(4):  # more than the search has steps
        followed = follow_frame(make_model(BODY), Tracking(), FPS, hurried(track), stack)
        assert followed is not None
        assert followed.track.ongoing is not None
        assert followed.track.ongoing.steps is track.ongoing.steps
    assert next(track.ongoing.steps) is None


def found_at(pose: Pose, cost: float):
    """A search of three steps."""
    yield
    yield
    poses = jax.tree.map(lambda a: np.asarray(a)[None], pose)
    return Searched(poses, np.array([cost], np.float32), 0.9)


def raised_arm(pose: Pose) -> Pose:
    """The pose with the right arm turned by 170 degrees."""
    raised = [SEGMENT_NAMES.index(f"r_{name}") for name in ("upper_arm", "forearm", "hand")]
    rotations = np.array(pose.rotations)
    rotations[raised] = Rotation.from_euler("y", 170, degrees=True).as_matrix() @ rotations[raised]
    return Pose(pose.root, rotations)


@pytest.mark.parametrize(
    ("cost", "tracking", "better"),
    [(3.0, Tracking(), True), (98.5, Tracking(), False), (98.5, Tracking().for_one_offer(FPS), True)],
)
def test_what_a_search_found_is_carried_to_the_frame_that_has_come(filmed, cost, tracking, better):
    model = make_model(BODY)

    def wrong(frame: int) -> Pose:
        return raised_arm(some(filmed.truth, frame))

    ongoing = Ongoing(found_at(some(filmed.truth, 2), cost), wrong(2), 100.0)
    track = Track(wrong(5), wrong(4), 0, np.full(30, 3.0), 0.5, ongoing)
    stack = on_device(some(filmed.observed, [6]), 1)
    for _ in range(2):
        track, offer = search_on(model, tracking, track, stack)
        assert offer is None
        assert track.ongoing is not None
    track, offer = search_on(model, tracking, track, stack)
    assert track.ongoing is None
    assert track.sides == 0.9
    assert (offer is not None) == better
    assert track.alternatives is not None
    np.testing.assert_allclose(track.alternatives.excess, [cost - 100])
    if offer is not None:
        assert np.linalg.norm(joints_of(offer.poses)[0] - filmed.joints[6], axis=-1).max() < 0.08


def test_frames_from_one_search_to_the_next_pay_one_margin():
    assert Tracking().for_one_offer(FPS).margin * 6 == pytest.approx(Tracking().margin)  # a quarter of a second
    assert Tracking().for_one_offer(FPS).turn_margin == Tracking().turn_margin
    assert Tracking(interval=0.0).for_one_offer(FPS).margin == Tracking().margin


@pytest.mark.parametrize(("cost", "frames"), [(3.0, 5), (6.0, 3)])
def test_a_search_rests_in_every_other_frame_while_all_is_as_usual(filmed, cost, frames):
    """The search has three steps; the second cost is above the usual one by more than the margin."""
    pose = some(filmed.truth, 5)
    costs = np.append(np.full(30, 3.0), cost)
    track = Track(pose, some(filmed.truth, 4), 0, costs, 0.5, Ongoing(found_at(pose, 200.0), pose, 3.0))
    stack = on_device(some(filmed.observed, [6]), 1)
    taken = 0
    while track.ongoing is not None:
        followed = follow_frame(make_model(BODY), Tracking(), FPS, replace(track, costs=costs), stack)
        assert followed is not None
        track = followed.track
        taken += 1
    assert taken == frames


def test_doubt_is_searched_for_at_once(filmed):
    model, truth = make_model(BODY), some(filmed.truth, 6)
    before = Track(some(filmed.truth, 5), some(filmed.truth, 4), 9, np.full(30, 3.0))
    stack = on_device(some(filmed.observed, [6]), 1)
    followed = follow_frame(model, Tracking(), FPS, before, stack)
    assert followed is not None
    assert not doubt_arises(Tracking(), FPS, followed.track)
    raised = raised_arm(followed.track.last)
    doubtful = replace(followed.track, last=raised, costs=np.append(before.costs, 15.0))
    assert doubt_arises(Tracking(), FPS, doubtful)
    assert not doubt_arises(Tracking(), FPS, replace(doubtful, since=2))
    wrong = replace(followed.found, poses=jax.tree.map(lambda a: a[None, None], raised), cost=np.full((1, 1), 15.0))
    found, sides, after, _ = search_in_doubt(
        model, Tracking(), FPS, before, followed._replace(found=wrong, track=doubtful), found_at(truth, 3.0), stack
    )  # fmt: skip
    assert after.ongoing is None
    assert after.since == 0
    assert sides == [0.9]
    assert np.linalg.norm(joints_of(found.best)[0] - filmed.joints[6], axis=-1).max() < 0.08


def test_a_walk_is_followed_and_a_jump_is_astray(filmed):
    model, track = make_model(BODY), Track(some(filmed.truth, 0), some(filmed.truth, 0), 0, np.full(30, 3.0))
    for frame in range(1, 5):
        found = follow_frame(model, Tracking(), FPS, track, on_device(some(filmed.observed, [frame]), 1))
        assert found is not None
        hypotheses, _, track, _ = found
        assert np.linalg.norm(joints_of(hypotheses.best)[0] - filmed.joints[frame], axis=-1).max() < 0.08
    away = eqx.tree_at(lambda t: t.last.root, track, track.last.root + np.float32([0.6, 0, 0]))
    assert follow_frame(model, Tracking(), FPS, away, on_device(some(filmed.observed, [5]), 1)) is None
