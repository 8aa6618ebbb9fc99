"""The person in each hull: one connected body that lies inside the observed volume."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # imports its parts when they are first used
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Float, Int

from ..poses import Status
from ._connected_bodies import find_bodies
from ._projection_table import ProjectionTable
from ._visual_hulls import VisualHulls

_LEAST_PERSON = 0.008  # smaller hulls are no person (m^3)
_RIVAL_SHARE = 0.3  # a body with this share of the largest one's volume is a second person
_EDGE_VOXELS = 12  # a body with this many voxels at the edge of the observed volume extends beyond it
_CUT_SHARE = 0.02  # a view with a larger share of the body outside its image does not show it whole


@register_dataclass
@dataclass(frozen=True, eq=False)
class People:
    """The person of each frame.

    Attributes:
        hulls: Hulls reduced to the person; empty where there is none.
        status: `Status.OK`, or why there is no person.
    """

    hulls: VisualHulls
    status: Int[np.ndarray, " frames"]


def observed_edge(observed: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
    """Mask of the observed voxels with an unobserved neighbour; everything outside the grid is unobserved."""
    padded = np.pad(observed, 1)
    core = slice(1, -1)
    inner = np.ones_like(observed)
    for axis in range(3):
        for side in (slice(None, -2), slice(2, None)):
            inner &= padded[(*(core,) * axis, side, *(core,) * (2 - axis))]
    return observed & ~inner


def find_people(
    hulls: VisualHulls,
    edge: Bool[np.ndarray, "x y z"],
    gap: float = 0.0,
    explains_all: Callable[[int, Bool[np.ndarray, " n"]], bool] = lambda frame, body: False,
) -> People:
    """Keep the largest connected body of each hull.

    Args:
        hulls: Hulls as carved, with z up.
        edge: From [`observed_edge`][], on the hulls' grid.
        gap: Bodies within this distance of the largest one belong to it (m): holes in masks cut a person into parts.
        explains_all: Given a frame and the mask of its largest body, whether this body explains the silhouettes alone,
            although another body is as large as a person; see `explains_silhouettes`.
    """
    bodies = find_bodies(hulls)
    status = np.full(len(hulls), int(Status.OK))
    chosen = np.zeros(len(bodies.sizes), bool)
    for f in range(len(hulls)):
        own = np.flatnonzero(bodies.frame_of_body == f)
        sizes, parts = bodies.sizes[own], own[:0]
        if len(own):
            parts = own[np.argmax(sizes), None]
        if gap > 0 and len(own) > 1:
            voxels = hulls.voxels[hulls.inside[f]]
            parts = _joined(voxels, bodies.voxels_of(f), parts[0], gap / hulls.grid.spacing)
            sizes = np.append(bodies.sizes[parts].sum(), bodies.sizes[np.setdiff1d(own, parts)])
        status[f] = _judge(sizes * hulls.grid.spacing**3)
        if status[f] == Status.SEVERAL_PEOPLE:
            largest = np.zeros(len(hulls.voxels), bool)
            largest[hulls.inside[f]] = np.isin(bodies.voxels_of(f), parts)
            if explains_all(f, largest):
                status[f] = Status.OK
        chosen[parts] = status[f] == Status.OK
    hulls = hulls.only(chosen[bodies.body])
    at_edge = np.flatnonzero(edge[tuple(hulls.voxels.T)])
    outside = hulls.inside[:, at_edge].sum(1) >= _EDGE_VOXELS
    status[outside] = Status.PARTLY_OUTSIDE
    return People(hulls.only(~outside[hulls.runs.frame]) if outside.any() else hulls, status)


def _joined(
    voxels: Int[np.ndarray, "n 3"], body: Int[np.ndarray, " n"], largest: int | np.integer, gap: float
) -> Int[np.ndarray, " parts"]:
    """The largest body and all bodies within `gap` (voxels) of it."""
    others = np.flatnonzero(body != largest)
    near, _ = scipy.spatial.KDTree(voxels[body == largest]).query(voxels[others], distance_upper_bound=gap)
    return np.append(largest, np.unique(body[others[np.isfinite(near)]]))


def shares_outside(hulls: VisualHulls, table: ProjectionTable) -> Float[np.ndarray, "frames cams"]:
    """Share of each hull's voxels outside each camera's image; if above zero, the image cuts the body."""
    some = table.partly_seen(hulls.voxels)  # usually none
    unseen = table.pixels_at(hulls.voxels[some]) == table.unseen
    shares = np.zeros((len(hulls), len(unseen)))
    for camera in np.flatnonzero(unseen.any(1)):
        shares[:, camera] = hulls.inside[:, some[unseen[camera]]].sum(1)
    return shares / np.maximum([np.count_nonzero(each) for each in hulls.inside], 1)[:, None]


def seen_whole(
    hulls: VisualHulls, table: ProjectionTable, empty_views: Bool[np.ndarray, "frames cams"]
) -> Bool[np.ndarray, " frames"]:
    """Whether enough views show the body from head to foot.

    If images cut the body, few whole views are left, often from one side only, and the hull has long tails that look
    like limbs. Four whole views bound the body; with four cameras or fewer, one view may be cut.
    """
    outside = shares_outside(hulls, table)
    whole = ((outside < _CUT_SHARE) & ~empty_views).sum(1)
    cut = ((outside >= _CUT_SHARE) & ~empty_views).any(1) | (outside > 1 - _CUT_SHARE).any(1)
    return ~cut | (whole >= min(4, empty_views.shape[1] - 1))


def _judge(volumes: np.ndarray) -> Status:
    if len(volumes) == 0 or volumes.max() < _LEAST_PERSON:
        return Status.NO_HULL
    ordered = np.sort(volumes)[::-1]
    if len(ordered) > 1 and ordered[1] >= max(_LEAST_PERSON, _RIVAL_SHARE * ordered[0]):
        return Status.SEVERAL_PEOPLE
    return Status.OK
