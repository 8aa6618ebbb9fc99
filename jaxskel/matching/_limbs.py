"""Labelled limbs of a batch of graphs: inner nodes (Eq. 5, 6) and paths from the head to every end node."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Float, Int

from ..body import HUMAN_15, Skeleton
from ..graph import Forest, SkeletalGraph, forest_of
from ._descriptors import EndNodes, template_geodesics
from ._matchers import Matches

PATH_POINTS = 32
# Every second point of a path, and its last one.
_CORNERS = np.append(np.arange(0, PATH_POINTS, 2), PATH_POINTS - 1)
HEAD, L_HAND, R_HAND, L_FOOT, R_FOOT = range(5)

END_NODE_REACH = 0.7
"""Position of an end node between the last joint (0) and the tip (1). End nodes are the mean of their cluster's
outermost voxels, about one voxel short of the surface, and the silhouettes of a tip end short of it, too."""

PAPER_DESCRIPTOR = (HEAD, L_HAND, R_HAND, L_FOOT, R_FOOT)
"""The end nodes that describe neck and pelvis in Eq. 5."""
HANDLESS_DESCRIPTOR = HUMAN_15.described_by
"""Eq. 5 without the hands: an arm that touches the trunk shortens its geodesics and drags the pelvis along."""


@register_dataclass
@dataclass(frozen=True, eq=False)
class Limbs:
    """Labelled skeletal graphs (Fig. 2b; m, in the graphs' world): end nodes, inner nodes, and paths to the end nodes.

    Labels are the tips of the template: head, left and right hand, left and right foot of a human.

    Attributes:
        paths: Points from the root to each end node, evenly spaced along the graph (m).
        lengths: Length of each path (m).
        found: Whether an end node was found for this label.
        inner: Nodes of the template's inner joints: pelvis and neck of a human.
    """

    paths: Float[np.ndarray, "frames labels points 3"]
    lengths: Float[np.ndarray, "frames labels"]
    found: Bool[np.ndarray, "frames labels"]
    inner: Float[np.ndarray, "frames inner 3"]

    @property
    def pelvis(self) -> Float[np.ndarray, "frames 3"]:
        """The node of the pelvis, if the template is a human's."""
        return self.inner[:, 0]

    @property
    def neck(self) -> Float[np.ndarray, "frames 3"]:
        """The node of the neck, if the template is a human's."""
        return self.inner[:, 1]

    @property
    def ends(self) -> Float[np.ndarray, "frames labels 3"]:
        """The labelled end nodes (m)."""
        return self.paths[:, :, -1]

    @property
    def chords(self) -> Float[np.ndarray, "frames labels"]:
        """Length of each path in 16 chords (m), because nodes lie now to one side of a limb, now to the other."""
        steps = np.diff(self.paths[:, :, _CORNERS], axis=2)
        return np.linalg.norm(steps, axis=-1).sum(-1)

    @classmethod
    def none(cls, frames: int) -> "Limbs":
        """Placeholder for frames in which no limbs were searched: none is found."""
        labels, inner = len(HUMAN_15.tip_names), len(HUMAN_15.inner)
        paths = np.zeros((frames, labels, PATH_POINTS, 3))
        return cls(paths, paths[:, :, 0, 0], np.zeros((frames, labels), bool), np.zeros((frames, inner, 3)))

    def at(
        self, labels: Int[np.ndarray, " some"], distances: Float[np.ndarray, "*frames some"]
    ) -> Float[np.ndarray, "frames some 3"]:
        """Points of each frame's paths to some labels, at distances (m) from their end nodes along the graph."""
        length = self.lengths[:, labels]
        step = (PATH_POINTS - 1) * np.clip(1 - distances / np.maximum(length, 1e-9), 0, 1)
        low = np.minimum(step.astype(int), PATH_POINTS - 2)
        part, frames = (step - low)[..., None], np.arange(len(length))[:, None]
        return (1 - part) * self.paths[frames, labels, low] + part * self.paths[frames, labels, low + 1]

    def exchanged(self, hands: Bool[np.ndarray, " frames"], feet: Bool[np.ndarray, " frames"]) -> "Limbs":
        """Exchange left and right of a human in the marked frames."""
        order = np.tile(np.arange(5), (len(hands), 1))
        order[hands, 1:3] = (2, 1)
        order[feet, 3:5] = (4, 3)
        return self.reordered(order)

    def reordered(self, order: Int[np.ndarray, "frames labels"]) -> "Limbs":
        """The same graphs with other labels: of each label, the one whose path it gets."""
        rows = np.arange(len(order))[:, None]
        return Limbs(self.paths[rows, order], self.lengths[rows, order], self.found[rows, order], self.inner)


def label_limbs(
    graphs: Sequence[SkeletalGraph],
    ends: EndNodes,
    matches: Matches,
    skeleton: Skeleton,
    descriptor: tuple[int, ...] = HANDLESS_DESCRIPTOR,
) -> Limbs:
    """Find the inner joints in each graph and trace its labelled limbs (m, in the graphs' world).

    Neck and pelvis of a human are the nodes whose geodesic distances to the labelled end nodes are closest to the
    template's (Eq. 5 and 6), over those labels of `descriptor` that were found.
    """
    forest = forest_of(graphs)
    found = matches.ends >= 0
    nodes = np.where(found, np.take_along_axis(ends.nodes, np.maximum(matches.ends, 0), 1), 0)
    # F_G(v) of every node v (Eq. 5); labels that were not found are masked out.
    here = forest.geodesics(nodes)
    used = found & np.isin(np.arange(found.shape[1]), descriptor)
    template = template_geodesics(skeleton)
    inner = np.zeros((len(graphs), len(skeleton.template.inner), 3))
    for place, joint in enumerate(skeleton.template.inner):
        off = np.where(used[:, None], (here - template[joint]) ** 2, 0.0).sum(-1)
        nearest = np.argmin(np.where(forest.real, off, np.inf), 1)
        inner[:, place] = forest.positions[np.arange(len(graphs)), nearest]
    paths, lengths = paths_from_root(forest, nodes)
    paths[~found], lengths[~found] = 0.0, 0.0
    return Limbs(paths, lengths, found, inner)


def paths_from_root(
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
