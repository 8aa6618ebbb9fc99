"""The skeletal graph: a tree of centre-line nodes rooted at the head, with geodesics, end nodes and pruning."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ._forest import forest_of

MAX_ENDS = 16
"""Graphs with more end nodes are pruned further, because batches of end nodes are padded to this number."""


@dataclass(frozen=True, eq=False)
class SkeletalGraph:
    """A tree of nodes along the centre-lines of a body (the paper's G). Parents precede their children.

    Attributes:
        positions: Node positions in the world (m). Node 0 is the root.
        parents: Parent of each node; -1 for the root.
        radii: Half the diagonal of the box around the voxels that each node represents (m).
    """

    positions: Float[np.ndarray, "nodes 3"]
    parents: Int[np.ndarray, " nodes"]
    radii: Float[np.ndarray, " nodes"]

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def edge_lengths(self) -> Float[np.ndarray, " nodes"]:
        """Distance of each node from its parent (m); 0 for the root."""
        return forest_of([self]).edge_lengths[0]

    @property
    def depths(self) -> Float[np.ndarray, " nodes"]:
        """Geodesic distance of each node from the root (m)."""
        return forest_of([self]).depths[0]

    @property
    def end_nodes(self) -> Int[np.ndarray, " ends"]:
        """The root, then the leaves in ascending geodesic distance from it (the paper's omega_1 ... omega_N)."""
        return forest_of([self]).end_nodes[0]

    def geodesics(self, sources: Int[np.ndarray, " sources"]) -> Float[np.ndarray, "nodes sources"]:
        """Length of the path between every node and some source nodes (m): gd(v, omega) of Eq. 1 and Eq. 5."""
        return forest_of([self]).geodesics(sources[None])[0]

    def keep(self, kept: Bool[np.ndarray, " nodes"]) -> "SkeletalGraph":
        """The subtree of the marked nodes; the parent of a marked node must be marked too."""
        number = np.cumsum(kept) - 1
        parents = np.where(self.parents[kept] >= 0, number[self.parents[kept]], -1)
        return SkeletalGraph(self.positions[kept], parents, self.radii[kept])


def prune(graph: SkeletalGraph, min_length: float = 0.1) -> SkeletalGraph:
    """Remove very short branches (Sect. 3.1).

    At every branching node the deepest branch stays. Another branch is removed with its whole subtree if it reaches
    less than `min_length` (m) beyond the branching node.
    """
    return prune_all([graph], min_length)[0]


def prune_all(graphs: Sequence[SkeletalGraph], min_length: float = 0.1) -> list[SkeletalGraph]:
    """Apply [`prune`][] to some graphs."""
    kept = forest_of(graphs).unpruned(min_length)
    return [graph.keep(mine[: len(graph)]) for graph, mine in zip(graphs, kept, strict=True)]


def limit_ends(graph: SkeletalGraph, most: int) -> SkeletalGraph:
    """Prune ever longer branches until at most `most` end nodes (two or more) are left, including the root."""
    length = 0.05
    while len(graph.end_nodes) > most:
        length *= 1.2
        graph = prune(graph, length)
    return graph
