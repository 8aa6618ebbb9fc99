"""The whole method: from a recording to poses. The only file that knows the order of the stages."""

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ._body import Body, place_joints
from ._camera import Cameras
from ._confidence import joint_confidence, searched_confidence
from ._descriptors import template_ends
from ._explained import NOT_THE_SUBJECT, trust_in_explained, unexplained_shares
from ._forest import forest_of
from ._frame_words import FRAMES_PER_WORD
from ._graph import SkeletalGraph
from ._hypotheses import Hypotheses
from ._initialise import initial_poses
from ._limbs import L_FOOT, R_FOOT, Limbs
from ._observe import (
    Seen,
    Stopwatch,
    labelled_limbs,
    middles_of_people,
    observed_graph,
    observed_volume,
    person_graphs,
    see_people,
)
from ._poses import Poses, Status, join_poses
from ._prepare import prepare
from ._prepared import Prepared
from ._recording import Recording
from ._refine import Refined, refine_frames
from ._settings import Settings
from ._skeleton import Pose, Skeleton
from ._solve import Search, dear, make_model, solve_frames
from ._stacks import filled, on_device, padded, single_precision, taken
from ._starts import graphless_poses, start_poses
from ._track import Proposed, Track, track_frames
from .terms import Objective, Observed

BATCH = FRAMES_PER_WORD
# A body whose ways from head to feet differ by more than this share from the template's is not this person, or not
# all of a person.
_LEG_TOLERANCE = 0.3
# From a raised hand, which the highest voxel may be, the feet are at most half as far again as from the head.
_FARTHEST = 1.6


def reconstruct_batch(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    recording: Recording,
    prepared: Prepared,
    settings: Settings,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    track: Track | None = None,
) -> tuple[Poses, Track | None]:
    """Reconstruct up to `BATCH` consecutive frames. ``fps`` and ``frame_index`` count from the batch's start.

    Where the settings ask for tracking, the track of the frames before goes in, and the one to go on with comes out.
    """
    count = len(silhouettes)
    joints, tips = np.full((count, 15, 3), np.nan, np.float32), np.full((count, 5, 3), np.nan, np.float32)
    confidence, sides = np.zeros((count, 15), np.float32), np.full(count, 0.5, np.float32)
    cameras = recording.cameras.rotated(prepared.to_z_up)
    seen = see_people(silhouettes, cameras, prepared, stopwatch)
    status, good = seen.status, seen.frames
    if len(good):
        objective = settings.objective_for(prepared.body)
        work = Work(seen, silhouettes, cameras, prepared, settings, objective, stopwatch)
        start, track = start_of(work, recording.fps, track)
        with stopwatch("refine"):
            refined = _refined(start.poses, start.observed, prepared, objective, settings)
        status[good[~start.plausible]] = Status.NO_MATCH
        fitted = start.plausible & refined.finite
        status[good[start.plausible & ~refined.finite]] = Status.FAILED
        status[good[fitted & ~refined.converged]] = Status.NOT_CONVERGED
        done = good[fitted]
        status[done[(status[done] == Status.OK) & seen.lost[done].any(1)]] = Status.VIEW_LOST
        back = prepared.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = refined.joints[fitted] @ back.T, refined.tips[fitted] @ back.T
        confidence[done], sides[done] = start.confidence(refined)[fitted], start.sides[fitted]
    poses = Poses(joints, tips, confidence, sides, status, recording.fps, recording.up, np.arange(count))
    return poses, track


