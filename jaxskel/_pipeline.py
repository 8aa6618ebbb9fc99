"""The whole method: from a recording to poses. The only file that knows the order of the stages."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import equinox as eqx
import jax
import numpy as np
import optimistix as optx
from jaxtyping import Bool, Float, Int, UInt8

from ._carve import FRAMES_PER_WORD, ProjectionTable, carve, projection_table
from ._confidence import joint_confidence
from ._descriptors import MAX_ENDS, describe_ends, template_ends
from ._graph import SkeletalGraph, limit_ends, prune
from ._grid import make_grid
from ._head import HeadBall, HighestVoxel, RootFinder
from ._hull import VisualHulls
from ._initialise import initial_poses
from ._limbs import HANDLESS_DESCRIPTOR, L_FOOT, PAPER_DESCRIPTOR, R_FOOT, Limbs, label_limbs
from ._match import DtwMatcher, Matcher
from ._person import find_people, observed_edge, seen_whole
from ._placement import place_grid
from ._poses import Poses, Status, join_poses
from ._recording import Recording, rotation_to_z_up
from ._refine import default_solver, refine_frames
from ._scoop import scoop
from ._sides import tell_sides
from ._skeleton import Skeleton, default_adult
from ._stature import estimate_stature
from ._views import MIN_VIEWS, lost_views, silhouette_areas
from .parametrisations import ExactBones, Parametrisation
from .terms import Objective, Observed, paper_objective

BATCH = FRAMES_PER_WORD
_STATURE_FRAMES = 24
# A body whose ways from head to feet differ by more than this share from the template's is not this person, or not
# all of a person.
_LEG_TOLERANCE = 0.3
# From a raised hand, which the highest voxel may be, the feet are at most half as far again as from the head.
_FARTHEST = 1.6

Stopwatch = Callable[[str], AbstractContextManager[Any]]
"""Called with the name of a stage, gives a context that lasts as long as the stage."""


class Settings(eqx.Module):
    """How to reconstruct. The defaults are the paper's method with two changes, see `paper_settings`."""

    spacing: float = 0.015
    """Edge length of a voxel (m)."""
    box: Float[np.ndarray, "2 3"] | None = None
    """Lower and upper corner of what to carve, in the recording's world (m); by default around the silhouettes."""
    min_views: int | None = None
    """Cameras that must see a voxel for it to be occupied; by default 3, with fewer than six cameras 2."""
    max_misses: int = 0
    """k-of-n voting: so many cameras may see background at an occupied voxel."""
    root: RootFinder = HeadBall()
    """Where the graph starts: on the ball of the head, or, as in the paper, at the `HighestVoxel`."""
    min_branch: float = 0.2
    """Shorter branches of the graph are pruned (m)."""
    matcher: Matcher = DtwMatcher()
    descriptor: tuple[int, ...] = HANDLESS_DESCRIPTOR
    """Labels whose geodesics describe neck and pelvis (Eq. 5)."""
    objective: Objective = eqx.field(default_factory=paper_objective)
    parametrisation: Parametrisation = ExactBones()
    solver: optx.AbstractLeastSquaresSolver = eqx.field(default_factory=default_solver)
    rounds: int = 3
    max_steps: int = 16


def paper_settings() -> Settings:
    """The paper's method, faithful: the head is the highest voxel, and Eq. 5 describes inner nodes by all end nodes."""
    return Settings(root=HighestVoxel(), descriptor=PAPER_DESCRIPTOR)


class Prepared(eqx.Module):
    """What holds for all frames of a recording."""

    to_z_up: Float[np.ndarray, "3 3"]
    """Rotation from the recording's world to the one worked in."""
    table: ProjectionTable | None
    """None where no frame has a hull."""
    edge: Bool[np.ndarray, "x y z"]
    """Observed voxels at the edge of what is observed."""
    skeleton: Skeleton
    """Template: the subject's, or the default adult at the estimated stature."""
    skeleton_is_known: bool


def prepare(recording: Recording, settings: Settings) -> Prepared:
    """Place the grid, project it into the cameras, and estimate the stature where the subject is unknown."""
    to_z_up = rotation_to_z_up(recording.up)
    cameras = recording.cameras.rotated(to_z_up)
    sils = recording.silhouettes
    min_views = settings.min_views or (3 if len(cameras) >= 6 else 2)
    if settings.box is not None:
        corners = settings.box @ to_z_up.T  # the rotation only exchanges axes
        grid = make_grid(corners.min(0), corners.max(0), settings.spacing)
    else:
        lost = lost_views(silhouette_areas(sils), cameras)
        grid = place_grid(cameras, sils, lost, settings.spacing, min_views, settings.max_misses)
    table, edge = None, np.zeros((0, 0, 0), bool)
    if grid is not None:
        table = projection_table(cameras, grid, sils.shape[2], 8 * sils.shape[3], min_views)
        edge = observed_edge(np.asarray(table.observed).reshape(grid.shape))
    known = recording.skeleton is not None
    prepared = Prepared(to_z_up, table, edge, recording.skeleton or default_adult(), known)
    if known or table is None:
        return prepared
    chosen = np.unique(np.linspace(0, len(recording) - 1, _STATURE_FRAMES).astype(int))
    lost = lost_views(silhouette_areas(sils[chosen]), cameras)
    people = find_people(carve(sils[chosen], table, lost, settings.max_misses), edge)
    hulls = people.hulls[people.status == Status.OK]
    roots = settings.root.roots(hulls, prepared.skeleton)
    stature = estimate_stature(skeletal_graphs(hulls, roots, settings.min_branch))
    if stature is None or not 0.8 < stature < 2.4:
        return prepared
    return eqx.tree_at(lambda p: p.skeleton, prepared, default_adult(stature))


