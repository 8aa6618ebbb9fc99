"""Skeletonisers: how the curve skeleton of a hull is extracted.

A skeletoniser is an object with ``skeletonise(hulls, roots)``; `GraphSettings` takes it.
"""

from typing import Protocol, runtime_checkable

import equinox as eqx
import numpy as np
from jaxtyping import Int

from ..hull import VisualHulls
from ._scoop import scoop
from ._shells import shells
from ._skeletal_graph import SkeletalGraph


@runtime_checkable
class Skeletoniser(Protocol):
    """Extracts the curve skeleton of each hull as a tree."""

    def skeletonise(self, hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
        """One graph per frame, in the hulls' world (m), not pruned.

        Args:
            hulls: Occupied voxels of some frames, none of them empty.
            roots: For each frame, the index into ``hulls.voxels`` of the root (the head).
        """
        ...


class GeodesicShells(eqx.Module):
    """Nodes in the middle of shells of equal geodesic distance from the root, see [`shells`][jaxskel.graph.shells]."""

    def skeletonise(self, hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
        """One graph per frame, in the hulls' world (m), not pruned."""
        return shells(hulls, roots)


class VoxelScooping(eqx.Module):
    """Voxel scooping, the paper's skeletoniser (Sect. 3.1), see [`scoop`][jaxskel.graph.scoop]."""

    def skeletonise(self, hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
        """One graph per frame, in the hulls' world (m), not pruned."""
        return scoop(hulls, roots)
