"""Voxel scooping (Rodriguez et al. 2009; Sect. 3.1): hulls to skeletal graphs, all frames of a batch at once.

From the root a wave of voxel clusters runs through the body. In each round a cluster scoops up the unvisited voxels
that touch it; what is connected among them becomes a new cluster with a node on the centre-line, and the cluster
grows to all connected voxels within its own radius of that node. A wave that falls apart makes a branch.

Frames are disjoint: the result of a frame does not depend on what else is in the batch.
"""

import numpy as np
from jaxtyping import Float, Int

from ._cells import Cells
from ._graph import SkeletalGraph
from ._hull import VisualHulls
from ._wave import Wave, stable_order

# The boxes of so many voxels are worked on at once; each takes some bytes, though most of them only on paper.
_MOST_VOXELS = 200_000_000


def scoop(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
    """Extract the skeletal graph of each hull.

    Node positions follow the paper's source: ``N = P + 0.5^s (centroid - P)`` with the parent node P and the ratio s
    of the smaller to the larger cluster extent of the two, which keeps nodes on the centre-line. Where two clusters
    reach for the same voxel, the one of the earlier node gets it; new nodes are numbered by frame, parent node,
    decreasing number of voxels, then first voxel, so the same voxels always give the same graph.

    Args:
        hulls: Occupied voxels of some frames.
        roots: For each frame, the index into ``hulls.voxels`` of the root (the head).

    Returns:
        One graph a frame, in the hulls' world (m). Voxels that are not connected to the root have no part in it.

    Raises:
        ValueError: A hull is empty.
    """
    empty = np.flatnonzero(~hulls.inside.any(1))
    if len(empty):
        raise ValueError(f"hull {empty[0]} of {len(hulls)} has no voxel: leave frames without a person out")
    if len(hulls) == 0:
        return []
    box = int(np.prod([np.ptp(axis) + 4 for axis in np.ascontiguousarray(hulls.voxels.T)]))
    at_once = max(1, _MOST_VOXELS // box)
    graphs: list[SkeletalGraph] = []
    for start in range(0, len(hulls), at_once):
        part = slice(start, start + at_once)
        graphs += _scoop(VisualHulls(hulls.voxels, hulls.inside[part], hulls.grid), roots[part])
    return graphs


def _scoop(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
    wave = Wave(hulls)
    cells = Cells(len(hulls), wave.shape)
    frames = np.arange(len(hulls))
    places = hulls.voxels[roots]
    start = np.asarray(hulls.grid.origin) + hulls.grid.spacing * (places + 0.5)
    nodes = _Nodes(frames, start, hulls.grid.spacing)
    seeds = wave.number(frames, places)
    wave.close(seeds)
    reached, owners = wave.step(seeds, frames)
    while len(reached):
        labels, parents = _ranked(cells.components(*wave.cells(reached), owners), owners)
        by_cluster = wave.centres(reached.take(stable_order(labels)))
        made, radius = nodes.place(by_cluster, np.bincount(labels), parents)

        # Grow: what lies too far from the node is left for the next round, with the cluster that saw it.
        voxels, owners = reached, labels
        later: list[tuple[np.ndarray, np.ndarray]] = []
        while len(voxels):
            voxels, owners = wave.step(voxels, owners)
            far = _distances(wave.centres(voxels), made, owners) >= radius.take(owners)
            near, beyond = np.flatnonzero(~far), np.flatnonzero(far)
            later.append((voxels.take(beyond), owners.take(beyond)))
            wave.reopen(later[-1][0])
            voxels, owners = voxels.take(near), owners.take(near)
        reached, owners = wave.close_first(*(np.concatenate(arrays) for arrays in zip(*later, strict=True)))
    return nodes.graphs(len(hulls))


def _distances(
    xyz: Float[np.ndarray, "3 n"], nodes: Float[np.ndarray, "nodes 3"], labels: Int[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Distance of points from the nodes that they are labelled with (m)."""
    away = np.empty_like(xyz)
    for axis, middle in zip(away, nodes.T, strict=True):
        middle.take(labels, out=axis, mode="clip")
    return _lengths(np.subtract(xyz, away, out=away))


def _lengths(vectors: Float[np.ndarray, "3 n"]) -> Float[np.ndarray, " n"]:
    """Lengths of vectors that stand side by side."""
    return np.sqrt(np.add.reduce(vectors * vectors))


def _ranked(
    labels: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " clusters"]]:
    """Renumber clusters by owner, decreasing size, then first voxel; return labels and the owner of each cluster."""
    size = np.bincount(labels)
    first = np.empty(len(size), np.int64)
    first[labels[::-1]] = np.arange(len(labels))[::-1]  # the last write stays
    owner = owners[first]
    order = np.lexsort((first, -size, owner))
    rank = np.empty(len(size), np.int64)
    rank[order] = np.arange(len(size))
    return rank.take(labels), owner[order]


class _Nodes:
    """Nodes as they are made, round by round."""

    def __init__(self, frames: Int[np.ndarray, " frames"], roots: Float[np.ndarray, "frames 3"], spacing: float):
        self.frames = [frames]
        self.positions = [roots]
        self.parents = [np.full(len(frames), -1)]
        self.extents = [np.full(len(frames), np.sqrt(3) * spacing)]
        self._spacing = spacing
        self._first = 0  # number of the first node of the last round

    def place(
        self, xyz: Float[np.ndarray, "3 n"], sizes: Int[np.ndarray, " clusters"], parents: Int[np.ndarray, " clusters"]
    ) -> tuple[Float[np.ndarray, "clusters 3"], Float[np.ndarray, " clusters"]]:
        """Add one node for each cluster of voxels, which come cluster by cluster.

        Args:
            xyz: Centres of the voxels (m).
            sizes: Number of voxels of each cluster.
            parents: Node that each cluster comes from, counted from the first one of the last round.

        Returns:
            Their positions, and the distance of each from the farthest of its voxels (m).
        """
        starts = np.cumsum(sizes) - sizes
        centroid = np.add.reduceat(xyz, starts, 1) / sizes
        box = np.maximum.reduceat(xyz, starts, 1) + self._spacing - np.minimum.reduceat(xyz, starts, 1)
        extent = _lengths(box)
        start, before = self.positions[-1][parents].T, self.extents[-1][parents]
        s = np.minimum(extent, before) / np.maximum(extent, before)
        position = start + 0.5**s * (centroid - start)
        radius = np.maximum.reduceat(_lengths(xyz - position.repeat(sizes, 1)), starts)
        position = position.T
        count = len(self.frames[-1])
        self.frames.append(self.frames[-1][parents])
        self.parents.append(parents + self._first)
        self.positions.append(position)
        self.extents.append(extent)
        self._first += count
        return position, radius

    def graphs(self, count: int) -> list[SkeletalGraph]:
        """One graph for each frame."""
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
