"""Trees of a batch, padded side by side and measured together.

Every function here is a recursion from parents to children or back. Each round looks twice as far up as the one before,
so a tree of a hundred levels takes seven rounds.
"""

from collections.abc import Iterator, Sequence
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
    def _parents_among_all(self) -> Int[np.ndarray, " all"]:
        """Parent of each node among those of all trees; a root is its own."""
        trees, nodes = self.parents.shape
        return (self.parents + nodes * np.arange(trees)[:, None]).reshape(-1)

    @cached_property
    def depths(self) -> Float[np.ndarray, "trees nodes"]:
        """Geodesic distance of each node from the root (m)."""
        depth = self.edge_lengths.reshape(-1).copy()
        for above in _farther_up(self._parents_among_all):
            depth += depth.take(above)
        return depth.reshape(self.parents.shape)

    def _with_ancestors(self, nodes: Int[np.ndarray, " some"]) -> Int[np.ndarray, "levels some"]:
        """Some nodes, counted among those of all trees, and all their ancestors; the root may come several times."""
        found = nodes[None]
        for above in _farther_up(self._parents_among_all):
            found = np.concatenate([found, above.take(found)])
        return found

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

        A path goes up to the last common ancestor of the two, and down again.
        """
        (trees, nodes), count = self.parents.shape, sources.shape[1]
        tree = np.arange(trees)[:, None]
        # A copy of the tree for each source, in which the source's ancestors are roots.
        copy = nodes * (count * tree + np.arange(count))
        on_path = self._with_ancestors((sources + nodes * tree).reshape(-1)) + (copy - nodes * tree).reshape(-1)
        common = (self.parents[:, None] + copy[..., None]).reshape(-1)
        common[on_path] = on_path
        *_, common = _farther_up(common)
        own = self.depths[:, None]
        common = common.reshape(trees, count, nodes) - copy[..., None]
        shared = np.take_along_axis(own, common, 2)
        return np.abs(own + np.take_along_axis(own, sources[..., None], 2) - 2 * shared).swapaxes(1, 2)

    def unpruned(self, min_length: float) -> Bool[np.ndarray, "trees nodes"]:
        """Mask of the nodes that remain when short branches are removed.

        At every branching node the deepest branch stays. Another branch is removed with its whole subtree if it reaches
        less than `min_length` (m) beyond the branching node.
        """
        depths, parents = self.depths.reshape(-1), self._parents_among_all
        # How far the farthest leaf below each node is from the root: nearer leaves write first, the last write wins.
        leaves = self.leaves.reshape(-1).nonzero()[0]
        leaves = leaves.take(depths.take(leaves).argsort(kind="stable"))
        farthest = depths.copy()
        farthest[np.ascontiguousarray(self._with_ancestors(leaves).T)] = depths.take(leaves)[:, None]
        # The deepest child continues the branch, the first one in case of a tie; the root is nobody's child.
        children = (self.real.reshape(-1) & (parents != np.arange(len(parents)))).nonzero()[0]
        children = children.compress(farthest.take(children) == farthest.take(parents.take(children)))
        deepest = np.full(len(parents), -1)
        deepest[parents.take(children[::-1])] = children[::-1]
        goes_on = (deepest.take(parents) == np.arange(len(parents))).reshape(self.parents.shape)
        through = (farthest - depths.take(parents)).reshape(self.parents.shape)
        kept = goes_on | (through >= min_length)
        kept[:, 0] = True
        flat = kept.reshape(-1)
        for above in _farther_up(parents):  # a node stays only if all its ancestors stay
            flat &= flat.take(above)
        return kept & self.real


def _farther_up(above: Int[np.ndarray, " nodes"]) -> Iterator[Int[np.ndarray, " nodes"]]:
    """The ancestor of each node 1, 2, 4, ... levels up, until it is the root's."""
    while True:
        yield above
        farther = above.take(above)
        if (farther == above).all():
            return
        above = farther


def forest_of(trees: Sequence[Tree]) -> Forest:
    """Pad some trees into a `Forest`."""
    count = np.array([len(tree.parents) for tree in trees], np.int64)
    positions = np.zeros((len(trees), int(count.max(initial=1)), 3))
    parents = np.zeros(positions.shape[:2], np.int64)
    for f, tree in enumerate(trees):
        positions[f, : count[f]] = tree.positions
        parents[f, : count[f]] = np.maximum(tree.parents, 0)
    return Forest(positions, parents, count)
