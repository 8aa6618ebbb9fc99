"""Skeletal graphs from shells of equal geodesic distance (Verroust and Lazarus 1999), all frames of a batch at once.

As in voxel scooping, a wave runs from the root through the body and branches where it splits. Here it goes on by one
cell (2 x 2 x 2 voxels, `_cells.py`) everywhere in each step, whatever its clusters are, so those of all shells are
found at once. Each connected component of a shell makes a node.

Frames are independent: the result of a frame does not depend on the rest of the batch.
"""

import numpy as np
from jaxtyping import Float, Int

from .._math.components import first_mentions, ranks
from ..hull import VisualHulls
from ._cells import Cells, cells_of
from ._end_nodes import moved_outwards
from ._parts import in_parts
from ._skeletal_graph import SkeletalGraph
from ._wavefront import Wave, stable_order

# Voxels of all hulls that are processed at once: some 16 people of 15 mm voxels. Their arrays fit into the cache, which
# takes 58 ms for 32 people instead of 70; with eight, calls take as much again.
_MOST = 400_000


def shells(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
    """Extract the skeletal graph of each hull.

    The parent of a shell's component is the one in the shell before that most of its cells were reached from. Its node
    lies half-way between the middles of the two: middles of single shells jump from side to side, which makes paths 3 %
    longer (34 recordings of crowd). End nodes move to the centroid of the outermost voxels of all siblings, because how
    far the last shell goes, and into how many components it splits, is arbitrary. Nodes are numbered by frame,
    distance, then first cell, so the same voxels always give the same graph.

    Arguments, result (m, in the hulls' world) and errors are those of [`scoop`][jaxskel.graph.scoop].
    """
    return in_parts(_shells, hulls, roots, _MOST)


def _shells(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
    cells, seeds = cells_of(hulls, roots)
    wave = Wave(cells)
    level = np.full(len(cells.codes), -1, np.int16)
    origin = np.empty(len(cells.codes), np.int32)
    front, before, reached = seeds, seeds, 0
    while len(front):
        wave.mark_visited(front)
        level[front], origin[front] = reached, before
        front, before = wave.seen(front, front)
        reached += 1
    some = (level >= 0).nonzero()[0]
    level = level.take(some)
    box = len(cells.codes) // len(hulls)
    nodes, frames = _numbered(wave.components(some, level), level, some // box)
    at = origin  # from here on, where a cell stands in `some`
    origin = origin.take(some)
    at[some] = np.arange(len(some))
    order, parents = _parents(nodes, nodes.take(at.take(origin)))
    positions, extents = _measured(cells, some.take(order), np.bincount(nodes))
    first = np.searchsorted(frames, np.arange(len(hulls) + 1))
    positions[first[:-1]] = np.asarray(hulls.grid.origin) + hulls.grid.spacing * (hulls.voxels[roots] + 0.5)
    positions = (positions + positions.take(np.maximum(parents, first.take(frames)), 0)) / 2
    positions = moved_outwards(positions, parents, cells, some, nodes)
    return [
        SkeletalGraph(positions[a:b], np.maximum(parents[a:b] - a, -1), extents[a:b] / 2)
        for a, b in zip(first[:-1].tolist(), first[1:].tolist(), strict=True)
    ]


def _numbered(
    labels: Int[np.ndarray, " n"], level: Int[np.ndarray, " n"], frame: Int[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " nodes"]]:
    """Renumber nodes by frame, level, then first cell; also the frame of each node."""
    first = first_mentions(labels, int(labels.max()) + 1)
    frames = frame.take(first)
    order = np.lexsort((first, level.take(first), frames))
    return ranks(order).take(labels), frames.take(order)


def _parents(
    nodes: Int[np.ndarray, " n"], before: Int[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " nodes"]]:
    """Indices that sort cells by node, and for each node the other one that most of its cells come from, or -1."""
    order = stable_order(before)
    order = order.take(stable_order(nodes.take(order)))
    nodes, before = nodes.take(order), before.take(order)
    ends = np.append(((nodes[1:] != nodes[:-1]) | (before[1:] != before[:-1])).nonzero()[0], len(nodes) - 1)
    votes, child, parent = np.diff(ends, prepend=-1), nodes.take(ends), before.take(ends)
    best = np.lexsort((-votes, child))
    parents = parent.take(best).take(np.searchsorted(child, np.arange(child[-1] + 1)))
    return order, np.where(parents == np.arange(len(parents)), -1, parents)


def _measured(
    cells: Cells, members: Int[np.ndarray, " n"], sizes: Int[np.ndarray, " nodes"]
) -> tuple[Float[np.ndarray, "nodes 3"], Float[np.ndarray, " nodes"]]:
    """Middle of each node's voxels, and the diagonal of the box around them (m); cells come node by node."""
    starts = sizes.cumsum() - sizes
    counts, middles = cells.counts(members), cells.middles(members)
    bounds = np.maximum.reduceat(cells.bounds(members, middles), starts)
    middles *= counts[:, None]
    positions = np.add.reduceat(middles, starts) / np.add.reduceat(counts, starts)[:, None]
    return positions, np.linalg.norm(bounds[:, :3] + bounds[:, 3:], axis=1)
