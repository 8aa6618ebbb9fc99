"""Matching end nodes with the template (Sect. 3.2.2): the paper's DTW and Hungarian algorithm, and an exact matcher.

A matcher is an object with ``match(ends, skeleton) -> Matches``; both matchers work on batches of frames.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Array, Float, Int

from .._runtime.batching import filled
from .._runtime.compile_cache import cached_jit
from ..body import Skeleton, SkeletonTemplate
from ..graph import MAX_ENDS
from ._descriptors import EndNodes, template_ends
from ._dtw import dtw
from ._soft_dtw import soft_dtw

# The root and five of fifteen other end nodes can be chosen in 360 360 ways.
_MOST_TIPS = 6


@register_dataclass
@dataclass(frozen=True, eq=False)
class Matches:
    """End nodes with the labels head, hand, hand, foot, foot, or other tips of a template.

    Left and right are not distinguished yet.

    Attributes:
        ends: Index into the end nodes of each graph; -1 if the graph has too few end nodes for this label.
        cost: Mean absolute difference between the geodesic distances of the matched end nodes and the template's (m).
    """

    ends: Int[np.ndarray, "frames labels"]
    cost: Float[np.ndarray, " frames"]


@runtime_checkable
class Matcher(Protocol):
    """Assigns limb labels to end nodes."""

    def match(self, ends: EndNodes, skeleton: Skeleton) -> Matches:
        """Label the end nodes of a batch of graphs."""
        ...


@cached_jit
def cost_matrices(
    distances: Float[Array | np.ndarray, "frames ends ends"],
    count: Int[Array | np.ndarray, " frames"],
    template: Float[Array | np.ndarray, "labels labels"],
) -> Float[Array, "frames ends labels"]:
    """C (Eq. 4): DTW cost (m) of every row of D with every row of D', infinite in the padding."""
    return _rows_with_rows(dtw, distances, count, template)


@cached_jit
def soft_cost_matrices(
    distances: Float[Array | np.ndarray, "frames ends ends"],
    count: Int[Array | np.ndarray, " frames"],
    template: Float[Array | np.ndarray, "labels labels"],
    gamma: Float[Array | np.ndarray, ""] | float,
) -> Float[Array, "frames ends labels"]:
    """As [`cost_matrices`][], but with [`soft_dtw`][] of smoothing gamma (m) instead of `dtw`, for gradients."""

    def soft(row, n, other):
        return soft_dtw(row, n, other, gamma)

    return _rows_with_rows(soft, distances, count, template)


def _rows_with_rows(
    cost: Callable[..., Array],
    distances: Float[Array | np.ndarray, "frames ends ends"],
    count: Int[Array | np.ndarray, " frames"],
    template: Float[Array | np.ndarray, "labels labels"],
) -> Float[Array, "frames ends labels"]:
    """Cost matrices: `cost` of two rows, vmapped over frames, end nodes and template nodes."""
    over_labels = jax.vmap(cost, (None, None, 0))
    over_ends = jax.vmap(over_labels, (0, None, None))
    padding = (jnp.arange(distances.shape[1])[None, :] >= count[:, None])[..., None]
    # Unused rows are zeroed, so that their contents cannot reach the gradients.
    costs = jax.vmap(over_ends, (0, 0, None))(jnp.where(padding, 0.0, distances), count, template)
    return jnp.where(padding, jnp.inf, costs)


class DtwMatcher(eqx.Module):
    """The paper's matcher: DTW costs (Eq. 3, 4), the head fixed to the root, then the Hungarian algorithm."""

    def match(self, ends: EndNodes, skeleton: Skeleton) -> Matches:
        """Label the end nodes of a batch of graphs."""
        # Imported here, because it takes a tenth of a second and the exact matcher seldom needs it.
        from scipy.optimize import linear_sum_assignment

        template = template_ends(skeleton)
        distances, count = filled((ends.distances, ends.count))
        costs = np.asarray(cost_matrices(distances, count, template))
        labels = np.full((len(ends.count), len(template)), -1, np.int64)
        for f, n in enumerate(ends.count):
            labels[f, 0] = 0
            rows, columns = linear_sum_assignment(costs[f, 1:n, 1:])
            labels[f, 1 + columns] = 1 + rows
        return Matches(labels, _agreement(ends, labels, template))


class ExactMatcher(eqx.Module):
    """The end nodes whose geodesic distances, all together, agree best with the template's.

    Minimises ``sum |D[q, q] - D'|`` exhaustively over q = (root, hand, hand, foot, foot) of a human, whereas the paper
    compares one row at a time and lets DTW absorb spurious end nodes.
    """

    def match(self, ends: EndNodes, skeleton: Skeleton) -> Matches:
        """Label the end nodes of a batch of graphs."""
        template = template_ends(skeleton)
        distances, count = filled((ends.distances, ends.count))
        candidates = _candidates(skeleton.template)
        best = np.asarray(_best_candidate(distances, count, template, candidates))[: len(ends.count)]
        labels = np.where((ends.count >= len(template))[:, None], candidates[best], -1).astype(np.int64)
        few = np.flatnonzero(ends.count < len(template))
        if len(few):  # some limbs are missing: match one row at a time, as the paper does
            part = EndNodes(*(getattr(ends, k)[few] for k in ("nodes", "count", "distances", "positions")))
            labels[few] = DtwMatcher().match(part, skeleton).ends
        return Matches(labels, _agreement(ends, labels, template))


@lru_cache(maxsize=16)
def _candidates(template: SkeletonTemplate) -> Int[np.ndarray, "candidates tips"]:
    """All end nodes for the root and the other tips; the two of a pair are interchangeable, so only in ascending order.

    Raises:
        ValueError: The template has too many tips to try them all.
    """
    tips, mirror = len(template.tip_names), template.mirror_tips
    if tips > _MOST_TIPS:
        raise ValueError(f"matcher: {template.name!r} has {tips} tips, too many for ExactMatcher(); give DtwMatcher()")
    pairs = [(tip, int(other)) for tip, other in enumerate(mirror) if tip < other]
    every = np.array(list(permutations(range(1, MAX_ENDS), tips - 1)), np.int32)
    every = np.concatenate([np.zeros((len(every), 1), np.int32), every], 1)
    for one, other in pairs:
        every = every[every[:, one] < every[:, other]]
    return every


@cached_jit
def _best_candidate(distances, count, template, candidates) -> Int[Array, " frames"]:
    pairs = list(combinations(range(len(template)), 2))

    def one(d, n):
        q = candidates.T
        cost = sum((jnp.abs(d[q[a], q[b]] - template[a, b]) for a, b in pairs), jnp.zeros(()))
        there = candidates.max(1) < n
        return jnp.argmin(jnp.where(there, cost, jnp.inf))

    return jax.vmap(one)(distances, count)


def _agreement(ends: EndNodes, labels: np.ndarray, template: np.ndarray) -> Float[np.ndarray, " frames"]:
    frames = np.arange(len(labels))[:, None, None]
    found = labels >= 0
    chosen = ends.distances[frames, labels[:, :, None], labels[:, None, :]]
    pairs = found[:, :, None] & found[:, None, :] & ~np.eye(len(template), dtype=bool)
    difference = np.where(pairs, np.abs(chosen - template), 0.0).sum((1, 2))
    return difference / np.maximum(pairs.sum((1, 2)), 1)
