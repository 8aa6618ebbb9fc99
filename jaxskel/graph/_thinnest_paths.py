"""Curve skeletons from shortest paths through the middle of the hull, after TEASAR (Sato et al. 2000)."""

import equinox as eqx
import numpy as np
import scipy  # imports its parts when they are first used
from jaxtyping import Bool, Float, Int

from ..hull import VisualHulls
from ._skeletal_graph import SkeletalGraph

# Number of last nodes of a path, whose depths measure how thick the limb is at its end.
_END = 8
# Voxels up to this much nearer to the root than the farthest one count as outermost (voxels).
_OUTERMOST = 2.0
# Half of the 26 neighbours of a voxel; the others are their opposites.
_STEPS = np.array([s for s in np.ndindex(3, 3, 3) if s > (1, 1, 1)]) - 1


class ThinnestPaths(eqx.Module):
    """Extracts the curve skeleton of a hull along paths that stay in its middle (TEASAR).

    A path costs more the nearer it is to the surface. The path from the root to the farthest voxel is drawn first, and
    the voxels around it count as explained. The path to the farthest unexplained voxel follows, until none is left.
    All paths belong to one shortest-path tree, so they join where limbs do. Every voxel of a path is a node. As in
    voxel scooping, end nodes lie at the centroid of the outermost voxels of a limb.

    Attributes:
        surface_cost: A step along the surface costs this many times more than one in the middle of the thickest part.
            With 20 to 200, the synthetic shapes of `tests/graph/test_skeletonisers.py` keep their end nodes and
            lengths.
        power: Exponent with which that cost falls off with the depth below the surface.
        scale: A path explains the voxels within this many times its distance from the surface.
        margin: Plus this many voxels: lower bumps are no branches.
    """

    surface_cost: float = 50.0
    power: float = 4.0
    scale: float = 1.5
    margin: float = 4.0

    def skeletonise(self, hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
        """One graph per frame, in the hulls' world (m), not pruned.

        Raises:
            ValueError: A hull is empty.
        """
        graphs = []
        for f, root in enumerate(roots):
            inside = hulls.occupied(f)
            if len(inside) == 0:
                raise ValueError(f"hull {f} of {len(hulls)} has no voxel: leave frames without a person out")
            graphs.append(self._one(hulls, hulls.voxels[inside], int(np.searchsorted(inside, root))))
        return graphs

    def _one(self, hulls: VisualHulls, voxels: Int[np.ndarray, "voxels 3"], root: int) -> SkeletalGraph:
        lengths = _adjacency(voxels)
        way = scipy.sparse.csgraph.dijkstra(lengths, indices=root)
        reached = np.isfinite(way)
        root = int(reached[:root].sum())
        voxels, way, lengths = voxels[reached], way[reached], lengths[reached][:, reached]
        depth = _depths(voxels)
        cost = 1 + self.surface_cost * (1 - depth / depth.max()) ** self.power
        pairs = lengths.tocoo()
        cheapest = scipy.sparse.csr_array(
            (pairs.data * (cost[pairs.row] + cost[pairs.col]) / 2, (pairs.row, pairs.col)), pairs.shape
        )  # fmt: skip
        before = scipy.sparse.csgraph.dijkstra(cheapest, indices=root, return_predecessors=True)[1]
        nodes, parents, places = self._paths(voxels, way, depth, before, root)
        spacing = hulls.grid.spacing
        positions = np.asarray(hulls.grid.origin) + spacing * (places + 0.5)
        # A node represents at least one voxel, so its radius is at least half a voxel's diagonal.
        return SkeletalGraph(positions, parents, spacing * np.maximum(depth[nodes], np.sqrt(3) / 2))

    def _paths(
        self,
        voxels: Int[np.ndarray, "voxels 3"],
        way: Float[np.ndarray, " voxels"],
        depth: Float[np.ndarray, " voxels"],
        before: Int[np.ndarray, " voxels"],
        root: int,
    ) -> tuple[Int[np.ndarray, " nodes"], Int[np.ndarray, " nodes"], Float[np.ndarray, "nodes 3"]]:
        """The voxels that are nodes (parents before children), the parent of each, and its position (voxels)."""
        tree = scipy.spatial.KDTree(voxels)
        number = np.full(len(voxels), -1)
        number[root] = 0
        nodes, parents, places = [root], [-1], [voxels[root].astype(float)]
        left = self._unexplained(tree, voxels, depth, [root], np.ones(len(voxels), bool))
        while left.any():
            path = [int(np.argmax(np.where(left, way, -1.0)))]
            left[path[0]] = False
            while number[before_last := path[-1]] < 0:
                path.append(int(before[before_last]))
            for above, below in zip(path[:0:-1], path[-2::-1], strict=True):
                parents.append(int(number[above]))
                number[below] = len(nodes)
                nodes.append(below)
                places.append(voxels[below].astype(float))
            # End at the centroid of the outermost voxels, because which of them is farthest is arbitrary.
            near = np.array(tree.query_ball_point(voxels[path[0]], 2 * depth[path[:_END]].max() + _OUTERMOST))
            outermost = voxels[near[way[near] > way[path[0]] - _OUTERMOST]]
            # Rounded to 1/1024 voxel, so that the same hull elsewhere in the grid gives the same bits.
            places[-1] = np.round(1024 * outermost.mean(0)) / 1024
            left = self._unexplained(tree, voxels, depth, path, left)
        return np.array(nodes), np.array(parents), np.array(places)

    def _unexplained(
        self,
        tree: "scipy.spatial.KDTree",
        voxels: Int[np.ndarray, "voxels 3"],
        depth: Float[np.ndarray, " voxels"],
        path: list[int],
        left: Bool[np.ndarray, " voxels"],
    ) -> Bool[np.ndarray, " voxels"]:
        """Mask of the voxels that are still unexplained once a path is drawn."""
        around = tree.query_ball_point(voxels[path], self.scale * depth[path] + self.margin)
        still = left.copy()
        still[np.concatenate([np.asarray(some, int) for some in around])] = False
        return still


def _adjacency(voxels: Int[np.ndarray, "voxels 3"]) -> "scipy.sparse.csr_array":
    """Distances (voxels) between each voxel and its up to 26 neighbours."""
    low = voxels.min(0) - 1
    index = np.full(np.ptp(voxels, axis=0) + 3, -1)
    index[tuple((voxels - low).T)] = np.arange(len(voxels))
    rows, columns, lengths = [], [], []
    for step in _STEPS:
        other = index[tuple((voxels - low + step).T)]
        there = np.flatnonzero(other >= 0)
        rows += [there, other[there]]
        columns += [other[there], there]
        lengths.append(np.full(2 * len(there), np.linalg.norm(step)))
    # SciPy's shortest paths took no other kind of index before its version 1.15.
    places = np.concatenate(rows).astype(np.int32), np.concatenate(columns).astype(np.int32)
    entries = np.concatenate(lengths), places
    return scipy.sparse.csr_array(scipy.sparse.coo_array(entries, (len(voxels), len(voxels))))


def _depths(voxels: Int[np.ndarray, "voxels 3"]) -> Float[np.ndarray, " voxels"]:
    """Distance of each voxel's centre from the nearest voxel outside (voxels)."""
    low = voxels.min(0) - 1
    occupied = np.zeros(np.ptp(voxels, axis=0) + 3, bool)
    occupied[tuple((voxels - low).T)] = True
    return np.asarray(scipy.ndimage.distance_transform_edt(occupied))[tuple((voxels - low).T)]
