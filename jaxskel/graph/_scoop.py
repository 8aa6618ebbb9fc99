"""Voxel scooping (Rodriguez et al. 2009; Sect. 3.1): hulls to skeletal graphs, all frames of a batch at once.

A wave of clusters runs from the root through the body. In each round a cluster scoops up the unvisited cells that touch
it. Each connected component of these becomes a new cluster with a node on the centre-line, and grows to all connected
cells within its own radius of that node. A wave that splits makes a branch.

Clusters are made of cells of 2 x 2 x 2 voxels, which are connected as their voxels are (`_cells.py`): there are six
times fewer of them, and the wave takes half as many steps. A thin limb gets a node every other voxel.

Frames are independent: the result of a frame does not depend on the rest of the batch.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from .._math.components import first_mentions, ranks
from ..hull import VisualHulls
from ._cells import Cells, cells_of
from ._end_nodes import moved_outwards
from ._parts import in_parts
from ._skeletal_graph import SkeletalGraph
from ._wavefront import Wave, stable_order

# Voxels of all hulls that are processed at once, which bounds the memory.
_MOST = 4_000_000


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
    return in_parts(_scoop, hulls, roots, _MOST)


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
        clusters = _Clusters.of(reached, owners, wave.components(reached, owners))
        made, squared_radius = nodes.place(cells, clusters)

        # Grow: cells too far from the node are left for the next round, with the cluster that reached them.
        front, owners = clusters.members, clusters.labels
        fronts, whose, nearby = [], [], []
        nodes.hold(front, owners)
        while len(front):
            front, owners = wave.seen(front, owners)
            near = _squares(cells.middles(front) - made.take(owners, 0)) < squared_radius.take(owners)
            fronts.append(front)
            whose.append(owners)
            nearby.append(near)
            grown = near.nonzero()[0]
            front, owners = front.take(grown), owners.take(grown)
            wave.mark_visited(front)
        front, owners, near = np.concatenate(fronts), np.concatenate(whose), np.concatenate(nearby)
        grown, beyond = near.nonzero()[0], (~near).nonzero()[0]
        nodes.hold(front.take(grown), owners.take(grown))
        reached, owners = wave.mark_visited_first(front.take(beyond), owners.take(beyond))
    return nodes.graphs(cells, len(hulls))


class _Clusters(NamedTuple):
    """Clusters of cells, numbered by owner, decreasing size, then first cell.

    Attributes:
        members: Indices of their cells, cluster by cluster.
        labels: The cluster of each of these.
        starts: Position of each cluster's first cell.
        sizes: Number of cells of each cluster.
        owners: Owner of each cluster.
    """

    members: Int[np.ndarray, " n"]
    labels: Int[np.ndarray, " n"]
    starts: Int[np.ndarray, " clusters"]
    sizes: Int[np.ndarray, " clusters"]
    owners: Int[np.ndarray, " clusters"]

    @classmethod
    def of(
        cls, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"], labels: Int[np.ndarray, " n"]
    ) -> "_Clusters":
        """Clusters of cells that are ordered by owner, from labels that no two owners share."""
        sizes = np.bincount(labels)
        if np.count_nonzero(owners[1:] != owners[:-1]) + 1 < len(sizes):  # an owner has several
            first = first_mentions(labels, len(sizes))
            order = np.lexsort((first, -sizes, owners.take(first)))
            labels, sizes = ranks(order).take(labels), sizes.take(order)
            by_cluster = stable_order(labels)
            cells, owners, labels = (array.take(by_cluster) for array in (cells, owners, labels))
        starts = sizes.cumsum() - sizes
        return cls(cells, labels, starts, sizes, owners.take(starts))


def _squares(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Squared lengths, in a third of the time of `numpy.linalg.norm`."""
    return np.einsum("ni,ni->n", vectors, vectors)


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
        self, cells: Cells, clusters: _Clusters
    ) -> tuple[Float[np.ndarray, "clusters 3"], Float[np.ndarray, " clusters"]]:
        """Add one node for each cluster of cells, whose owner counts from the first node of the last round.

        Returns:
            Positions of the nodes in the world, and the squared distance of each to the farthest of its cells (m).
        """
        members, _, starts, sizes, parents = clusters
        counts, middles = cells.counts(members), cells.middles(members)
        centroid = np.add.reduceat(middles * counts[:, None], starts) / np.add.reduceat(counts, starts)[:, None]
        bounds = np.maximum.reduceat(cells.bounds(members, middles), starts)
        extent = np.sqrt(_squares(bounds[:, :3] + bounds[:, 3:]))
        start, before = self.positions[-1].take(parents, 0), self.extents[-1].take(parents)
        s = np.minimum(extent, before) / np.maximum(extent, before)
        position = start + (0.5**s)[:, None] * (centroid - start)
        squared_radius = np.maximum.reduceat(_squares(middles - position.repeat(sizes, 0)), starts)
        count = len(self.frames[-1])
        self.frames.append(self.frames[-1].take(parents))
        self.parents.append(parents + self._first)
        self.positions.append(position)
        self.extents.append(extent)
        self._first += count
        return position, squared_radius

    def hold(self, some: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]) -> None:
        """Store cells of the last round's clusters, and the cluster of each."""
        self._held.append((some, owners + self._first))

    def graphs(self, cells: Cells, count: int) -> list[SkeletalGraph]:
        """One graph per frame."""
        parents = np.concatenate(self.parents)
        held = (np.concatenate(arrays) for arrays in zip(*self._held, strict=True))
        positions = moved_outwards(np.concatenate(self.positions), parents, cells, *held)
        frames, extents = np.concatenate(self.frames), np.concatenate(self.extents)
        order = np.argsort(frames, kind="stable")
        start = np.searchsorted(frames[order], np.arange(count + 1))
        local = ranks(order) - start[frames]
        graphs = []
        for f in range(count):
            mine = order[start[f] : start[f + 1]]
            up = parents[mine]
            graphs.append(SkeletalGraph(positions[mine], np.where(up >= 0, local[up], -1), extents[mine] / 2))
        return graphs
