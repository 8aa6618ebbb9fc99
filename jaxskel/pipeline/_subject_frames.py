"""The frames that a subject is looked for in, and the poses of a body in them."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from .._runtime.batching import take
from ..body import Prior, Shape, Skeleton, measured_body
from ..matching import Limbs
from ..refinement.terms import Observed
from ..search import (
    Hypotheses,
    Search,
    fit_of,
    fit_pool,
    fit_scales,
    graphless_poses,
    make_model,
    solve_frames,
    start_poses,
)
from ._observe_batch import Labelled, Outlines

# Frames that other sizes are tried on.
_TRIED = 8
FINE = fit_scales((0.04, 4))
"""Scales of a fit from poses that are nearly right."""
NO_PRIOR = 0.0
"""Bodies are found without priors of poses, which would make the same error in all frames of an unusual motion."""


def typical(found: Hypotheses) -> float:
    """Median cost of the best poses of some frames."""
    return float(np.median(found.cost[:, 0]))


class Sight(NamedTuple):
    """What the chosen frames show."""

    observed: Observed
    limbs: Limbs
    facing: Float[np.ndarray, "frames 3"]
    middles: Float[np.ndarray, "frames 3"]


def sight_of(outlines: Outlines, labelled: Labelled) -> Sight:
    """What frames show, from their outlines and their labelled graphs."""
    return Sight(outlines.observed, labelled.limbs, labelled.facing, outlines.middles)


class Given(NamedTuple):
    """What does not change while a subject is looked for.

    Attributes:
        stack: What the frames show, on the device.
        refits: Whether hypotheses may be fitted again to an adjusted body, instead of searched for again.
    """

    template: Skeleton
    prior: Callable[[float], Prior]
    sight: Sight
    stack: Observed
    search: Search
    refits: bool = True

    @property
    def narrow(self) -> "Given":
        """The same, but no frame is searched in more widely because its poses cost much."""
        return self._replace(search=replace(self.search, doubtful=np.inf))

    @property
    def every(self) -> Int[np.ndarray, " frames"]:
        """All frames."""
        return np.arange(len(self.sight.middles))

    @property
    def tried(self) -> Int[np.ndarray, " some"]:
        """Frames that other sizes are tried on."""
        return self.every[:: -(-len(self.every) // _TRIED)]

    def poses_of_all(self, shape: Shape, tried: Hypotheses) -> Hypotheses:
        """The poses of a body in all frames, given those in the frames that sizes are tried on.

        If these cost too much, wide searches would cost much in the others and find little: first the body must fit.
        """
        others = np.setdiff1d(self.every, self.tried)
        if len(others) == 0:
            return tried
        searching = self if typical(tried) <= self.search.doubtful_cost else self.narrow
        both = jax.tree.map(lambda *some: np.concatenate(some), tried, searching.poses_of(shape, others))
        return take(both, np.argsort(np.concatenate([self.tried, others])))

    def poses_of(self, shape: Shape, frames: Int[np.ndarray, " some"]) -> Hypotheses:
        """Search for the poses of a body in some frames."""
        body = measured_body(self.template, shape)
        limbs, facing = take((self.sight.limbs, self.sight.facing), frames)
        fallback = graphless_poses(self.sight.middles, body.skeleton)
        starts = start_poses(limbs, facing, body.skeleton)
        return solve_frames(
            make_model(body, self.search.objective, NO_PRIOR), self.search, starts, fallback, self.stack, frames
        )

    def poses_from(self, found: Hypotheses, shape: Shape) -> Hypotheses:
        """The poses of another body of nearly the same shape, from those found; searched for where none fits."""
        fitted = self._refitted(found, shape, self.every)
        doubtful = self._doubtful(fitted)
        return _cheaper(fitted, self.poses_of(shape, doubtful), doubtful) if len(doubtful) else fitted

    def poses_again(self, found: Hypotheses, shape: Shape) -> Hypotheses:
        """Search for the poses of another body; where they cost much, those found before are fitted to it, too.

        Instead of a wide search, which has already been made for a similar body.
        """
        again = self.narrow.poses_of(shape, self.every)
        doubtful = self._doubtful(again)
        return _cheaper(again, self._refitted(found, shape, doubtful), doubtful) if len(doubtful) else again

    def _doubtful(self, found: Hypotheses) -> Int[np.ndarray, " some"]:
        return np.flatnonzero(found.cost[:, 0] > self.search.doubtful_cost)

    def _refitted(self, found: Hypotheses, shape: Shape, frames: Int[np.ndarray, " some"]) -> Hypotheses:
        """The hypotheses of some frames, fitted to a body."""
        to_fit = fit_of(measured_body(self.template, shape), self.search.objective, NO_PRIOR)
        pool = take(found, frames).pool(frames)
        return fit_pool(*to_fit, pool, self.stack, FINE).rows(frames, found.cost.shape[1])


def _cheaper(found: Hypotheses, others: Hypotheses, frames: Int[np.ndarray, " some"]) -> Hypotheses:
    """What was found, and in some frames others, if their best is cheaper."""
    better = others.cost[:, 0] < found.cost[frames, 0]
    return found.replaced(frames[better], take(others, better))
