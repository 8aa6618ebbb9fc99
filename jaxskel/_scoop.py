"""Voxel scooping (Rodriguez et al. 2009; Sect. 3.1): hulls to skeletal graphs, all frames of a batch at once.

From the root a wave of voxel clusters runs through the body. In each round a cluster scoops up the unvisited voxels
that touch it; what is connected among them becomes a new cluster with a node on the centre-line, and the cluster
grows to all connected voxels within its own radius of that node. A wave that falls apart makes a branch.

Frames are disjoint, so the batch is one big voxel graph with one seed a frame: the result of a frame does not depend
on what else is in the batch.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ._graph import SkeletalGraph
from ._hull import VisualHulls

# The 26 neighbours of a voxel; of each pair of opposite ones exactly one is in the second half.
_OFFSETS = np.array([o for o in np.ndindex(3, 3, 3) if o != (1, 1, 1)]) - 1
_HALF = slice(13, 26)


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
    """
    n = len(hulls.voxels)
    wave = _Wave(_neighbours(hulls), hulls.inside)
    centres = hulls.centres
    frames = np.arange(len(hulls), dtype=np.int32)
    seeds = frames * np.int32(n + 1) + roots.astype(np.int32)
    wave.open[seeds] = False
    nodes = _Nodes(positions=[centres[roots]], parents=[np.full(len(hulls), -1)], frames=[frames])
    nodes.extents.append(np.full(len(hulls), np.sqrt(3) * hulls.grid.spacing))

    first = len(hulls)  # number of the next node
    reached, owners = wave.step(seeds, frames)
    while len(reached):
        wave.open[reached] = False
        labels, parents = _order(wave.components(reached, owners), owners)
        xyz = _rows(centres, reached % wave.stride)
        made = _place(nodes, labels, parents, xyz, hulls.grid.spacing)
        radius = np.zeros(len(parents))
        np.maximum.at(radius, labels, _distance(xyz, _rows(made, labels)))

        # Grow: what lies too far from the node is left for the next round, with the cluster that saw it.
        voxels, owners = reached, labels
        later: list[tuple[np.ndarray, np.ndarray]] = []
        while len(voxels):
            voxels, owners = wave.step(voxels, owners)
            far = _distance(_rows(centres, voxels % wave.stride), _rows(made, owners)) >= radius.take(owners)
            later.append((voxels[far], owners[far]))
            voxels, owners = voxels[~far], owners[~far]
            wave.open[voxels] = False
        voxels, owners = (np.concatenate(arrays) for arrays in zip(*later, strict=True))
        still = np.flatnonzero(wave.open[voxels])
        still = still[np.argsort(owners[still], kind="stable")]
        reached, owners = wave.first_come(voxels[still], owners[still] + np.int32(first))
        first += len(parents)
    return nodes.graphs(len(hulls))


