"""The whole method: from a recording to poses, batch by batch."""

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace

from ..hull import FRAMES_PER_WORD, Stopwatch
from ..poses import Poses, join_poses
from ..recording import Recording
from ..refinement import Refined
from ..refinement.terms import Objective
from ..search import Track
from ._assemble import frames_of
from ._coupled_batches import Started, coupled_batches
from ._film_decision import RefinedBatch, decided
from ._prepare import check_given, prepare
from ._prepared import Prepared
from ._refine import refine
from ._settings import Settings
from ._start import Start, start_of, start_other_way

BATCH = FRAMES_PER_WORD


def reconstruct_batch(
    part: Recording,
    prepared: Prepared,
    settings: Settings,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    track: Track | None = None,
    at_once: int = BATCH,
) -> tuple[Poses, Track | None]:
    """Reconstruct up to `at_once` consecutive frames of a recording.

    With tracking, `track` is the state after the frames before, and the new state is returned with the poses.

    `at_once` is the number of frames that programs are compiled for: 32, or 1 for frames that come one by one.
    """
    return next(decided(iter([refined_batch(part, prepared, settings, stopwatch, track, at_once)])))


def refined_batch(
    part: Recording,
    prepared: Prepared,
    settings: Settings,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    track: Track | None = None,
    at_once: int = BATCH,
) -> RefinedBatch:
    """As `reconstruct_batch`, but later batches may decide which way the person faces."""
    objective = settings.refinement.objective_for(prepared.body)
    seen, start, after = start_of(part, prepared, settings, objective, track, stopwatch, at_once)

    def refined(start: Start) -> Refined:
        with stopwatch("refine"):
            return refine(start.poses, start.observed, prepared.skeleton, objective, settings.refinement)

    one_way, other = None, None
    if start is not None:
        one_way = refined(start)
        if start.fork is not None:
            turned = start_other_way(start, prepared)
            other = turned._replace(observed=None), refined(turned)
        start = start._replace(observed=None)
    frames, people = frames_of(part, prepared, settings), replace(seen, hulls=None)
    return RefinedBatch(
        frames, people, start, one_way, after, track is None, prepared.skeleton, prepared.stature_deviation, other
    )


def reconstruct_batches(
    recording: Recording,
    settings: Settings | None = None,
    prepared: Prepared | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[Poses]:
    """Reconstruct a recording batch by batch, in order: for long recordings and progress bars.

    If the objective couples frames, each batch of 32 is refined together with the 16 frames before and after it.
    """
    settings = settings or Settings()
    check_given(recording, settings)
    prepared = prepared or prepare(recording, settings)
    objective = settings.refinement.objective_for(prepared.body)
    if objective.couplings:
        yield from coupled_batches(
            _started(recording, settings, prepared, objective, stopwatch), prepared.skeleton, objective,
            settings.refinement, prepared.stature_deviation, stopwatch,
        )  # fmt: skip
        return
    for poses, _ in batches_from(0, None, recording, settings, prepared, stopwatch):
        yield poses


def _started(
    recording: Recording, settings: Settings, prepared: Prepared, objective: Objective, stopwatch: Stopwatch
) -> Iterator[Started]:
    """All batches of a recording, before their refinement."""
    track = None
    for first in range(0, len(recording), BATCH):
        part = recording[first : first + BATCH]
        seen, start, track = start_of(part, prepared, settings, objective, track, stopwatch)
        yield Started(frames_of(part, prepared, settings), seen, start)


def batches_from(
    first: int,
    track: Track | None,
    recording: Recording,
    settings: Settings,
    prepared: Prepared,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[tuple[Poses, Track | None]]:
    """Reconstruct a recording batch by batch, from a given frame on; the objective couples no frames.

    Args:
        first: Frame to begin with, counted from 0: a multiple of `BATCH`.
        track: Tracking state returned with the batch before; None at the beginning.
        recording: Silhouettes and cameras.
        settings: How to reconstruct.
        prepared: Result of `prepare` for this recording and these settings.
        stopwatch: Times the stages.

    Returns:
        Poses of the batches, each with the tracking state for the next one. Where a second track faces the other way,
        they come as soon as later batches cannot change them any more, see `decided`.
    """
    yield from decided(_refined(first, track, recording, settings, prepared, stopwatch))


def _refined(
    first: int, track: Track | None, recording: Recording, settings: Settings, prepared: Prepared, stopwatch: Stopwatch
) -> Iterator[RefinedBatch]:
    """All batches from a frame on, after their refinement."""
    for start in range(first, len(recording), BATCH):
        batch = refined_batch(recording[start : start + BATCH], prepared, settings, stopwatch, track)
        track = batch.track
        yield batch


def reconstruct(recording: Recording, settings: Settings | None = None) -> Poses:
    """Reconstruct the pose of every frame of a recording.

    Args:
        recording: Silhouettes and cameras; its ``skeleton`` is the template if it is known, otherwise an average
            adult is scaled to the stature of the hulls.
        settings: See `Settings`; the default ones if None.

    Returns:
        Poses in the recording's world, with a status for each frame. A frame that cannot be reconstructed has NaN
        joints and a status that says why; it does not affect other frames. If the objective couples frames, those that
        follow one another are refined together, and one status says whether that has converged.
    """
    return join_poses(reconstruct_batches(recording, settings))
