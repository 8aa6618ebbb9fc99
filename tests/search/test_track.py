"""Tracking: the track holds, and it recovers from wrong poses."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.capsule_films import ADULT, BODY, Filmed, film_body, joints_of, some

from jaxskel import Pose
from jaxskel._runtime.batching import on_device
from jaxskel.body import SEGMENT_NAMES
from jaxskel.search import Hypotheses, Proposed, Search, Track, Tracking, make_model, solve_frames, track_frames
from jaxskel.search._best_track import _cheapest, _jumps, _Way, best_track
from jaxskel.search._cheapest_path import cheapest_path, costs_through, jump_costs
from jaxskel.search._facing import left_of
from jaxskel.search._hypotheses import pool_of
from jaxskel.synthetic import demo_motion

FPS, FRAMES = 24.0, 20
SEARCH = Search().relative_to(3.0, 4.0)
TRACKING = Tracking()


@pytest.fixture(scope="module")
def filmed() -> Filmed:
    """A second of a walk."""
    return film_body(some(demo_motion(ADULT, 120, FPS), np.arange(36, 36 + FRAMES)), FPS)


def followed_in(
    filmed: Filmed, frames: slice, track: Track | None, tracking: Tracking = TRACKING
) -> tuple[Hypotheses, Track]:
    starts, fallback, observed = some((filmed.starts, filmed.fallback, filmed.observed), frames)
    found, sides, track, _ = track_frames(
        make_model(BODY), SEARCH, tracking, FPS, track,
        lambda chosen: Proposed(some(starts, chosen), 0.5 + 0.01 * chosen), fallback, observed,
    )  # fmt: skip
    assert track.sides == sides[-1]
    assert np.isfinite(found.cost[:, 0]).all()
    assert not np.isnan(found.cost).any()
    return found, track


def follow(filmed: Filmed, frames: slice, track: Track | None) -> tuple[np.ndarray, Track]:
    """Errors of the worst joint of each frame (m), and the track."""
    found, track = followed_in(filmed, frames, track)
    return np.linalg.norm(joints_of(found.best) - filmed.joints[frames], axis=-1).max(-1), track


def on_track(filmed: Filmed, frame: int, wrong: Pose) -> Track:
    """A track that was good for long and is wrong now; the next search is as far away as possible."""
    return Track(wrong, wrong, 0, np.full(30, 3.0))


@pytest.mark.slow
def test_a_walk_is_followed_over_the_edges_of_batches(filmed):
    whole, _ = follow(filmed, slice(0, 12), None)
    assert whole.max() < 0.08
    _, track = follow(filmed, slice(0, 7), None)
    later, track = follow(filmed, slice(7, 8), track)
    assert later.max() < 0.08
    assert track.since == 2  # searched in frame 0 and, a quarter of a second later, in frame 5
    later, _ = follow(filmed, slice(8, 12), track)
    assert later.max() < 0.08


@pytest.mark.slow
def test_starts_are_asked_for_only_where_it_is_searched_and_tell_the_sides_until_the_next(filmed):
    asked: list[int] = []

    def propose(chosen: np.ndarray) -> Proposed:
        asked.extend(chosen.tolist())
        return Proposed(some(filmed.starts, chosen), 0.6 + 0.01 * chosen)

    given = some((filmed.fallback, filmed.observed), slice(0, 9))
    track = Track(some(filmed.truth, 0), some(filmed.truth, 0), 2, np.full(30, 3.0), 0.9)
    _, sides, _, _ = track_frames(make_model(BODY), SEARCH, Tracking(), FPS, track, propose, *given)
    assert asked == [3]  # every sixth frame, and two have gone by
    np.testing.assert_allclose(sides, [0.9] * 3 + [0.63] * 6)


def test_a_calm_track_is_searched_in_half_as_often(filmed):
    asked: list[int] = []

    def propose(chosen: np.ndarray) -> Proposed:
        asked.extend(chosen.tolist())
        return Proposed(some(filmed.starts, chosen), np.full(len(chosen), 0.9))

    def followed(frames: slice, track: Track) -> Track:
        asked.clear()
        given = some((filmed.fallback, filmed.observed), frames)
        return track_frames(make_model(BODY), SEARCH, Tracking(), FPS, track, propose, *given).track

    right = some(filmed.truth, 0)
    unsure = Track(right, right, 0, np.full(30, 3.0))
    calm = followed(slice(1, 14), unsure)
    assert asked == [5, 11]  # every sixth frame
    assert calm.calm
    assert calm.since == 1
    again = followed(slice(14, 20), replace(calm, since=8))
    assert asked == [3]  # the twelfth frame from the latest search on
    assert again.calm


def test_a_track_that_does_not_take_what_a_search_found_is_not_calm(filmed):
    right = some(filmed.truth, 0)
    back = Rotation.from_euler("z", 180, degrees=True).as_matrix()
    wrong = Pose(np.asarray(right.root), back @ np.asarray(right.rotations))
    stubborn = Tracking(margin=1e6, turn_margin=1e6)
    track = replace(on_track(filmed, 0, wrong), calm=True)
    assert not followed_in(filmed, slice(1, 8), track, stubborn)[1].calm
    assert followed_in(filmed, slice(1, 8), track)[1].calm


@pytest.mark.slow
def test_what_a_search_found_is_known_until_the_next_one(filmed):
    found, track = followed_in(filmed, slice(0, 9), None)
    alone = solve_frames(make_model(BODY), SEARCH, *some((filmed.starts, filmed.fallback, filmed.observed), [0]))
    there = np.isfinite(alone.cost[0])
    assert found.cost.shape == (9, 3 + SEARCH.most)
    for frame in range(5):  # the next search is in frame 5
        assert np.isfinite(found.cost[frame, 3:]).tolist() == there.tolist()
    np.testing.assert_allclose(found.poses.rotations[0, 3:], alone.poses.rotations[0], atol=1e-4)
    assert track.alternatives is not None
    again, _ = followed_in(filmed, slice(9, 11), track)  # the next but one is in frame 11
    np.testing.assert_allclose(again.cost[0, 3:] - again.cost[0, 0], found.cost[8, 3:] - found.cost[8, 0], atol=1e-3)


@pytest.mark.slow
def test_wrong_arms_are_right_again_at_the_next_frame(filmed):
    wrong = some(filmed.truth, 0)
    rotations = np.array(wrong.rotations)
    up = Rotation.from_euler("y", 170, degrees=True).as_matrix()
    for name in ("upper_arm", "forearm", "hand"):
        for side in ("l_", "r_"):
            rotations[SEGMENT_NAMES.index(side + name)] = up @ rotations[SEGMENT_NAMES.index(side + name)]
    wrong = Pose(wrong.root, rotations)
    assert np.linalg.norm(joints_of(some(wrong, None))[0] - filmed.joints[0], axis=-1).max() > 0.5
    error, _ = follow(filmed, slice(1, 4), on_track(filmed, 0, wrong))
    assert error.max() < 0.08


def test_a_body_facing_backwards_is_turned_within_half_a_second(filmed):
    right = some(filmed.truth, 0)
    back = Rotation.from_euler("z", 180, degrees=True).as_matrix()
    wrong = Pose(np.asarray(right.root), back @ np.asarray(right.rotations))
    error, _ = follow(filmed, slice(1, FRAMES), on_track(filmed, 0, wrong))
    assert error[int(FPS / 2) - 1 :].max() < 0.08


def test_a_track_is_followed_other_ways_only_where_it_does_not_meet_what_is_offered(filmed):
    truth, count = some(filmed.truth, slice(1, 7)), 6
    right = np.linalg.norm(joints_of(truth) - filmed.joints[1:7], axis=-1).max()
    assert right < 1e-3
    moved = Pose(np.asarray(truth.root) + np.array([0.0, 0.0, 0.3]), truth.rotations)
    stack, last = on_device(some(filmed.observed, slice(1, 7))), some(filmed.truth, 0)
    track = Track(last, last, 0, np.full(30, 3.0))

    def found(poses: Pose) -> Hypotheses:
        offered = pool_of(Pose(np.asarray(poses.root)[:, None], np.asarray(poses.rotations)[:, None]), np.arange(count))
        # Nothing is offered in the other frames; what is offered costs too much to be taken.
        cost = np.where(np.arange(count) == 3, np.float32(1e6), np.float32(np.inf))
        return best_track(make_model(BODY), Tracking(), track, replace(offered, cost=cost), stack)

    once, twice = found(truth), found(moved)
    assert np.isinf(once.cost[:, 1:]).all()
    for way in (1, 2):
        np.testing.assert_array_equal(once.poses.root[:, way], once.best.root)
    assert np.isfinite(twice.cost).all()
    for each in (once, twice):
        assert np.linalg.norm(joints_of(each.best) - filmed.joints[1:7], axis=-1).max() < 0.08


@pytest.mark.parametrize("seed", range(6))
def test_path_is_the_cheapest_of_all(seed):
    rng = np.random.default_rng(seed)
    frames, tracks = 5, 3
    costs, first = rng.uniform(0, 1, (frames, tracks)), rng.uniform(0, 1, tracks)
    jumps = rng.uniform(0, 0.7, (frames, tracks, tracks)) * (1 - np.eye(tracks))

    def total(path: tuple[int, ...]) -> float:
        between = sum(jumps[i, path[i], path[i + 1]] for i in range(frames - 1))
        return first[path[0]] + sum(costs[i, track] for i, track in enumerate(path)) + between

    paths = list(itertools.product(range(tracks), repeat=frames))
    best = min(paths, key=total)
    assert total(tuple(cheapest_path(costs, jumps, first))) == pytest.approx(total(best))
    through = [
        [min(total(path) for path in paths if path[frame] == track) for track in range(tracks)]
        for frame in range(frames)
    ]
    np.testing.assert_allclose(costs_through(costs, jumps, first), through)


def test_a_jump_costs_a_margin_and_more_if_it_turns_the_body_round():
    tracking = Tracking(margin=2.0, turn_margin=7.0)
    places = np.array([[0.0, 0, 0], [0.04, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])[:, None]
    left = np.array([[0.0, 2, 0], [0, 2, 0], [0.5, 1, 0], [0, -1, 0]])
    jumps = jump_costs(places[:, None], places[None], left[:, None], left[None], tracking)
    np.testing.assert_array_equal(jumps, [[0, 0, 2, 7], [0, 0, 2, 7], [2, 2, 0, 0], [7, 7, 0, 0]])


@pytest.mark.parametrize(
    ("gain", "frames", "jumps"), [(3.0, 1, True), (1.5, 1, False), (1.5, 2, True), (0.5, 3, False)]
)
def test_several_frames_together_pay_for_a_jump_that_one_does_not(filmed, gain, frames, jumps):
    """A way takes another pose, which costs less in the frames after that; a jump costs two."""
    near = some(filmed.truth, np.zeros(4, int))
    far = Pose(np.asarray(near.root) + np.float32(1.0), near.rotations)
    late = np.arange(4) >= 4 - frames
    taken = Pose(np.where(late[:, None], far.root, near.root), near.rotations)
    # It follows the other pose after the frame in which it takes it.
    followed = Pose(np.where((np.arange(4) > 4 - frames)[:, None], far.root, near.root), near.rotations)
    cost = np.full(4, 5.0, np.float32)
    ways = _Way(near, cost, near), _Way(taken, cost - np.float32(gain) * late, followed)
    found = _cheapest(make_model(BODY), Tracking(margin=2.0), None, ways)
    np.testing.assert_array_equal(found.best.root, taken.root if jumps else near.root)
    np.testing.assert_array_equal(found.cost[:, 0], cost - np.float32(gain) * late if jumps else cost)


def test_a_path_that_starts_far_from_the_last_pose_pays_for_it(filmed):
    near = some(filmed.truth, 0)
    far = Pose(np.asarray(near.root) + 1.0, near.rotations)
    poses = Pose(np.stack([far.root, near.root]), np.stack([far.rotations, near.rotations]))
    left = np.asarray(left_of(poses))[None]
    _, first = _jumps(make_model(BODY), Tracking(margin=2.0), on_track(filmed, 0, near), left, joints_of(poses)[None])
    assert first.tolist() == [2.0, 0.0]


def test_margins_grow_with_clothes_and_a_person_may_turn_round_between_frames_that_are_far_apart():
    tracking = Tracking(margin=2.0, turn_margin=10.0)
    assert tracking.for_subject(0.0, 30.0) == tracking
    clothed = tracking.for_subject(0.03, 30.0)
    assert (clothed.margin, clothed.turn_margin) == (10.0, 50.0)
    assert tracking.for_subject(0.0, 2.0).turn_margin == 2.0
