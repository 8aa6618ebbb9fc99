"""Voxel scooping (Rodriguez et al. 2009; Sect. 3.1): hulls to skeletal graphs, all frames of a batch at once.

From the root a wave of voxel clusters runs through the body. In each round a cluster scoops up the unvisited voxels
that touch it; what is connected among them becomes a new cluster with a node on the centre-line, and the cluster
grows to all connected voxels within its own radius of that node. A wave that falls apart makes a branch.

Frames are disjoint, so the batch is one big voxel graph with one seed a frame: the result of a frame does not depend
on what else is in the batch.
"""

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
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
    neighbours = _neighbours(hulls)
    centres = hulls.centres
    # Flat index = frame * (n + 1) + voxel; entry n of a frame stands for "no neighbour" and is never open.
    open_ = np.zeros((len(hulls), n + 1), bool)
    open_[:, :n] = hulls.inside
    open_ = open_.reshape(-1)
    scratch = np.zeros(len(open_), np.int32)

    frames = np.arange(len(hulls))
    seeds = frames * (n + 1) + roots
    open_[seeds] = False
    nodes = _Nodes(positions=[centres[roots]], parents=[np.full(len(hulls), -1)], frames=[frames])
    nodes.extents.append(np.full(len(hulls), np.sqrt(3) * hulls.grid.spacing))

    voxels, owners = seeds, frames
    first = len(hulls)
    reached, reach_owner = _step(voxels, owners, neighbours, open_, n, scratch)
    while len(reached):
        open_[reached] = False
        labels = _components(reached, reach_owner, neighbours, n, scratch)
        labels, parents = _order(labels, reach_owner)
        xyz = centres[reached % (n + 1)]
        made = _place(nodes, labels, parents, xyz, hulls.grid.spacing)
        distance = np.linalg.norm(xyz - made[labels], axis=1)
        radius = np.zeros(len(parents))
        np.maximum.at(radius, labels, distance)

        # Grow: what lies too far from the node is left for the next round, with the cluster that saw it.
        voxels, owners = reached, labels
        later_voxels, later_owners = [], []
        while len(voxels):
            voxels, owners = _step(voxels, owners, neighbours, open_, n, scratch)
            far = np.linalg.norm(centres[voxels % (n + 1)] - made[owners], axis=1) >= radius[owners]
            later_voxels.append(voxels[far])
            later_owners.append(owners[far])
            voxels, owners = voxels[~far], owners[~far]
            open_[voxels] = False
        voxels, owners = np.concatenate(later_voxels), np.concatenate(later_owners)
        order = np.argsort(owners, kind="stable")
        voxels, owners = voxels[order], owners[order] + first
        first += len(parents)
        reached, reach_owner = _first_come(voxels[open_[voxels]], owners[open_[voxels]], scratch)
    return nodes.graphs(len(hulls))


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
            graphs.append(
                SkeletalGraph(positions[mine], np.where(up >= 0, local[up], -1), extents[mine] / 2)
            )
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


def _step(voxels, owners, neighbours, open_, n, scratch):
    """Open neighbours of some voxels, each with the first owner that reaches it; `owners` must not decrease."""
    local = voxels % (n + 1)
    around = neighbours[local] + (voxels - local)[:, None]
    hit = np.flatnonzero(open_[around])
    return _first_come(around.reshape(-1)[hit], owners[hit // 26], scratch)


def _first_come(voxels, owners, scratch):
    """Keep the first mention of every voxel, in order of owner."""
    index = np.arange(len(voxels), dtype=np.int32)
    scratch[voxels[::-1]] = index[::-1]  # the last write, which is the first mention, stays
    first = scratch[voxels] == index
    voxels, owners = voxels[first], owners[first]
    return voxels, owners


def _components(voxels, owners, neighbours, n, scratch):
    """Connected components of the newly reached voxels of each owner."""
    count = len(voxels)
    scratch[voxels] = np.arange(count)
    local = voxels % (n + 1)
    around = neighbours[local, _HALF] + (voxels - local)[:, None]
    other = scratch[around]  # stale entries are told by pointing to another voxel
    source = np.broadcast_to(np.arange(count)[:, None], around.shape)
    other = np.where(other < count, other, 0)
    joined = (voxels[other] == around) & (owners[other] == owners[:, None])
    pairs = coo_array((np.ones(joined.sum(), np.int8), (source[joined], other[joined])), shape=(count, count))
    return connected_components(pairs, directed=False)[1]


def _order(labels, owners):
    """Renumber components by owner, decreasing size, then first voxel; return labels and the owner of each."""
    count = labels.max() + 1
    size = np.bincount(labels, minlength=count)
    first = np.full(count, len(labels))
    np.minimum.at(first, labels, np.arange(len(labels)))
    owner = owners[first]
    order = np.lexsort((first, -size, owner))
    rank = np.empty(count, np.int64)
    rank[order] = np.arange(count)
    return rank[labels], owner[order]


def _place(nodes: _Nodes, labels, parents, xyz, spacing) -> Float[np.ndarray, "made 3"]:
    """Add one node for each new cluster and return their positions."""
    count = len(parents)
    size = np.bincount(labels, minlength=count)
    centroid = np.stack([np.bincount(labels, xyz[:, k], count) for k in range(3)], -1) / size[:, None]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, labels, xyz)
    np.maximum.at(high, labels, xyz)
    extent = np.linalg.norm(high - low + spacing, axis=1)

    parent_position = np.concatenate(nodes.positions)[parents]
    parent_extent = np.concatenate(nodes.extents)[parents]
    s = np.minimum(extent, parent_extent) / np.maximum(extent, parent_extent)
    position = parent_position + (0.5**s)[:, None] * (centroid - parent_position)
    nodes.positions.append(position)
    nodes.parents.append(parents)
    nodes.frames.append(np.concatenate(nodes.frames)[parents])
    nodes.extents.append(extent)
    return position