class _Wave:
    """The voxels of all frames as one graph, and which of them are not visited yet.

    Flat index = frame * (n + 1) + voxel; entry n of each frame stands for "no neighbour" and is never open.
    """

    def __init__(self, neighbours: Int[np.ndarray, "voxels 26"], inside: Bool[np.ndarray, "frames voxels"]):
        self.stride = np.int32(len(neighbours) + 1)
        self.neighbours = neighbours
        # A table of its own: taking rows of a slice would first copy the whole slice, in every round.
        self.half = np.ascontiguousarray(neighbours[:, _HALF])
        self.open = np.pad(inside, ((0, 0), (0, 1))).reshape(-1)
        self.number = np.zeros(len(self.open), np.int32)

    def _around(self, voxels: np.ndarray, table: np.ndarray) -> np.ndarray:
        local = voxels % self.stride
        around = table.take(local, 0, mode="clip")
        around += (voxels - local)[:, None]
        return around.reshape(-1)

    def step(self, voxels: np.ndarray, owners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Open neighbours of some voxels, each with the first owner that reaches it; `owners` must not decrease."""
        around = self._around(voxels, self.neighbours)
        hit = np.flatnonzero(self.open.take(around, mode="clip"))
        return self.first_come(around.take(hit), owners.take(hit // 26))

    def first_come(self, voxels: np.ndarray, owners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Keep the first mention of every voxel, in order of owner."""
        index = np.arange(len(voxels), dtype=np.int32)
        self.number[voxels[::-1]] = index[::-1]  # the last write, which is the first mention, stays
        first = np.flatnonzero(self.number.take(voxels) == index)
        return voxels.take(first), owners.take(first)

    def components(self, voxels: np.ndarray, owners: np.ndarray) -> np.ndarray:
        """Label what is connected among the newly reached voxels of each owner."""
        count = len(voxels)
        self.number[voxels] = np.arange(count, dtype=np.int32)
        around = self._around(voxels, self.half)
        other = self.number.take(around, mode="clip")
        other[other >= count] = 0  # stale numbers are told by pointing to another voxel
        hit = np.flatnonzero(voxels.take(other) == around)
        source, other = hit // 13, other.take(hit)
        same = owners.take(source) == owners.take(other)
        source, other = source[same], other[same]
        start = np.zeros(count + 1, np.int32)
        np.cumsum(np.bincount(source, minlength=count), out=start[1:])
        pairs = csr_array((np.ones(len(other)), other, start), shape=(count, count))
        return connected_components(pairs, directed=False)[1]


class _Nodes:
    """Nodes as they are made, round by round."""

    def __init__(self, positions: list, parents: list, frames: list):
        self.positions, self.parents, self.frames = positions, parents, frames
        self.extents: list[np.ndarray] = []

    def graphs(self, count: int) -> list[SkeletalGraph]:
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


def _neighbours(hulls: VisualHulls) -> Int[np.ndarray, "voxels 26"]:
    """Index of each of the 26 neighbours of every stored voxel; ``len(voxels)`` where there is none."""
    n = len(hulls.voxels)
    if n == 0:
        return np.zeros((0, 26), np.int32)
    low = hulls.voxels.min(0) - 1
    shape = hulls.voxels.max(0) - low + 2
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    flat = (hulls.voxels - low) @ strides
    number = np.full(int(np.prod(shape)), n, np.int32)
    number[flat] = np.arange(n, dtype=np.int32)
    return number[flat[:, None] + (_OFFSETS @ strides)]


def _rows(table: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Rows of a table; an index in brackets takes longer."""
    return table.take(index, 0, mode="clip")


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    difference = a - b
    return np.sqrt(np.einsum("ij,ij->i", difference, difference))


def _order(labels, owners):
    """Renumber components by owner, decreasing size, then first voxel; return labels and the owner of each."""
    count = labels.max() + 1
    size = np.bincount(labels, minlength=count)
    first = np.full(count, len(labels))
    np.minimum.at(first, labels, np.arange(len(labels)))
    owner = owners[first]
    order = np.lexsort((first, -size, owner))
    rank = np.empty(count, np.int32)
    rank[order] = np.arange(count, dtype=np.int32)
    return rank[labels], owner[order]


def _place(nodes: _Nodes, labels, parents, xyz, spacing) -> Float[np.ndarray, "made 3"]:
    """Add one node for each new cluster and return their positions."""
    count = len(parents)
    size = np.bincount(labels, minlength=count)
    order = np.argsort(labels, kind="stable")
    starts = np.cumsum(size) - size
    sorted_xyz = xyz[order]
    centroid = np.add.reduceat(sorted_xyz, starts) / size[:, None]
    low, high = np.minimum.reduceat(sorted_xyz, starts), np.maximum.reduceat(sorted_xyz, starts)
    extent = _distance(high + spacing, low)

    parent_position = np.concatenate(nodes.positions)[parents]
    parent_extent = np.concatenate(nodes.extents)[parents]
    s = np.minimum(extent, parent_extent) / np.maximum(extent, parent_extent)
    position = parent_position + (0.5**s)[:, None] * (centroid - parent_position)
    nodes.positions.append(position)
    nodes.parents.append(parents)
    nodes.frames.append(np.concatenate(nodes.frames)[parents])
    nodes.extents.append(extent)
    return position
