"""Hulls in parts of limited memory."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Int

from ..hull import VisualHulls
from ._skeletal_graph import SkeletalGraph

# Voxels in the boxes around hulls (a byte each) that are processed at once, which bounds the memory.
_MOST_IN_BOXES = 200_000_000


def in_parts(
    extract: Callable[[VisualHulls, Int[np.ndarray, " some"]], list[SkeletalGraph]],
    hulls: VisualHulls,
    roots: Int[np.ndarray, " frames"],
    most: int,
) -> list[SkeletalGraph]:
    """The graphs of some hulls, a part of them at once.

    Args:
        extract: Function from hulls and roots to graphs.
        hulls: Occupied voxels of some frames.
        roots: For each frame, the index into ``hulls.voxels`` of the root.
        most: Occupied voxels of all hulls that are processed at once.

    Raises:
        ValueError: A hull is empty.
    """
    empty = np.flatnonzero(~hulls.inside.any(1))
    if len(empty):
        raise ValueError(f"hull {empty[0]} of {len(hulls)} has no voxel: leave frames without a person out")
    if len(hulls) == 0:
        return []
    box = int(np.prod([np.ptp(axis) + 4 for axis in np.ascontiguousarray(hulls.voxels.T)]))
    at_once = max(1, min(_MOST_IN_BOXES // box, most // int(hulls.inside.sum(1).max())))
    graphs: list[SkeletalGraph] = []
    for start in range(0, len(hulls), at_once):
        part = slice(start, start + at_once)
        graphs += extract(hulls[part], roots[part])
    return graphs