def skeletal_graphs(
    hulls: VisualHulls, roots: Int[np.ndarray, " frames"], min_branch: float = 0.2
) -> list[SkeletalGraph]:
    """Scoop the graph of each hull and prune it (Sect. 3.1)."""
    return [limit_ends(prune(graph, min_branch), MAX_ENDS) for graph in scoop(hulls, roots)]


def labelled_limbs(
    graphs: list[SkeletalGraph], skeleton: Skeleton, settings: Settings
) -> tuple[Limbs, Float[np.ndarray, "frames 3"], Float[np.ndarray, " frames"]]:
    """Match the end nodes, find neck and pelvis, tell left from right (Sect. 3.2, 3.3).

    Returns:
        The limbs, the facing direction, and the confidence in left and right.
    """
    ends = describe_ends(graphs)
    matches = settings.matcher.match(ends, skeleton)
    return tell_sides(label_limbs(graphs, ends, matches, skeleton, settings.descriptor), skeleton)


def reconstruct_batch(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    recording: Recording,
    prepared: Prepared,
    settings: Settings,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Poses:
    """Reconstruct up to `BATCH` frames. ``fps`` and ``frame_index`` of the result count from the batch's start."""
    count = len(silhouettes)
    joints, tips = np.full((count, 15, 3), np.nan, np.float32), np.full((count, 5, 3), np.nan, np.float32)
    confidence, sides = np.zeros((count, 15), np.float32), np.full(count, 0.5, np.float32)

    lost = lost_views(silhouette_areas(silhouettes), recording.cameras)
    views = (~lost).sum(1)
    enough = views >= MIN_VIEWS
    status = np.where(enough, Status.NO_HULL, np.where(views > 0, Status.TOO_FEW_VIEWS, Status.EMPTY))
    if prepared.table is not None:
        with stopwatch("carve"):
            hulls = carve(silhouettes, prepared.table, lost, settings.max_misses)
        with stopwatch("graph"):
            people = find_people(hulls, prepared.edge)
            status[enough] = people.status[enough]
            cut = ~seen_whole(people.hulls, prepared.table, lost)
            status[(status == Status.OK) & cut] = Status.PARTLY_OUTSIDE
            good = np.flatnonzero(status == Status.OK)
            hulls = people.hulls[good]
            roots = settings.root.roots(hulls, prepared.skeleton)
            graphs = skeletal_graphs(hulls, roots, settings.min_branch)
        with stopwatch("match"):
            limbs, facing, side_confidence = labelled_limbs(graphs, prepared.skeleton, settings)
            plausible = _plausible(graphs, limbs, prepared.skeleton)
            status[good[~plausible]] = Status.NO_MATCH
        with stopwatch("refine"):
            initial = initial_poses(limbs, facing, prepared.skeleton)
            observed = Observed(limbs.paths, limbs.found, limbs.neck, limbs.pelvis)
            refined = refine_frames(
                settings.objective, settings.parametrisation, settings.solver, _single(prepared.skeleton),
                _padded(initial), _padded(observed), settings.rounds, settings.max_steps,
            )  # fmt: skip
            refined = jax.tree.map(lambda a: np.asarray(a)[: len(good)], refined)
        fitted = plausible & refined.finite
        status[good[plausible & ~refined.finite]] = Status.FAILED
        status[good[fitted & ~refined.converged]] = Status.NOT_CONVERGED
        done = good[fitted]
        status[done[(status[done] == Status.OK) & lost[done].any(1)]] = Status.VIEW_LOST
        trust = joint_confidence(refined.joints, refined.tips, limbs, prepared.skeleton)
        back = prepared.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = refined.joints[fitted] @ back.T, refined.tips[fitted] @ back.T
        confidence[done], sides[done] = trust[fitted], side_confidence[fitted]
    return Poses(joints, tips, confidence, sides, status, recording.fps, recording.up, np.arange(count))


def reconstruct_batches(
    recording: Recording,
    settings: Settings | None = None,
    prepared: Prepared | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[Poses]:
    """Reconstruct a recording batch by batch, in order: for long recordings and progress bars."""
    settings = settings or Settings()
    prepared = prepared or prepare(recording, settings)
    for start in range(0, len(recording), BATCH):
        part = slice(start, start + BATCH)
        poses = reconstruct_batch(recording.silhouettes[part], recording, prepared, settings, stopwatch)
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


def _plausible(graphs: list[SkeletalGraph], limbs: Limbs, skeleton: Skeleton) -> Bool[np.ndarray, " frames"]:
    """Is there at least one leg of about the template's length, and nothing much farther from the head?"""
    way = template_ends(skeleton)[0, [L_FOOT, R_FOOT]]
    legs = np.abs(limbs.lengths[:, [L_FOOT, R_FOOT]] / way - 1) < _LEG_TOLERANCE
    farthest = np.array([graph.depths.max() for graph in graphs])
    return (legs & limbs.found[:, [L_FOOT, R_FOOT]]).any(1) & (farthest < _FARTHEST * way.max())


def _single(tree: Any) -> Any:
    """Arrays in the precision that JAX computes in, so that the caller's precision does not compile again."""
    return jax.tree.map(lambda a: np.asarray(a, np.float32), tree)


def _padded(tree: Any) -> Any:
    """Repeat the first frame up to `BATCH` frames, so that every batch has the same shapes."""

    def pad(a: np.ndarray) -> np.ndarray:
        a = a if a.dtype == bool else np.asarray(a, np.float32)
        filler = np.zeros((1, *a.shape[1:]), a.dtype) if len(a) == 0 else a[:1]
        return np.concatenate([a, np.repeat(filler, BATCH - len(a), 0)])

    return jax.tree.map(pad, tree)
