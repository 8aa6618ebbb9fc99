"""From the silhouettes of a batch to the labelled skeletal graph of the person in each frame."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ._camera import Cameras
from ._carve import carve
from ._contours import RAYS, contours
from ._credible import credible
from ._descriptors import MAX_ENDS, describe_ends
from ._field import hull_volumes
from ._forest import forest_of
from ._ghosts import explains_silhouettes
from ._graph import SkeletalGraph, limit_ends, prune_all
from ._hull import VisualHulls
from ._limbs import Limbs, label_limbs
from ._person import find_people, seen_whole
from ._placement import body_middles
from ._poses import Status
from ._prepared import Prepared
from ._scoop import scoop
from ._settings import Settings
from ._sides import tell_sides
from ._silhouette_distances import silhouette_distances
from ._skeleton import Skeleton
from ._views import MIN_VIEWS, lost_views, silhouette_areas
from .terms import Observed

# Poor masks cut a person up; the parts are this near to each other (m).
_CUT = 0.1

Stopwatch = Callable[[str], AbstractContextManager[Any]]
"""Called with the name of a stage, gives a context that lasts as long as the stage."""


class Seen(eqx.Module):
    """The frames of a batch that hold one whole person, and that person's hull."""

    status: Int[np.ndarray, " frames"]
    """A `Status` for each frame of the batch; OK where there is a person."""
    frames: Int[np.ndarray, " people"]
    """The frames with a person, in order; hulls are of these."""
    lost: Bool[np.ndarray, "frames cams"]
    """Views that show no person while others do."""
    hulls: VisualHulls | None
    """None where there is nothing to carve."""


def skeletal_graphs(
    hulls: VisualHulls, roots: Int[np.ndarray, " frames"], min_branch: float = 0.24
) -> list[SkeletalGraph]:
    """Scoop the graph of each hull and prune it (Sect. 3.1)."""
    graphs = prune_all(scoop(hulls, roots), min_branch)
    many = 1 + forest_of(graphs).leaves.sum(1) > MAX_ENDS
    return [limit_ends(graph, MAX_ENDS) if m else graph for graph, m in zip(graphs, many, strict=True)]


def person_graphs(hulls: VisualHulls, skeleton: Skeleton, settings: Settings) -> list[SkeletalGraph]:
    """The graph of the person in each hull, as the settings ask for it."""
    return skeletal_graphs(hulls, settings.root.roots(hulls, skeleton), settings.min_branch)


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


def see_people(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    prepared: Prepared,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Seen:
    """Carve a batch of at most 32 frames and find the person in each.

    `stopwatch` is told of the stages ``carve`` and ``graph``.
    """
    lost = lost_views(silhouette_areas(silhouettes), cameras)
    views = (~lost).sum(1)
    enough = views >= MIN_VIEWS
    status = np.where(enough, Status.NO_HULL, np.where(views > 0, Status.TOO_FEW_VIEWS, Status.EMPTY))
    if prepared.table is None:
        return Seen(status, np.zeros(0, int), lost, None)
    with stopwatch("carve"):
        hulls = carve(silhouettes, prepared.table, lost, prepared.max_misses)
    with stopwatch("graph"):
        people = find_people(
            hulls, prepared.edge, _CUT if prepared.max_misses else 0.0,
            lambda f, body: explains_silhouettes(hulls, f, body, silhouettes[f], cameras, lost[f]),
        )  # fmt: skip
        status[enough] = people.status[enough]
        cut = ~seen_whole(people.hulls, prepared.table, lost)
        status[(status == Status.OK) & cut] = Status.PARTLY_OUTSIDE
        frames = np.flatnonzero(status == Status.OK)
    return Seen(status, frames, lost, people.hulls[frames])


def observed_graph(limbs: Limbs) -> Observed:
    """What the labelled graph alone says."""
    return Observed(limbs.paths, limbs.found, limbs.neck, limbs.pelvis)


def observed_volume(
    limbs: Limbs,
    seen: Seen,
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    middles: Float[np.ndarray, "people 3"],
    misses: int,
    needs_hull: bool = False,
) -> Observed:
    """What graph, outlines and, on demand, the hull say: of the frames with a person, of whom there must be one."""
    own = silhouettes[seen.frames], cameras, seen.lost[seen.frames]
    # Carving is sparing with misses, which make a hull fat; here the outlines say how thin the body is.
    distances = silhouette_distances(*own, misses + 1 if misses else 0)
    outlines = contours(*own, 2 * RAYS if misses else RAYS)
    if misses:
        outlines = credible(outlines, distances, middles, (~own[2]).sum(1), RAYS)
    field, surface = None, None
    if needs_hull:
        assert seen.hulls is not None
        field, surface = hull_volumes(seen.hulls)
    return Observed(limbs.paths, limbs.found, limbs.neck, limbs.pelvis, field, surface, outlines, distances)


def middles_of_people(
    seen: Seen, silhouettes: UInt8[np.ndarray, "frames cams h w8"], cameras: Cameras
) -> Float[np.ndarray, "people 3"]:
    """The middle of each person as the silhouettes alone say it (m)."""
    return body_middles(cameras, silhouettes[seen.frames], seen.lost[seen.frames])
