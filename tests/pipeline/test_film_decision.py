"""Batches wait until the film has decided which way a person faces; nothing is decided twice, and nothing is lost."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel import Pose, default_adult
from jaxskel.hull import Seen
from jaxskel.pipeline import _film_decision as film_decision
from jaxskel.pipeline._assemble import FramesOf
from jaxskel.pipeline._film_decision import RefinedBatch, decided
from jaxskel.pipeline._start import Start
from jaxskel.pipeline._uncertainties import TrustInSearch
from jaxskel.refinement import Refined
from jaxskel.search import Fork, Hypotheses, Rival, Track, decide

ADULT = default_adult()
NOWHERE = Pose(np.zeros(3, np.float32), np.zeros((17, 3, 3), np.float32))
JUMP = np.array([[0.0, 10.0], [10.0, 0.0]])


def track_of(number: int, excess: float | None) -> Track:
    rival = None if excess is None else Rival(NOWHERE, NOWHERE, excess)
    return Track(NOWHERE, NOWHERE, number, np.zeros(0), rival=rival)


def poses_at(x: np.ndarray) -> Pose:
    """Poses whose root is at (x, 0, 0)."""
    roots = np.stack([x, 0 * x, 0 * x], -1).astype(np.float32)
    return Pose(roots, np.zeros((*x.shape, 17, 3, 3), np.float32))


def way_of(fork: Fork, path: np.ndarray, through: np.ndarray, x: np.ndarray) -> tuple[Start, Refined]:
    """Start and refinement of people whose joints are all at x."""
    count, found = len(x), fork.hypotheses(path, through)
    trust = TrustInSearch(
        np.full((count, 3, 15, 3), 0.3, np.float32) * np.array([0, 1, 0])[None, :, None, None], found.cost, 40.0,
        np.zeros(count), 0.0, 0.0, np.tile([False, True, False], (count, 1)),
    )  # fmt: skip
    observed: object = None
    start = Start(poses_at(x), observed, np.ones(count, bool), np.full(count, 0.9), trust, found, fork)  # pyright: ignore[reportArgumentType]
    points = np.zeros((count, 15, 3), np.float32) + x[:, None, None].astype(np.float32)
    small = jnp.tile(1e-4 * jnp.eye(3), (count, 15, 1, 1))
    yes = jnp.ones(count, bool)
    refined = Refined(
        poses_at(x), jnp.asarray(points), jnp.asarray(points[:, :5]), small, {}, yes, yes, yes.astype(int)
    )
    refined = jax.tree.map(np.asarray, refined)
    return start, refined


def batch_of(number: int, cost: list[list[float]], first: float, ends: float | None, begins: bool = False):
    """A batch whose people stand at 0 on the first track and at 1 on the second; the second frame shows nobody."""
    count = len(cost)
    columns = np.tile([0.0, 1.0], (count, 1))
    both = Hypotheses(poses_at(columns), np.array(cost, np.float32))
    fork = Fork(
        both,
        (both.ordered(np.zeros((count, 1), int)), both.ordered(np.ones((count, 1), int))),
        np.tile(JUMP, (count, 1, 1)),
        np.array([0.0, first]),
        1,
    )
    path, through, _ = decide([fork])
    start, refined = way_of(fork, path, through, path)
    people = np.array([0, *range(2, count + 1)])
    seen = Seen(np.zeros(count + 1, int), people, np.zeros((count + 1, 4), bool), None)
    frames = FramesOf(np.eye(3), "+Z", 30.0, np.arange(count + 1) + 100 * number)
    return RefinedBatch(
        frames, seen, start, refined, track_of(number, ends), begins, ADULT, None,
        way_of(fork, 1 - path, through, 1 - path),
    )  # fmt: skip


def told(batches: list[RefinedBatch]) -> list[tuple[int, list[float]]]:
    """Number of each batch by its track, and where its people stand."""
    found = []
    for poses, track in decided(iter(batches)):
        assert track is not None
        x = poses.joints[:, 0, 0]
        found.append((track.since, x[np.isfinite(x)].tolist()))
    return found


def test_a_later_batch_turns_the_people_of_an_earlier_one():
    first = batch_of(0, [[1, 2], [5, 1], [1, 1]], 0.0, 3.0, begins=True)
    # The second batch goes on from the second track of the first, as long as nothing else is known.
    assert told([first]) == [(0, [1, 1, 1])]
    later = batch_of(1, [[9, 1], [9, 1], [9, 1]], 3.0, None)
    assert told([first, later]) == [(0, [0, 0, 0]), (1, [1, 1, 1])]


def test_the_confidence_is_that_of_the_film():
    first = batch_of(0, [[1, 2], [5, 1], [1, 1]], 0.0, 3.0, begins=True)
    alone = next(decided(iter([first])))[0]
    sure = next(decided(iter([first, batch_of(1, [[9, 1], [30, 1], [30, 1]], 3.0, None)])))[0]
    nearly = next(decided(iter([first, batch_of(1, [[4, 1], [3, 1], [3, 2]], 3.0, None)])))[0]
    assert sure.confidence[0].min() > 0.9
    assert alone.confidence[0].max() < 0.9
    assert nearly.confidence[0].max() < sure.confidence[0].min()
    spread = [np.trace(poses.covariance[0, 0]) for poses in (sure, nearly)]
    assert spread[0] < spread[1]
    assert np.isnan(sure.joints[1]).all()  # nobody is seen there
    assert sure.confidence[1].max() == 0


def test_a_batch_comes_as_soon_as_it_is_settled():
    seen: list[int] = []

    def batches() -> Iterator[RefinedBatch]:
        for number in range(4):
            seen.append(number)
            # In the first frame of the third batch, both ways must have been the first track's.
            cost = [[1.0, 1.0]] * 3 if number != 2 else [[1, 90], [1, 1], [1, 1]]
            yield batch_of(number, cost, 4.0 if number else 0.0, 4.0, begins=number == 0)

    came = []
    for _, track in decided(batches()):
        assert track is not None
        came.append((track.since, len(seen)))
    assert came == [(0, 3), (1, 3), (2, 4), (3, 4)]


def test_no_batch_waits_longer_than_is_allowed(monkeypatch):
    monkeypatch.setattr(film_decision, "_LONGEST", 2)
    alike = [batch_of(number, [[1, 1]] * 3, 4.0 if number else 0.0, 4.0, begins=number == 0) for number in range(5)]
    waited, taken = [], 0

    def batches() -> Iterator[RefinedBatch]:
        nonlocal taken
        for batch in alike:
            taken += 1
            yield batch

    for _ in decided(batches()):
        waited.append(taken)
    assert waited == [3, 4, 5, 5, 5]


@pytest.mark.parametrize("alone", [True, False])
def test_each_stretch_is_decided_by_itself(alone):
    """Where processes follow stretches of a film, the end of one says nothing of the beginning of the next."""
    first = batch_of(0, [[1, 2], [5, 1], [1, 1]], 0.0, 3.0, begins=True)
    second = batch_of(1, [[9, 1], [9, 1], [9, 1]], 0.0, 3.0, begins=True)
    found = told([first] if alone else [first, second])
    assert found[0] == (0, [1, 1, 1])


def test_a_batch_without_people_keeps_its_place():
    first = batch_of(0, [[1, 2], [5, 1], [1, 1]], 0.0, 3.0, begins=True)
    seen = Seen(np.ones(2, int), np.zeros(0, int), np.ones((2, 4), bool), None)
    frames = FramesOf(np.eye(3), "+Z", 30.0, np.arange(2))
    nobody = RefinedBatch(frames, seen, None, None, track_of(7, 3.0), False, ADULT)
    later = batch_of(1, [[9, 1], [9, 1], [9, 1]], 3.0, None)
    assert told([first, nobody, later]) == [(0, [0, 0, 0]), (7, []), (1, [1, 1, 1])]
