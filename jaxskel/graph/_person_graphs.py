"""The skeletal graph of the person in each hull (Sect. 3.1)."""

import numpy as np
from jaxtyping import Int

from ..body import Skeleton
from ..hull import VisualHulls
from ._forest import forest_of
from ._root_finders import RootFinder
from ._skeletal_graph import MAX_ENDS, SkeletalGraph, limit_ends, prune_all
from ._skeletonisers import GeodesicShells, Skeletoniser

MIN_BRANCH = 0.2
"""Shortest branch that is kept (m); `GraphSettings.min_branch` says which measurement chose it."""


def skeletal_graphs(
    hulls: VisualHulls,
    roots: Int[np.ndarray, " frames"],
    min_branch: float = MIN_BRANCH,
    skeletoniser: Skeletoniser | None = None,
) -> list[SkeletalGraph]:
    """Pruned graph of each hull (Sect. 3.1): `roots` index ``hulls.voxels``, branches are at least `min_branch` (m)."""
    graphs = prune_all((skeletoniser or GeodesicShells()).skeletonise(hulls, roots), min_branch)
    many = 1 + forest_of(graphs).leaves.sum(1) > MAX_ENDS
    return [limit_ends(graph, MAX_ENDS) if m else graph for graph, m in zip(graphs, many, strict=True)]


def person_graphs(
    hulls: VisualHulls, skeleton: Skeleton, root_finder: RootFinder, min_branch: float, skeletoniser: Skeletoniser
) -> list[SkeletalGraph]:
    """Pruned graph (m, in the hulls' world) of the person in each hull, rooted at the voxel of the root finder."""
    return skeletal_graphs(hulls, root_finder.roots(hulls, skeleton), min_branch, skeletoniser)
