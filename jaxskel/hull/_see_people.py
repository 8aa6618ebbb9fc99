"""Carving a batch of frames and finding the one person in each."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Float, Int, UInt8

from ..cameras import Cameras
from ..poses import Status
from ..recording import MIN_VIEWS, find_empty_views, silhouette_areas
from ._carve import carve
from ._frame_bits import FRAMES_PER_WORD
from ._ghosts import explains_silhouettes
from ._grid_placement import body_middles
from ._others import without_others
from ._people import find_people, observed_edge, seen_whole
from ._projection_table import ProjectionTable
from ._visual_hulls import VisualHulls

# Poor masks cut a person into parts, which are at most this far apart (m).
_CUT = 0.1

Stopwatch = Callable[[str], AbstractContextManager[Any]]
"""Called with the name of a stage, returns a context manager that is open as long as the stage lasts."""


@register_dataclass
@dataclass(frozen=True, eq=False)
class Seen:
    """The frames of a batch that show exactly one whole person, and the hull of that person.

    Attributes:
        status: A `Status` for each frame of the batch; OK where there is a person.
        frames: Indices of the frames with a person, ascending; `hulls` has only these.
        empty_views: Views that show no person while others do.
        hulls: Hulls of these people; None if there was nothing to carve, or if it was not needed.
    """

    status: Int[np.ndarray, " frames"]
    frames: Int[np.ndarray, " people"]
    empty_views: Bool[np.ndarray, "frames cams"]
    hulls: VisualHulls | None


def see_people(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    table: ProjectionTable | None,
    edge: Bool[np.ndarray, "x y z"],
    max_misses: int,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    at_once: int = FRAMES_PER_WORD,
    hidden: UInt8[np.ndarray, "frames cams h w8"] | None = None,
) -> Seen:
    """Carve a batch of at most 32 frames and find the person in each.

    Args:
        silhouettes: Packed bits, 1 = person.
        cameras: The rig, in the grid's world.
        table: Projection of the grid into the cameras; None where no frame has a hull.
        edge: Mask of the observed voxels at the edge of the observed volume, see `observed_edge`.
        max_misses: Number of cameras that may see background at an occupied voxel.
        stopwatch: Called with the stages ``carve`` and ``graph``.
        at_once: Frames that are carved at once, see `carve`.
        hidden: Packed bits of pixels where somebody else may stand before the person; they carve nothing.
    """
    empty_views, enough, status = _views(silhouettes, cameras, Status.NO_HULL)
    if table is None:
        return Seen(status, np.zeros(0, int), empty_views, None)
    with stopwatch("carve"):
        if hidden is None:
            hulls = carve(silhouettes, table, empty_views, max_misses, at_once)
        else:
            hulls = carve(silhouettes | hidden, table, empty_views, max_misses, at_once)
            hulls = without_others(hulls, table, silhouettes, hidden)
    with stopwatch("graph"):
        people = find_people(
            hulls, edge, _CUT if max_misses else 0.0,
            # Who was told apart from others is one person: other bodies are theirs.
            lambda f, body: (
                hidden is not None or explains_silhouettes(hulls, f, body, silhouettes[f], cameras, empty_views[f])
            ),
        )  # fmt: skip
        status[enough] = people.status[enough]
        cut = ~seen_whole(people.hulls, table, empty_views)
        status[(status == Status.OK) & cut] = Status.PARTLY_OUTSIDE
        frames = np.flatnonzero(status == Status.OK)
    return Seen(status, frames, empty_views, people.hulls[frames])


def see_bodies(hulls: VisualHulls) -> Seen:
    """Find the person in each of some volumes that were not carved: one body inside the grid.

    What touches the edge of the grid reaches out of it. There are no views, so none is empty.
    """
    people = find_people(hulls, observed_edge(np.ones(hulls.grid.shape, bool)))
    status = np.where(hulls.inside.any(1), people.status, int(Status.EMPTY))
    frames = np.flatnonzero(status == Status.OK)
    return Seen(status, frames, np.zeros((len(hulls), 0), bool), people.hulls[frames])


def trust_views(silhouettes: UInt8[np.ndarray, "frames cams h w8"], cameras: Cameras) -> Seen:
    """Take it that each frame with enough views shows the one person who was there before, without carving."""
    empty_views, enough, status = _views(silhouettes, cameras, Status.OK)
    return Seen(status, np.flatnonzero(enough), empty_views, None)


def _views(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"], cameras: Cameras, enough_views: Status
) -> tuple[Bool[np.ndarray, "frames cams"], Bool[np.ndarray, " frames"], Int[np.ndarray, " frames"]]:
    """Empty views, whether the others are enough, and a status: `enough_views`, or what is missing."""
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    views = (~empty_views).sum(1)
    enough = views >= MIN_VIEWS
    few = np.where(views > 0, Status.TOO_FEW_VIEWS, Status.EMPTY)
    return empty_views, enough, np.where(enough, enough_views, few)


def middles_of_people(
    seen: Seen, silhouettes: UInt8[np.ndarray, "frames cams h w8"], cameras: Cameras
) -> Float[np.ndarray, "people 3"]:
    """Middle of each person in the cameras' world (m), computed from the silhouettes alone."""
    return body_middles(cameras, silhouettes[seen.frames], seen.empty_views[seen.frames])
