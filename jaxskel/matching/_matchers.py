"""Matching end nodes with the template (Sect. 3.2.2): the paper's DTW and Hungarian algorithm, and an exact matcher.

A matcher is an object with ``match(ends, skeleton) -> Matches``; both matchers work on batches of frames.
"""

from collections.abc import Callable
from itertools import combinations
from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._runtime.batching import filled
from .._runtime.compile_cache import cached_jit
from ..body import Skeleton
from ..graph import MAX_ENDS
from ._descriptors import EndNodes, template_ends
from ._dtw import dtw
from ._soft_dtw import soft_dtw


class Matches(eqx.Module):
    """End nodes with the labels head, hand, hand, foot, foot; left and right are not distinguished yet.

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
        labels = np.full((len(ends.count), 5), -1, np.int64)
        for f, n in enumerate(ends.count):
            labels[f, 0] = 0
            rows, columns = linear_sum_assignment(costs[f, 1:n, 1:])
            labels[f, 1 + columns] = 1 + rows
        return Matches(labels, _agreement(ends, labels, template))


class ExactMatcher(eqx.Module):
    """The pair of hands and pair of feet whose geodesic distances, all together, agree best with the template's.

    Minimises ``sum |D[q, q] - D'|`` exhaustively over q = (root, hand, hand, foot, foot), whereas the paper compares
    one row at a time and lets DTW absorb spurious end nodes.
    """

    def match(self, ends: EndNodes, skeleton: Skeleton) -> Matches:
        """Label the end nodes of a batch of graphs."""
        template = template_ends(skeleton)
        distances, count = filled((ends.distances, ends.count))
        best = np.asarray(_best_candidate(distances, count, template, _CANDIDATES))[: len(ends.count)]
        labels = np.where((ends.count >= 5)[:, None], _CANDIDATES[best], -1).astype(np.int64)
        few = np.flatnonzero(ends.count < 5)
        if len(few):  # some limbs are missing: match one row at a time, as the paper does
            part = EndNodes(*(getattr(ends, k)[few] for k in ("nodes", "count", "distances", "positions")))
            labels[few] = DtwMatcher().match(part, skeleton).ends
        return Matches(labels, _agreement(ends, labels, template))


def _candidates() -> Int[np.ndarray, "candidates labels"]:
    """All (root, hand, hand, foot, foot); the two of a pair are interchangeable, so only in ascending order."""
    others = range(1, MAX_ENDS)
    return np.array(
        [
            (0, *hands, *feet)
            for hands in combinations(others, 2)
            for feet in combinations([i for i in others if i not in hands], 2)
        ],
        np.int32,
    )


_CANDIDATES = _candidates()


@cached_jit
def _best_candidate(distances, count, template, candidates) -> Int[Array, " frames"]:
    def one(d, n):
        # The template is symmetric, so D' has few distinct entries and the sum splits into few terms.
        head_hand, hand_hand = template[0, 1], template[1, 2]
        head_foot, foot_foot, hand_foot = template[0, 3], template[3, 4], template[1, 3]
        _, h1, h2, f1, f2 = candidates.T
        to_hand, to_foot = jnp.abs(d[0] - head_hand), jnp.abs(d[0] - head_foot)
        hands, feet, across = jnp.abs(d - hand_hand), jnp.abs(d - foot_foot), jnp.abs(d - hand_foot)
        cost = to_hand[h1] + to_hand[h2] + hands[h1, h2] + to_foot[f1] + to_foot[f2] + feet[f1, f2]
        cost += across[h1, f1] + across[h1, f2] + across[h2, f1] + across[h2, f2]
        there = candidates.max(1) < n
        return jnp.argmin(jnp.where(there, cost, jnp.inf))

    return jax.vmap(one)(distances, count)


def _agreement(ends: EndNodes, labels: np.ndarray, template: np.ndarray) -> Float[np.ndarray, " frames"]:
    frames = np.arange(len(labels))[:, None, None]
    found = labels >= 0
    chosen = ends.distances[frames, labels[:, :, None], labels[:, None, :]]
    pairs = found[:, :, None] & found[:, None, :] & ~np.eye(5, dtype=bool)
    difference = np.where(pairs, np.abs(chosen - template), 0.0).sum((1, 2))
    return difference / np.maximum(pairs.sum((1, 2)), 1)
