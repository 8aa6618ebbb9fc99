"""End nodes lie at the ends of limbs, wherever the last cluster of the wave happens to end."""

import numpy as np
from jaxtyping import Float, Int

from ._cells import Cells


def moved_outwards(
    positions: Float[np.ndarray, "nodes 3"],
    parents: Int[np.ndarray, " nodes"],
    cells: Cells,
    some: Int[np.ndarray, " n"],
    nodes: Int[np.ndarray, " n"],
) -> Float[np.ndarray, "nodes 3"]:
    """Move end nodes to the centroid of the outermost voxels, two deep seen from the parent, of all siblings.

    Args:
        positions: Node positions in the world (m).
        parents: Parent of each node; -1 for roots.
        cells: All cells.
        some: Indices of the cells that belong to nodes.
        nodes: The node of each of these.
    """
    last = parents >= 0
    last[parents[last]] = False
    ends = last.nonzero()[0]
    starts, limb_of_end = np.unique(parents.take(ends), return_inverse=True)
    limb = np.zeros(len(parents), np.int64)
    limb[ends] = limb_of_end
    mine = last.take(nodes).nonzero()[0]
    some = some.take(mine)
    counts, middles = cells.counts(some), cells.middles(some)
    limbs = limb.take(nodes.take(mine))
    out = middles - positions.take(starts, 0).take(limbs, 0)
    away = np.sqrt(np.einsum("ni,ni->n", out, out))
    farthest = np.zeros(len(starts))
    np.maximum.at(farthest, limbs, away)
    weights = counts * (away > farthest.take(limbs) - 2 * cells.spacing)
    sums = np.stack([np.bincount(limbs, weights * along, len(starts)) for along in middles.T], 1)
    moved = positions.copy()
    moved[ends] = (sums / np.bincount(limbs, weights, len(starts))[:, None]).take(limb_of_end, 0)
    return moved