def reconstruct_batches(
    recording: Recording,
    settings: Settings | None = None,
    prepared: Prepared | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[Poses]:
    """Reconstruct a recording batch by batch, in order: for long recordings and progress bars."""
    settings = settings or Settings()
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
    """Reconstruct a recording batch by batch, from a frame on.

    Args:
        first: Frame to begin with, counted from 0: a multiple of `BATCH`.
        track: What came with the batch before, None at the beginning.
        recording: Silhouettes and cameras.
        settings: How to reconstruct.
        prepared: What `prepare` found for this recording and these settings.
        stopwatch: Told the stages.

    Returns:
        Poses of the batches, each with what the next one goes on with.
    """
    for start in range(first, len(recording), BATCH):
        part = slice(start, start + BATCH)
        poses, track = reconstruct_batch(recording.silhouettes[part], recording, prepared, settings, stopwatch, track)
        yield eqx.tree_at(lambda p: p.frame_index, poses, recording.frame_index[part]), track


def reconstruct(recording: Recording, settings: Settings | None = None) -> Poses:
    """Reconstruct the pose of every frame of a recording, each frame by itself.

    Args:
        recording: Silhouettes and cameras; its ``skeleton`` is the template if it is known, otherwise an average
            adult is scaled to the stature that the hulls show.
        settings: How; see `Settings`.

    Returns:
        Poses in the recording's world, with a status for each frame. A frame that cannot be reconstructed has NaN
        joints and a status that says why; it does not harm the others.
    """
    return join_poses(reconstruct_batches(recording, settings))


class Work(NamedTuple):
    """A batch with people in it."""

    seen: Seen
    silhouettes: UInt8[np.ndarray, "frames cams h w8"]
    cameras: Cameras
    """In the world with z up."""
    prepared: Prepared
    settings: Settings
    objective: Objective
    stopwatch: Stopwatch = lambda _: nullcontext()

    def labelled(self, people: Int[np.ndarray, " some"]) -> "_Labelled":
        """The labelled graphs of some of the people."""
        assert self.seen.hulls is not None
        with self.stopwatch("graph"):
            graphs = person_graphs(self.seen.hulls[people], self.prepared.skeleton, self.settings)
        with self.stopwatch("match"):
            return _Labelled(graphs, *labelled_limbs(graphs, self.prepared.skeleton, self.settings))


class _Labelled(NamedTuple):
    graphs: list[SkeletalGraph]
    limbs: Limbs
    facing: Float[np.ndarray, "frames 3"]
    sides: Float[np.ndarray, " frames"]


class Start(NamedTuple):
    """Where the refinement starts, and what is known before it."""

    poses: Pose
    observed: Observed
    """On the device, filled up as `on_device` does."""
    plausible: Bool[np.ndarray, " frames"]
    sides: Float[np.ndarray, " frames"]
    confidence: Callable[[Refined], Float[np.ndarray, "frames joints=15"]]


def start_of(work: Work, fps: float, track: Track | None = None) -> tuple[Start, Track | None]:
    """Where the refinement starts, as the settings ask for it."""
    search = work.settings.search
    return (_by_graph(work), track) if search is None else _by_search(work, search, fps, track)


def _by_graph(work: Work) -> Start:
    """The labelled graph gives the pose (Sect. 3.3)."""
    skeleton = work.prepared.skeleton
    graphs, limbs, facing, sides = work.labelled(np.arange(len(work.seen.frames)))

    def confidence(refined: Refined) -> Float[np.ndarray, "frames joints=15"]:
        return joint_confidence(np.asarray(refined.joints), np.asarray(refined.tips), limbs, skeleton)

    poses = initial_poses(limbs, facing, skeleton)
    return Start(poses, on_device(observed_graph(limbs)), _plausible(graphs, limbs, skeleton), sides, confidence)


def _by_search(work: Work, search: Search, fps: float, track: Track | None) -> tuple[Start, Track | None]:
    """The graph proposes, the silhouettes decide."""
    seen, prepared, tracking, objective = work.seen, work.prepared, work.settings.tracking, work.objective
    people = np.arange(len(seen.frames))
    # What is tracked needs graphs only where it is searched for, unless they are looked at.
    labelled = work.labelled(people) if tracking is None or objective.needs_graph else None
    limbs = Limbs.none(len(people)) if labelled is None else labelled.limbs

    def propose(chosen: Int[np.ndarray, " some"]) -> Proposed:
        limbs, facing, sides = work.labelled(chosen)[1:] if labelled is None else taken(labelled[1:], chosen)
        return Proposed(start_poses(limbs, facing, prepared.skeleton), sides)

    with work.stopwatch("observe"):
        middles = middles_of_people(seen, work.silhouettes, work.cameras)
        observed = observed_volume(
            limbs, seen, work.silhouettes, work.cameras, middles, prepared.max_misses, objective.needs_hull
        )
        observed = on_device(observed)
    fallback = graphless_poses(middles, prepared.skeleton)
    costs, model = prepared.costs, prepared.model or make_model(prepared.body)
    search = search.relative_to(None if costs is None else costs.low)
    with work.stopwatch("search"):
        if tracking is None:
            starts, sides = propose(people)
            found = solve_frames(model, search, starts, fallback, observed)
        else:
            found, sides, track = track_frames(model, search, tracking, fps, track, propose, fallback, observed)
        unexplained = _unexplained(found.best, observed, prepared.body)
        unusual = dear(None if costs is None else costs.typical)
        trust = searched_confidence(_joints(found, prepared.skeleton), found.cost, unusual)
        trust *= trust_in_explained(unexplained)[:, None]
    return Start(found.best, observed, unexplained < NOT_THE_SUBJECT, sides, lambda _: trust), track


def _refined(
    initial: Pose, observed: Observed, prepared: Prepared, objective: Objective, settings: Settings
) -> Refined:
    """Refine the poses of some frames of a batch."""
    count = len(initial.root)
    refined = refine_frames(
        single_precision(objective), settings.parametrisation, settings.solver, single_precision(prepared.skeleton),
        filled(initial), observed, settings.rounds, settings.max_steps,
    )  # fmt: skip
    return jax.tree.map(lambda a: np.asarray(a)[:count], refined)


def _unexplained(poses: Pose, observed: Observed, body: Body) -> Float[np.ndarray, " frames"]:
    """Share of the outlines that lie outside of the body, and not near it."""
    assert observed.contours is not None
    shares = unexplained_shares(single_precision(body), filled(poses), observed.contours)
    return np.asarray(shares)[: len(poses.root)]


def _joints(found: Hypotheses, skeleton: Skeleton) -> Float[np.ndarray, "frames hypotheses joints=15 3"]:
    count, hypotheses = found.cost.shape
    poses = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), padded(found.poses, BATCH))
    joints = np.asarray(place_joints(single_precision(skeleton), poses)[0])
    return joints.reshape(BATCH, hypotheses, *joints.shape[1:])[:count]


def _plausible(graphs: list[SkeletalGraph], limbs: Limbs, skeleton: Skeleton) -> Bool[np.ndarray, " frames"]:
    """Is there at least one leg of about the template's length, and nothing much farther from the head?"""
    way = template_ends(skeleton)[0, [L_FOOT, R_FOOT]]
    legs = np.abs(limbs.lengths[:, [L_FOOT, R_FOOT]] / way - 1) < _LEG_TOLERANCE
    farthest = forest_of(graphs).depths.max(1)
    return (legs & limbs.found[:, [L_FOOT, R_FOOT]]).any(1) & (farthest < _FARTHEST * way.max())
