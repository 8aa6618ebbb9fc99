"""Parts of a hull that are other people: where somebody may stand before the person, nothing is carved."""

import numpy as np
from jaxtyping import Bool, UInt8

from ._projection_table import ProjectionTable
from ._visual_hulls import VisualHulls

# A hull that loses more than this share is left whole: most views of the person are hidden, so votes say little.
_MOST = 0.7


def without_others(
    hulls: VisualHulls,
    table: ProjectionTable,
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    hidden: UInt8[np.ndarray, "frames cams h w8"],
) -> VisualHulls:
    """Hulls without the voxels that more views show as somebody else than as the person.

    Args:
        hulls: Hulls carved by the silhouettes and the hidden pixels together.
        table: The table that they were carved with.
        silhouettes: Packed bits, 1 = the person.
        hidden: Packed bits, 1 = somebody else, who may stand before the person.
    """
    pixels = table.pixels_at(hulls.voxels)
    inside = hulls.inside.copy()
    for frame, occupied in enumerate(hulls.inside):
        voxels = np.flatnonzero(occupied)
        if len(voxels) == 0:
            continue
        seen = pixels[:, voxels]
        own, others = (_votes(seen, packed[frame], table.unseen) for packed in (silhouettes, hidden))
        foreign = others > own
        if foreign.mean() <= _MOST:
            inside[frame, voxels[foreign]] = False
    left = inside.any(0)
    return VisualHulls(hulls.voxels[left], inside[:, left], hulls.grid)


def _votes(pixels: np.ndarray, packed: UInt8[np.ndarray, "cams h w8"], unseen: int) -> np.ndarray:
    """Number of views whose bit at each voxel's pixel is set."""
    votes = np.zeros(pixels.shape[1], np.int64)
    for places, view in zip(pixels, packed.reshape(len(packed), -1), strict=True):
        there = np.minimum(places, unseen - 1)
        bits: Bool[np.ndarray, " n"] = (view[there >> 3] >> (7 - (there & 7)) & 1).astype(bool)
        votes += bits & (places < unseen)
    return votes
