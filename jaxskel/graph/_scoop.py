"""Voxel scooping (Rodriguez et al. 2009; Sect. 3.1): hulls to skeletal graphs, all frames of a batch at once.

A wave of clusters runs from the root through the body. In each round a cluster scoops up the unvisited cells that touch
it. Each connected component of these becomes a new cluster with a node on the centre-line, and grows to all connected
cells within its own radius of that node. A wave that splits makes a branch.

Clusters are made of cells of 2 x 2 x 2 voxels, which are connected as their voxels are (`_cells.py`): there are six
times fewer of them, and the wave takes half as many steps. A thin limb gets a node every other voxel.

Frames are independent: the result of a frame does not depend on the rest of the batch.
"""

import numpy as np
from jaxtyping import Float, Int

from .._math.components import first_mentions
from ..hull import VisualHulls
from ._cells import Cells, cells_of
from ._skeletal_graph import SkeletalGraph
from ._wavefront import Wave, stable_order

# Voxels processed at once, which bounds the memory: in the boxes around hulls (a byte each), and in hulls (more bytes).
_MOST_IN_BOXES = 200_000_000
_MOST_IN_HULLS = 4_000_000


def scoop(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
    """Extract the skeletal graph of each hull.

    Node positions follow Rodriguez et al.: ``N = P + 0.5^s (centroid - P)`` with the parent node P and the ratio s of
    the smaller to the larger extent of the two clusters, which keeps nodes on the centre-line. In addition, end nodes
    move to the centroid of the outermost voxels of all sibling clusters, because the size of the last cluster, and into
    how many it splits, is arbitrary. If two clusters reach the same cell, the one of the earlier node gets it. New
    nodes are numbered by frame, parent node, decreasing number of cells, then first cell, so the same voxels always
    give the same graph.

    Args:
        hulls: Occupied voxels of some frames.
        roots: For each frame, the index into ``hulls.voxels`` of the root (the head).

    Returns:
        One graph per frame, in the hulls' world (m). Voxels that are not connected to the root are ignored.

    Raises:
        ValueError: A hull is empty.
    """
    empty = np.flatnonzero(~hulls.inside.any(1))
    if len(empty):
        raise ValueError(f"hull {empty[0]} of {len(hulls)} has no voxel: leave frames without a person out")
    if len(hulls) == 0:
        return []
    box = int(np.prod([np.ptp(axis) + 4 for axis in np.ascontiguousarray(hulls.voxels.T)]))
    at_once = max(1, min(_MOST_IN_BOXES // box, _MOST_IN_HULLS // int(hulls.inside.sum(1).max())))
    graphs: list[SkeletalGraph] = []
    for start in range(0, len(hulls), at_once):
        part = slice(start, start + at_once)
        graphs += _scoop(VisualHulls(hulls.voxels, hulls.inside[part], hulls.grid), roots[part])
    return graphs


def _scoop(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
    cells, seeds = cells_of(hulls, roots)
    wave = Wave(cells)
    frames = np.arange(len(hulls))
    start = np.asarray(hulls.grid.origin) + hulls.grid.spacing * (hulls.voxels[roots] + 0.5)
    nodes = _Nodes(frames, start, hulls.grid.spacing)
    wave.mark_visited(seeds)
    reached, owners = wave.seen(seeds, frames)
    wave.mark_visited(reached)
    while len(reached):
        labels, parents = _ranked(wave.components(reached, owners), owners)
        made, radius = nodes.place(cells, reached.take(stable_order(labels)), np.bincount(labels), parents)

        # Grow: cells too far from the node are left for the next round, with the cluster that reached them.
        front, owners = reached, labels
        later: list[tuple[np.ndarray, np.ndarray]] = []
        nodes.hold(front, owners)
        while len(front):
            front, owners = wave.seen(front, owners)
            far = _lengths(cells.middles(front) - made.take(owners, 0)) >= radius.take(owners)
            near, beyond = (~far).nonzero()[0], far.nonzero()[0]
            later.append((front.take(beyond), owners.take(beyond)))
            front, owners = front.take(near), owners.take(near)
            wave.mark_visited(front)
            nodes.hold(front, owners)
        reached, owners = wave.mark_visited_first(*(np.concatenate(arrays) for arrays in zip(*later, strict=True)))
    nodes.move_ends(cells)
    return nodes.graphs(len(hulls))


def _lengths(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """The same as `numpy.linalg.norm` along the last axis, in a third of the time."""
    return np.sqrt(np.einsum("ni,ni->n", vectors, vectors))


def _ranked(
    labels: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " clusters"]]:
    """Renumber clusters by owner, decreasing size, then first cell; return labels and the owner of each cluster."""
    size = np.bincount(labels)
    first = first_mentions(labels, len(size))
    owner = owners[first]
    order = np.lexsort((first, -size, owner))
    rank = np.empty(len(size), np.int64)
    rank[order] = np.arange(len(size))
    return rank.take(labels), owner[order]


class _Nodes:
    """The nodes made so far, round by round."""

    def __init__(self, frames: Int[np.ndarray, " frames"], roots: Float[np.ndarray, "frames 3"], spacing: float):
        self.frames = [frames]
        self.positions = [roots]
        self.parents = [np.full(len(frames), -1)]
        self.extents = [np.full(len(frames), np.sqrt(3) * spacing)]
        self._first = 0  # index of the first node of the last round
        self._held = [(frames[:0], frames[:0])]

    def place(
        self,
        cells: Cells,
        members: Int[np.ndarray, " n"],
        sizes: Int[np.ndarray, " clusters"],
        parents: Int[np.ndarray, " clusters"],
    ) -> tuple[Float[np.ndarray, "clusters 3"], Float[np.ndarray, " clusters"]]:
        """Add one node for each cluster of cells.

        Args:
            cells: All cells.
            members: Indices of the clusters' cells, cluster by cluster.
            sizes: Number of cells of each cluster.
            parents: Parent node of each cluster, counted from the first node of the last round.

        Returns:
            Positions of the nodes in the world, and the distance of each to the farthest of its cells (m).
        """
        starts = sizes.cumsum() - sizes
        counts, (low, high, middles) = cells.measured(members)
        centroid = np.add.reduceat(middles * counts[:, None], starts) / np.add.reduceat(counts, starts)[:, None]
        extent = _lengths(np.maximum.reduceat(high, starts) - np.minimum.reduceat(low, starts))
        start, before = self.positions[-1][parents], self.extents[-1][parents]
        s = np.minimum(extent, before) / np.maximum(extent, before)
        position = start + (0.5**s)[:, None] * (centroid - start)
        radius = np.maximum.reduceat(_lengths(middles - position.repeat(sizes, 0)), starts)
        count = len(self.frames[-1])
        self.frames.append(self.frames[-1][parents])
        self.parents.append(parents + self._first)
        self.positions.append(position)
        self.extents.append(extent)
        self._first += count
        return position, radius

    def hold(self, some: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]) -> None:
        """Store cells of the last round's clusters, and the cluster of each."""
        self._held.append((some, owners + self._first))

    def move_ends(self, cells: Cells) -> None:
        """Move end nodes to the centroid of the outermost voxels, two deep seen from the parent, of all siblings."""
        positions, parents = np.concatenate(self.positions), np.concatenate(self.parents)
        last = parents >= 0
        last[parents[last]] = False
        ends = last.nonzero()[0]
        starts, limb_of_end = np.unique(parents.take(ends), return_inverse=True)
        limb = np.zeros(len(parents), np.int64)
        limb[ends] = limb_of_end
        held, owners = (np.concatenate(arrays) for arrays in zip(*self._held, strict=True))
        mine = last.take(owners).nonzero()[0]
        counts, (_, _, middles) = cells.measured(held.take(mine))
        limbs = limb.take(owners.take(mine))
        away = _lengths(middles - positions.take(starts, 0).take(limbs, 0))
        farthest = np.zeros(len(starts))
        np.maximum.at(farthest, limbs, away)
        weights = counts * (away > farthest.take(limbs) - 2 * cells.spacing)
        sums = np.stack([np.bincount(limbs, weights * along, len(starts)) for along in middles.T], 1)
        positions[ends] = (sums / np.bincount(limbs, weights, len(starts))[:, None]).take(limb_of_end, 0)
        self.positions = [positions]

    def graphs(self, count: int) -> list[SkeletalGraph]:
        """One graph per frame."""
        positions, parents = np.concatenate(self.positions), np.concatenate(self.parents)
        frames, extents = np.concatenate(self.frames), np.concatenate(self.extents)
        order = np.argsort(frames, kind="stable")
        start = np.searchsorted(frames[order], np.arange(count + 1))
        local = np.empty(len(order), np.int64)
        local[order] = np.arange(len(order)) - start[frames[order]]
        graphs = []
        for f in range(count):
            mine = order[start[f] : start[f + 1]]
            up = parents[mine]
            graphs.append(SkeletalGraph(positions[mine], np.where(up >= 0, local[up], -1), extents[mine] / 2))
        return graphs
