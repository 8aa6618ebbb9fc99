"""The whole method: from a recording to poses, batch by batch."""

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float, UInt8

from ..body import Skeleton
from ..hull import FRAMES_PER_WORD, Seen, Stopwatch
from ..poses import Poses, Status, join_poses
from ..recording import Recording
from ..refinement.terms import Objective
from ..search import Track
from ._prepare import check_given, prepare
from ._prepared import Prepared
from ._refine import refine
from ._settings import RefinementSettings, Settings
from ._start import Start, start_of

BATCH = FRAMES_PER_WORD


class World(NamedTuple):
    """The world and the time that poses are given in."""

    to_z_up: Float[np.ndarray, "3 3"]
    """Rotation from this world to one with z up, in which all stages work."""
    up: str
    fps: float


def reconstruct_batch(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    recording: Recording,
    prepared: Prepared,
    settings: Settings,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    track: Track | None = None,
    at_once: int = BATCH,
) -> tuple[Poses, Track | None]:
    """Reconstruct up to `at_once` consecutive frames. ``fps`` and ``frame_index`` count from the batch's start.

    With tracking, `track` is the state after the frames before, and the new state is returned with the poses.

    `at_once` is the number of frames that programs are compiled for: 32, or 1 for frames that come one by one.
    """
    objective = settings.refinement.objective_for(prepared.body)
    seen, start, track = start_of(silhouettes, recording.fps, prepared, settings, objective, track, stopwatch, at_once)
    world = World(prepared.to_z_up, recording.up, recording.fps)
    poses = refined_poses(seen, start, prepared.skeleton, objective, settings.refinement, world, stopwatch)
    return replace(poses, stature_deviation=prepared.stature_deviation), track


def refined_poses(
    seen: Seen,
    start: Start | None,
    skeleton: Skeleton,
    objective: Objective,
    how: RefinementSettings,
    world: World,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Poses:
    """Refine the start poses of a batch, and give every frame its status."""
    count = len(seen.status)
    joints, tips = np.full((count, 15, 3), np.nan, np.float32), np.full((count, 5, 3), np.nan, np.float32)
    rotations = np.full((count, 17, 3, 3), np.nan, np.float32)
    covariance, confidence = np.full((count, 15, 3, 3), np.nan, np.float32), np.zeros((count, 15), np.float32)
    sides = np.full(count, 0.5, np.float32)
    status, good = seen.status, seen.frames
    if start is not None:
        with stopwatch("refine"):
            refined = refine(start.poses, start.observed, skeleton, objective, how)
        status[good[~start.plausible]] = Status.NO_MATCH
        fitted = start.plausible & refined.finite
        status[good[start.plausible & ~refined.finite]] = Status.FAILED
        status[good[fitted & ~refined.converged]] = Status.NOT_CONVERGED
        done = good[fitted]
        status[done[(status[done] == Status.OK) & seen.empty_views[done].any(1)]] = Status.VIEW_LOST
        back = world.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = refined.joints[fitted] @ back.T, refined.tips[fitted] @ back.T
        rotations[done] = back @ refined.pose.rotations[fitted]
        uncertainty = start.uncertainty(refined)
        covariance[done] = back @ uncertainty.covariance[fitted] @ back.T
        confidence[done], sides[done] = uncertainty.confidence[fitted], start.sides[fitted]
    return Poses(
        joints, tips, rotations, skeleton, confidence, sides, status, world.fps, world.up, np.arange(count), covariance
    )  # fmt: skip


def reconstruct_batches(
    recording: Recording,
    settings: Settings | None = None,
    prepared: Prepared | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[Poses]:
    """Reconstruct a recording batch by batch, in order: for long recordings and progress bars."""
    settings = settings or Settings()
    check_given(recording, settings)
    prepared = prepared or prepare(recording, settings)
    for poses, _ in batches_from(0, None, recording, settings, prepared, stopwatch):
        yield poses


def batches_from(
    first: int,
    track: Track | None,
    recording: Recording,
    settings: Settings,
    prepared: Prepared,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[tuple[Poses, Track | None]]:
    """Reconstruct a recording batch by batch, from a given frame on.

    Args:
        first: Frame to begin with, counted from 0: a multiple of `BATCH`.
        track: Tracking state returned with the batch before; None at the beginning.
        recording: Silhouettes and cameras.
        settings: How to reconstruct.
        prepared: Result of `prepare` for this recording and these settings.
        stopwatch: Times the stages.

    Returns:
        Poses of the batches, each with the tracking state for the next one.
    """
    for start in range(first, len(recording), BATCH):
        part = slice(start, start + BATCH)
        poses, track = reconstruct_batch(recording.silhouettes[part], recording, prepared, settings, stopwatch, track)
        yield eqx.tree_at(lambda p: p.frame_index, poses, recording.frame_index[part]), track


def reconstruct(recording: Recording, settings: Settings | None = None) -> Poses:
    """Reconstruct the pose of every frame of a recording.

    Args:
        recording: Silhouettes and cameras; its ``skeleton`` is the template if it is known, otherwise an average
            adult is scaled to the stature of the hulls.
        settings: See `Settings`; the default ones if None.

    Returns:
        Poses in the recording's world, with a status for each frame. A frame that cannot be reconstructed has NaN
        joints and a status that says why; it does not affect other frames.
    """
    return join_poses(reconstruct_batches(recording, settings))
