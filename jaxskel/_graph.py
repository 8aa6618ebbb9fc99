"""The skeletal graph: a tree of centre-line nodes rooted at the head, its geodesics, its end nodes, its pruning."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int


class SkeletalGraph(eqx.Module):
    """A tree of nodes along the centre-lines of a body (the paper's G). A parent stands before its children."""

    positions: Float[np.ndarray, "nodes 3"]
    """Nodes in the world (m). Node 0 is the root."""
    parents: Int[np.ndarray, " nodes"]
    """Parent of each node; -1 for the root."""
    radii: Float[np.ndarray, " nodes"]
    """Half the diagonal of the box around the voxels that each node stands for (m)."""

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def edge_lengths(self) -> Float[np.ndarray, " nodes"]:
        """Distance of each node from its parent (m); 0 for the root."""
        return _edge_lengths(self.positions, self.parents)

    @property
    def depths(self) -> Float[np.ndarray, " nodes"]:
        """Geodesic distance of each node from the root (m)."""
        depth = self.edge_lengths.copy()
        for node in range(1, len(self)):
            depth[node] += depth[self.parents[node]]
        return depth

    @property
    def end_nodes(self) -> Int[np.ndarray, " ends"]:
        """The root, then the leaves in ascending geodesic distance from it (the paper's omega_1 ... omega_N)."""
        leaf = np.ones(len(self), bool)
        leaf[self.parents[1:]] = False
        leaf[0] = False
        leaves = np.flatnonzero(leaf)
        # A stable sort keeps the order of the nodes where two leaves are equally far.
        return np.concatenate([[0], leaves[np.argsort(self.depths[leaves], kind="stable")]])

    def path_to_root(self, node: int | np.integer) -> Int[np.ndarray, " path"]:
        """Nodes from `node` up to the root, both included."""
        path = [int(node)]
        while path[-1] != 0:
            path.append(int(self.parents[path[-1]]))
        return np.array(path)

    def geodesics(self, sources: Int[np.ndarray, " sources"]) -> Float[np.ndarray, "nodes sources"]:
        """Length of the path between every node and some source nodes (m): gd(v, omega) of Eq. 1 and Eq. 5.

        In a tree, Dijkstra's algorithm reduces to one pass up and one pass down.
        """
        lengths = self.edge_lengths
        below = np.zeros((len(self), len(sources)), bool)  # does the subtree of a node hold the source?
        below[sources, np.arange(len(sources))] = True
        for node in range(len(self) - 1, 0, -1):
            below[self.parents[node]] |= below[node]
        distance = np.empty((len(self), len(sources)))
        distance[0] = self.depths[sources]
        for node in range(1, len(self)):
            distance[node] = distance[self.parents[node]] + np.where(below[node], -lengths[node], lengths[node])
        return np.abs(distance)  # rounding leaves -1e-17 where a source meets itself

    def keep(self, kept: Bool[np.ndarray, " nodes"]) -> "SkeletalGraph":
        """The subtree of the marked nodes; the parent of a marked node must be marked too."""
        number = np.cumsum(kept) - 1
        parents = np.where(self.parents[kept] >= 0, number[self.parents[kept]], -1)
        return SkeletalGraph(self.positions[kept], parents, self.radii[kept])


def _edge_lengths(positions: np.ndarray, parents: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(positions - positions[np.maximum(parents, 0)], axis=-1)
    lengths[0] = 0.0
    return lengths


def prune(graph: SkeletalGraph, min_length: float = 0.1) -> SkeletalGraph:
    """Remove very short branches (Sect. 3.1).

    At every branching node the deepest branch goes on; another branch is removed with all that hangs on it where it
    reaches less than `min_length` (m) beyond the branching node.
    """
    lengths, parents = graph.edge_lengths, graph.parents
    reach = np.zeros(len(graph))  # how far the subtree below a node reaches
    for node in range(len(graph) - 1, 0, -1):
        parent = parents[node]
        reach[parent] = max(reach[parent], reach[node] + lengths[node])
    through = reach + lengths
    deepest = np.full(len(graph), -1)
    for node in range(1, len(graph)):
        rival = deepest[parents[node]]
        if rival < 0 or through[node] > through[rival]:
            deepest[parents[node]] = node
    kept = np.ones(len(graph), bool)
    for node in range(1, len(graph)):
        goes_on = deepest[parents[node]] == node or through[node] >= min_length
        kept[node] = kept[parents[node]] and goes_on
    return graph.keep(kept)


def limit_ends(graph: SkeletalGraph, most: int) -> SkeletalGraph:
    """Prune ever longer branches until at most `most` end nodes (two or more) are left, the root among them."""
    length = 0.05
    while len(graph.end_nodes) > most:
        length *= 1.2
        graph = prune(graph, length)
    return graph
