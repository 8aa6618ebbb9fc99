"""Labelled limbs of a batch of graphs: inner nodes (Eq. 5, 6) and paths from the head to every end node."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from ..body import JOINT_NAMES, Skeleton
from ..graph import Forest, SkeletalGraph, forest_of
from ._descriptors import EndNodes, template_geodesics
from ._matchers import Matches

PATH_POINTS = 32
HEAD, L_HAND, R_HAND, L_FOOT, R_FOOT = range(5)

END_NODE_REACH = 0.7
"""Position of an end node between the last joint (0) and the tip (1). End nodes are the mean of their cluster's
outermost voxels, about one voxel short of the surface, and the silhouettes of a tip end short of it, too."""

PAPER_DESCRIPTOR = (HEAD, L_HAND, R_HAND, L_FOOT, R_FOOT)
"""The end nodes that describe neck and pelvis in Eq. 5."""
HANDLESS_DESCRIPTOR = (HEAD, L_FOOT, R_FOOT)
"""Eq. 5 without the hands: an arm that touches the trunk shortens its geodesics and drags the pelvis along."""


class Limbs(eqx.Module):
    """Labelled skeletal graphs (Fig. 2b; m, in the graphs' world): five end nodes, two inner nodes, five paths.

    Attributes:
        paths: Points from the root to the head, left and right hand, left and right foot, evenly spaced along the graph
            (m).
        lengths: Length of each path (m).
        found: Whether an end node was found for this label.
    """

    paths: Float[np.ndarray, "frames labels points 3"]
    lengths: Float[np.ndarray, "frames labels"]
    found: Bool[np.ndarray, "frames labels"]
    neck: Float[np.ndarray, "frames 3"]
    pelvis: Float[np.ndarray, "frames 3"]

    @property
    def ends(self) -> Float[np.ndarray, "frames labels 3"]:
        """The labelled end nodes (m)."""
        return self.paths[:, :, -1]

    @classmethod
    def none(cls, frames: int) -> "Limbs":
        """Placeholder for frames in which no limbs were searched: none is found."""
        paths = np.zeros((frames, 5, PATH_POINTS, 3))
        return cls(paths, paths[:, :, 0, 0], np.zeros((frames, 5), bool), paths[:, 0, 0], paths[:, 0, 0])

    def at(self, label: int, distance: float | np.floating) -> Float[np.ndarray, "frames 3"]:
        """The point of each frame's path to a label, at a distance (m) from its end node along the graph."""
        length = self.lengths[:, label]
        step = (PATH_POINTS - 1) * np.clip(1 - distance / np.maximum(length, 1e-9), 0, 1)
        low = np.minimum(step.astype(int), PATH_POINTS - 2)
        part = (step - low)[:, None]
        frames = np.arange(len(length))
        return (1 - part) * self.paths[frames, label, low] + part * self.paths[frames, label, low + 1]

    def exchanged(self, hands: Bool[np.ndarray, " frames"], feet: Bool[np.ndarray, " frames"]) -> "Limbs":
        """Exchange left and right in the marked frames."""
        order = np.tile(np.arange(5), (len(hands), 1))
        order[hands, 1:3] = (2, 1)
        order[feet, 3:5] = (4, 3)
        rows = np.arange(len(hands))[:, None]
        return Limbs(
            self.paths[rows, order],
            self.lengths[rows, order],
            self.found[rows, order],
            self.neck,
            self.pelvis,
        )


def label_limbs(
    graphs: Sequence[SkeletalGraph],
    ends: EndNodes,
    matches: Matches,
    skeleton: Skeleton,
    descriptor: tuple[int, ...] = HANDLESS_DESCRIPTOR,
) -> Limbs:
    """Find neck and pelvis in each graph and trace its labelled limbs (m, in the graphs' world).

    Neck and pelvis are the nodes whose geodesic distances to the labelled end nodes are closest to the template's
    (Eq. 5 and 6), over those labels of `descriptor` that were found.
    """
    forest = forest_of(graphs)
    found = matches.ends >= 0
    nodes = np.where(found, np.take_along_axis(ends.nodes, np.maximum(matches.ends, 0), 1), 0)
    # F_G(v) of every node v (Eq. 5); labels that were not found are masked out.
    here = forest.geodesics(nodes)
    used = found & np.isin(np.arange(5), descriptor)
    template = template_geodesics(skeleton)
    inner = []
    for name in ("neck", "pelvis"):
        off = np.where(used[:, None], (here - template[JOINT_NAMES.index(name)]) ** 2, 0.0).sum(-1)
        nearest = np.argmin(np.where(forest.real, off, np.inf), 1)
        inner.append(forest.positions[np.arange(len(graphs)), nearest])
    paths, lengths = _paths(forest, nodes)
    paths[~found], lengths[~found] = 0.0, 0.0
    return Limbs(paths, lengths, found, *inner)


def _paths(
    forest: Forest, ends: Int[np.ndarray, "frames labels"]
) -> tuple[Float[np.ndarray, "frames labels points 3"], Float[np.ndarray, "frames labels"]]:
    """Points on the paths from the root to some nodes, evenly spaced along the graph, and the path lengths (m)."""
    rows = np.arange(len(ends))[:, None]
    way = [ends]
    while way[-1].any():
        way.append(forest.parents[rows, way[-1]])
    nodes = np.stack([np.zeros_like(ends), *way[::-1]], -1)  # from the root, which pads short paths
    depth, position = forest.depths[rows[..., None], nodes], forest.positions[rows[..., None], nodes]
    lengths = depth[..., -1]
    where = np.linspace(0, lengths, PATH_POINTS, axis=-1)
    before = (depth[..., None, :-1] <= where[..., None]).sum(-1) - 1
    start, stop = (np.take_along_axis(depth, before + k, -1) for k in (0, 1))
    low, high = (np.take_along_axis(position, (before + k)[..., None], 2) for k in (0, 1))
    share = (where - start) / np.where(stop > start, stop - start, 1.0)
    return low + share[..., None] * (high - low), lengths
