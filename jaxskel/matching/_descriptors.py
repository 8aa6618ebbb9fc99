"""Geodesic descriptors of graphs and template (Eq. 1 and 5): ragged graphs (NumPy) become padded arrays (JAX)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Float, Int

from ..body import Skeleton, SkeletonTemplate
from ..graph import MAX_ENDS, SkeletalGraph, forest_of


@register_dataclass
@dataclass(frozen=True, eq=False)
class EndNodes:
    """End nodes of a batch of graphs, padded to `MAX_ENDS`, the root first, then by geodesic distance to it.

    Attributes:
        nodes: Index of the node in its graph; -1 in the padding.
        count: Number of end nodes N.
        distances: D (Eq. 1): geodesic distance between every two end nodes (m); 0 in the padding.
        positions: Positions in the graphs' world (m); 0 in the padding.
    """

    nodes: Int[np.ndarray, "frames ends"]
    count: Int[np.ndarray, " frames"]
    distances: Float[np.ndarray, "frames ends ends"]
    positions: Float[np.ndarray, "frames ends 3"]


def describe_ends(graphs: Sequence[SkeletalGraph]) -> EndNodes:
    """Collect the end nodes of some graphs and their pairwise geodesic distances (Eq. 1).

    Raises:
        ValueError: A graph has more than `MAX_ENDS` end nodes; limit them when pruning.
    """
    forest = forest_of(graphs)
    ends = forest.end_nodes
    if ends.shape[1] > MAX_ENDS:
        raise ValueError(f"a graph has {ends.shape[1]} end nodes, more than {MAX_ENDS}: prune longer branches")
    nodes = np.full((len(graphs), MAX_ENDS), -1, np.int32)
    nodes[:, : ends.shape[1]] = ends
    there, at = nodes >= 0, np.maximum(nodes, 0)
    distances = np.take_along_axis(forest.geodesics(at), at[..., None], 1)
    distances = np.where(there[:, :, None] & there[:, None], distances, 0.0)
    positions = np.where(there[..., None], np.take_along_axis(forest.positions, at[..., None], 1), 0.0)
    count = there.sum(1).astype(np.int32)
    return EndNodes(nodes, count, distances.astype(np.float32), positions.astype(np.float32))


def template_geodesics(skeleton: Skeleton) -> Float[np.ndarray, "points tips"]:
    """Geodesic distance along the bones from every joint, then every tip, to each of the tips (m).

    The last rows are D' (Eq. 1 for the template G'); the rows of pelvis and neck are F_G' (Eq. 5).
    """
    positions = np.concatenate([np.asarray(skeleton.rest_joints), np.asarray(skeleton.rest_tips)])
    return _along_bones(skeleton.template, positions.astype(float).tobytes())


@lru_cache(maxsize=16)
def _along_bones(template: SkeletonTemplate, positions: bytes) -> Float[np.ndarray, "points tips"]:
    """Every frame of a stream asks for the distances of the same template."""
    joints, points = len(template.joint_names), len(template.point_names)
    parents = template.point_parents.astype(int)
    tree = SkeletalGraph(np.frombuffer(positions).reshape(points, 3), parents, np.zeros(points))
    found = tree.geodesics(np.arange(joints, points)).astype(np.float32)
    found.flags.writeable = False
    return found


def template_ends(skeleton: Skeleton) -> Float[np.ndarray, "tips tips"]:
    """D' (Eq. 1) of the template: geodesic distances of its tips, head, hands and feet of a human (m)."""
    return template_geodesics(skeleton)[len(skeleton.template.joint_names) :]
