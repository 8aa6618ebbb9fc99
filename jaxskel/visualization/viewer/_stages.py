"""Intermediate results of each frame before any pose: hull, skeletal graph and its labelled nodes."""

from collections.abc import Iterator

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ...graph import SkeletalGraph
from ...hull import FRAMES_PER_WORD, VisualHulls, carve
from ...matching import Limbs
from ...pipeline import Prepared, Settings, observe_batch
from ...poses import Status
from ...recording import Recording

_NEIGHBOURS = np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)])


class FrameStages(eqx.Module):
    """Hull and graph of one frame, in the recording's world.

    Attributes:
        silhouettes: The silhouettes: packed bits, as in the recording.
        status: `Status.OK` if there is one whole person.
        surface: Centres of the voxels at the surface of the hull (m): that of the person, or, if enough views show
            something other than one whole person, that of everything carved.
        edges: Edges of the skeletal graph (m); none without a person.
        named: Positions of the labelled end nodes, then of the inner nodes (m); NaN if not found.
    """

    silhouettes: UInt8[np.ndarray, "cams h w8"]
    status: Status
    surface: Float[np.ndarray, "voxels 3"]
    edges: Float[np.ndarray, "edges 2 3"]
    named: Float[np.ndarray, "labels 3"]


def stages_of_frames(
    recording: Recording, rows: Int[np.ndarray, " frames"], prepared: Prepared, settings: Settings
) -> Iterator[FrameStages]:
    """Carve frames of a recording, and extract and label their graphs, one batch at a time.

    Args:
        recording: Silhouettes and cameras.
        rows: Frame numbers, counted from 0, ascending.
        prepared: Result of `prepare` for the recording.
        settings: Settings of the stages.
    """
    template = prepared.skeleton.template
    labels = len(template.tip_names) + len(template.inner)
    for start in range(0, len(rows), FRAMES_PER_WORD):
        found = observe_batch(recording[rows[start : start + FRAMES_PER_WORD]], prepared, settings, outlines=False)
        seen = found.seen
        person = {int(frame): i for i, frame in enumerate(seen.frames)}
        graphs, limbs, everything = [], Limbs.none(0), None
        if found.labelled is not None:
            graphs, limbs = found.labelled.graphs, found.labelled.limbs
        # Show the hull of rejected frames too, which reveals why they were rejected; `see_people` only keeps the hulls
        # of people. With too few views there is no hull.
        refused = ~np.isin(seen.status, (Status.OK, Status.EMPTY, Status.TOO_FEW_VIEWS))
        if prepared.table is not None and refused.any():
            everything = carve(found.silhouettes, prepared.table, seen.empty_views, prepared.max_misses)
        for frame in range(len(found.silhouettes)):
            surface, edges, named = np.zeros((0, 3)), np.zeros((0, 2, 3)), np.full((labels, 3), np.nan)
            if frame in person and seen.hulls is not None:
                i = person[frame]
                surface, edges, named = surface_centres(seen.hulls, i), _edges(graphs[i]), _named(limbs, i)
            elif refused[frame] and everything is not None:
                surface = surface_centres(everything, frame)
            # The stages' world may be larger than the recording's.
            back = prepared.to_z_up / prepared.scale
            status = Status(int(seen.status[frame]))
            yield FrameStages(found.silhouettes[frame], status, surface @ back, edges @ back, named @ back)


def surface_centres(hulls: VisualHulls, frame: int) -> Float[np.ndarray, "voxels 3"]:
    """Centres of the hull's voxels with an exposed side (m), which are all that is visible."""
    inside = hulls.inside[frame]
    voxels = hulls.voxels[inside]
    if len(voxels) == 0:
        return np.zeros((0, 3))
    return hulls.centres[inside][~_buried(voxels - voxels.min(0) + 1)]


def _buried(voxels: Int[np.ndarray, "voxels 3"]) -> Bool[np.ndarray, " voxels"]:
    """Whether all six neighbours of a voxel are occupied; indices count from 1."""
    occupied = np.zeros(voxels.max(0) + 2, bool)
    occupied[tuple(voxels.T)] = True
    return np.all([occupied[tuple((voxels + step).T)] for step in _NEIGHBOURS], axis=0)


def _edges(graph: SkeletalGraph) -> Float[np.ndarray, "edges 2 3"]:
    return np.stack([graph.positions[1:], graph.positions[graph.parents[1:]]], axis=1)


def _named(limbs: Limbs, frame: int) -> Float[np.ndarray, "labels 3"]:
    ends = np.where(limbs.found[frame, :, None], limbs.ends[frame], np.nan)
    return np.concatenate([ends, limbs.inner[frame]])
