"""Hypotheses of some frames: poses and what they cost, the cheapest first."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, Int

from ._skeleton import Pose
from ._stacks import taken


class Hypotheses(eqx.Module):
    """Poses of some frames, the cheapest of each first."""

    poses: Pose
    """Axes ``frames hypotheses``."""
    cost: Float[np.ndarray, "frames hypotheses"]

    @property
    def best(self) -> Pose:
        """The cheapest of each frame, without the axis of hypotheses."""
        return jax.tree.map(lambda a: a[:, 0], self.poses)

    def first(self, count: int) -> Pose:
        """The cheapest few of each frame."""
        return jax.tree.map(lambda a: a[:, :count], self.poses)

    def last(self, count: int) -> "Hypotheses":
        """All of each frame but the cheapest few."""
        return jax.tree.map(lambda a: a[:, count:], self)

    def merged(self, other: "Hypotheses", frames: Int[np.ndarray, " some"]) -> "Hypotheses":
        """As many hypotheses as before, in some frames the cheapest of these and of `other`, which is of those only."""
        both = beside([taken(self, frames), other])
        best = both.ordered(np.argsort(both.cost, 1, kind="stable")[:, : self.cost.shape[1]])

        def put(old: np.ndarray, new: np.ndarray) -> np.ndarray:
            old = old.copy()
            old[frames] = new
            return old

        return jax.tree.map(put, self, best)

    def ordered(self, order: Int[np.ndarray, "frames some"]) -> "Hypotheses":
        """Some of each frame's hypotheses, in an order of its own."""
        rows = np.arange(len(order))[:, None]
        return jax.tree.map(lambda a: a[rows, order], self)


def beside(parts: list[Hypotheses]) -> Hypotheses:
    """Hypotheses of the same frames, put together without any order."""
    return jax.tree.map(lambda *a: np.concatenate(a, 1), *parts)
