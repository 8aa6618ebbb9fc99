"""Trees of a batch, padded side by side: one pass over the node indices measures all of them.

Every function here is a recursion from parents to children or back. Node by node, it takes as many calls for all trees
as for the largest one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int


@runtime_checkable
class Tree(Protocol):
    """Nodes ordered such that each parent precedes its children; node 0 is the root."""

    @property
    def positions(self) -> Float[np.ndarray, "nodes 3"]:
        """Node positions in the world (m)."""
        ...

    @property
    def parents(self) -> Int[np.ndarray, " nodes"]:
        """Parent of each node; negative for the root."""
        ...


@dataclass(frozen=True, eq=False)
class Forest:
    """Trees padded to the same number of nodes.

    Attributes:
        positions: Node positions in the world (m); zero in the padding.
        parents: Parent of each node; 0 for the root and in the padding.
        count: Number of nodes.
    """

    positions: Float[np.ndarray, "trees nodes 3"]
    parents: Int[np.ndarray, "trees nodes"]
    count: Int[np.ndarray, " trees"]

    @property
    def real(self) -> Bool[np.ndarray, "trees nodes"]:
        """Mask of the nodes that are not padding."""
        return np.arange(self.parents.shape[1]) < self.count[:, None]

    @cached_property
    def edge_lengths(self) -> Float[np.ndarray, "trees nodes"]:
        """Distance of each node from its parent (m); 0 for the root."""
        starts = np.take_along_axis(self.positions, self.parents[..., None], 1)
        return np.where(self.real, np.linalg.norm(self.positions - starts, axis=-1), 0.0)

    @cached_property
    def depths(self) -> Float[np.ndarray, "trees nodes"]:
        """Geodesic distance of each node from the root (m)."""
        rows, depth = np.arange(len(self.parents)), self.edge_lengths.copy()
        for node in range(1, depth.shape[1]):
            depth[:, node] += depth[rows, self.parents[:, node]]
        return depth

    @property
    def leaves(self) -> Bool[np.ndarray, "trees nodes"]:
        """Mask of the nodes without children, except the root."""
        leaf = self.real
        trees, children = np.nonzero(leaf)
        leaf[trees, self.parents[trees, children]] = False  # also the root, which is its own parent here
        return leaf

    @property
    def end_nodes(self) -> Int[np.ndarray, "trees ends"]:
        """The root, then the leaves in ascending geodesic distance from it (the paper's omega_1 ... omega_N).

        Padded with -1 to the largest number of end nodes in the batch.
        """
        leaves = self.leaves
        key = np.where(leaves, self.depths, np.inf)
        key[:, 0] = -1.0
        count = 1 + leaves.sum(1)
        # A stable sort keeps the order of the nodes where two leaves are equally far.
        nodes = np.argsort(key, 1, kind="stable")[:, : count.max(initial=0)]
        return np.where(np.arange(nodes.shape[1]) < count[:, None], nodes, -1)

    def geodesics(self, sources: Int[np.ndarray, "trees sources"]) -> Float[np.ndarray, "trees nodes sources"]:
        """Length of the path between every node and some source nodes (m): gd(v, omega) of Eq. 1 and Eq. 5.

        In a tree, Dijkstra's algorithm reduces to one pass up and one pass down.
        """
        rows, lengths = np.arange(len(self.parents)), self.edge_lengths
        nodes = lengths.shape[1]
        below = np.arange(nodes)[:, None] == sources[:, None]  # does the subtree of a node hold the source?
        for node in range(nodes - 1, 0, -1):
            below[rows, self.parents[:, node]] |= below[:, node]
        step = np.where(below, -lengths[..., None], lengths[..., None])
        distance = np.empty(below.shape)
        distance[:, 0] = np.take_along_axis(self.depths, sources, 1)
        for node in range(1, nodes):
            distance[:, node] = distance[rows, self.parents[:, node]] + step[:, node]
        return np.abs(distance)  # rounding leaves -1e-17 at the source itself

    def unpruned(self, min_length: float) -> Bool[np.ndarray, "trees nodes"]:
        """Mask of the nodes that remain when short branches are removed.

        At every branching node the deepest branch stays. Another branch is removed with its whole subtree if it reaches
        less than `min_length` (m) beyond the branching node.
        """
        lengths = self.edge_lengths
        # Transposed, because all trees advance together node by node.
        up = (self.parents * len(lengths) + np.arange(len(lengths))[:, None]).T.copy()
        edges = lengths.T.copy()
        below = np.zeros_like(edges)  # how far the subtree below a node reaches
        flat = below.reshape(-1)
        for node in range(len(up) - 1, 0, -1):
            parent = up[node]
            flat[parent] = np.maximum(flat.take(parent), below[node] + edges[node])
        reach = below.T
        through = reach + lengths
        # The deepest child continues the branch, the first one in case of a tie; the root is nobody's child.
        trees, farthest = np.nonzero(self.real & (through == np.take_along_axis(reach, self.parents, 1)))
        trees, farthest = trees[farthest > 0], farthest[farthest > 0]
        deepest = np.zeros_like(self.parents)
        deepest[trees[::-1], self.parents[trees, farthest][::-1]] = farthest[::-1]  # the last write wins
        goes_on = np.take_along_axis(deepest, self.parents, 1) == np.arange(lengths.shape[1])
        kept = goes_on | (through >= min_length)
        kept[:, 0] = True
        # A node stays only if all its ancestors stay: each round looks twice as far up as the one before.
        above = self.parents
        while above.any():
            kept &= np.take_along_axis(kept, above, 1)
            above = np.take_along_axis(above, above, 1)
        return kept & self.real


def forest_of(trees: Sequence[Tree]) -> Forest:
    """Pad some trees into a `Forest`."""
    count = np.array([len(tree.parents) for tree in trees], np.int64)
    positions = np.zeros((len(trees), int(count.max(initial=1)), 3))
    parents = np.zeros(positions.shape[:2], np.int64)
    for f, tree in enumerate(trees):
        positions[f, : count[f]] = tree.positions
        parents[f, : count[f]] = np.maximum(tree.parents, 0)
    return Forest(positions, parents, count)
