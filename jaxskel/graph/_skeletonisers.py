"""How the curve skeleton of a hull is drawn.

A skeletoniser is an object with ``skeletonise(hulls, roots)``; `GraphSettings` takes it.
"""

from typing import Protocol, runtime_checkable

import equinox as eqx
import numpy as np
from jaxtyping import Int

from ..hull import VisualHulls
from ._scoop import scoop
from ._skeletal_graph import SkeletalGraph


@runtime_checkable
class Skeletoniser(Protocol):
    """Draws the curve skeleton of each hull as a tree."""

    def skeletonise(self, hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
        """One graph a frame, in the hulls' world (m), not pruned.

        Args:
            hulls: Occupied voxels of some frames, none of them empty.
            roots: For each frame, the index into ``hulls.voxels`` of the root (the head).
        """
        ...


class VoxelScooping(eqx.Module):
    """The paper's way (Sect. 3.1), see [`scoop`][jaxskel.graph.scoop]."""

    def skeletonise(self, hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> list[SkeletalGraph]:
        """One graph a frame, in the hulls' world (m), not pruned."""
        return scoop(hulls, roots)
