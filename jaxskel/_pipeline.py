"""The whole method: from a recording to poses. The only file that knows the order of the stages."""

from collections.abc import Iterator
from contextlib import nullcontext

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ._body import Body, place_joints
from ._carve import FRAMES_PER_WORD
from ._confidence import joint_confidence, searched_confidence
from ._descriptors import template_ends
from ._explained import unexplained_shares
from ._forest import forest_of
from ._graph import SkeletalGraph
from ._hypotheses import Hypotheses
from ._initialise import initial_poses
from ._limbs import L_FOOT, R_FOOT, Limbs
from ._observe import Stopwatch, labelled_limbs, middles_of_people, observed_graph, observed_volume, see_people
from ._poses import Poses, Status, join_poses
from ._prepare import prepare
from ._prepared import Prepared
from ._recording import Recording
from ._refine import Refined, refine_frames
from ._settings import Settings
from ._skeleton import Pose, Skeleton
from ._solve import dear, make_model, solve_frames
from ._stacks import padded, single_precision
from ._starts import graphless_poses, start_poses
from ._track import Track, track_frames
from .terms import Objective, Observed

BATCH = FRAMES_PER_WORD
# A body whose ways from head to feet differ by more than this share from the template's is not this person, or not
# all of a person.
_LEG_TOLERANCE = 0.3
# From a raised hand, which the highest voxel may be, the feet are at most half as far again as from the head.
_FARTHEST = 1.6
# A fit that leaves more of the outlines unexplained than this share is of something else than the subject. Holes and
# blobs in poor masks leave about an eighth.
_UNEXPLAINED = 0.4


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
    objective = settings.objective_for(prepared.body)
    seen = see_people(silhouettes, cameras, prepared, settings, stopwatch)
    status, good = seen.status, seen.frames
    if len(good):
        with stopwatch("match"):
            limbs, facing, side_confidence = labelled_limbs(seen.graphs, prepared.skeleton, settings)
        if settings.search is None:
            observed = observed_graph(limbs)
            plausible = _plausible(seen.graphs, limbs, prepared.skeleton)
            initial = initial_poses(limbs, facing, prepared.skeleton)
        else:
            with stopwatch("search"):
                middles = middles_of_people(seen, silhouettes, cameras)
                observed = observed_volume(
                    limbs, seen, silhouettes, cameras, middles, prepared.max_misses, objective.needs_hull
                )
                starts, fallback = (
                    start_poses(limbs, facing, prepared.skeleton),
                    graphless_poses(middles, prepared.skeleton),
                )
                costs, model = prepared.costs, make_model(prepared.body)
                search = settings.search.relative_to(None if costs is None else costs.low)
                if settings.tracking is None:
                    found = solve_frames(model, search, starts, fallback, observed)
                else:
                    found, track = track_frames(
                        model, search, settings.tracking, recording.fps, track, starts, fallback, observed
                    )
                initial = found.best
                plausible = _unexplained(initial, observed, prepared.body) < _UNEXPLAINED
                unusual = dear(None if costs is None else costs.typical)
                trust = searched_confidence(_joints(found, prepared.skeleton), found.cost, unusual)
        with stopwatch("refine"):
            refined = _refined(initial, observed, prepared, objective, settings)
        status[good[~plausible]] = Status.NO_MATCH
        fitted = plausible & refined.finite
        status[good[plausible & ~refined.finite]] = Status.FAILED
        status[good[fitted & ~refined.converged]] = Status.NOT_CONVERGED
        done = good[fitted]
        status[done[(status[done] == Status.OK) & seen.lost[done].any(1)]] = Status.VIEW_LOST
        if settings.search is None:
            trust = joint_confidence(np.asarray(refined.joints), np.asarray(refined.tips), limbs, prepared.skeleton)
        back = prepared.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = refined.joints[fitted] @ back.T, refined.tips[fitted] @ back.T
        confidence[done], sides[done] = trust[fitted], side_confidence[fitted]
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
    track = None
    for start in range(0, len(recording), BATCH):
        part = slice(start, start + BATCH)
        poses, track = reconstruct_batch(recording.silhouettes[part], recording, prepared, settings, stopwatch, track)
        yield eqx.tree_at(lambda p: p.frame_index, poses, recording.frame_index[part])


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


def _refined(
    initial: Pose, observed: Observed, prepared: Prepared, objective: Objective, settings: Settings
) -> Refined:
    """Refine the poses of some frames of a batch."""
    count = len(initial.root)
    refined = refine_frames(
        single_precision(objective), settings.parametrisation, settings.solver, single_precision(prepared.skeleton),
        padded(initial, BATCH), padded(observed, BATCH), settings.rounds, settings.max_steps,
    )  # fmt: skip
    return jax.tree.map(lambda a: np.asarray(a)[:count], refined)


def _unexplained(poses: Pose, observed: Observed, body: Body) -> Float[np.ndarray, " frames"]:
    """Share of the outlines that lie outside of the body, and not near it."""
    assert observed.contours is not None
    shares = unexplained_shares(single_precision(body), padded(poses, BATCH), padded(observed.contours, BATCH))
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
