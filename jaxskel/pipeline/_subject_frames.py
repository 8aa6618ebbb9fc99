"""The frames that a subject is looked for in, and the poses of a body in them."""

from collections.abc import Callable
from typing import NamedTuple

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
    def tried(self) -> Int[np.ndarray, " some"]:
        """Frames that other sizes are tried on."""
        every = np.arange(len(self.sight.middles))
        return every[:: -(-len(every) // _TRIED)]

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
        to_fit = fit_of(measured_body(self.template, shape), self.search.objective, NO_PRIOR)
        every, count = np.arange(len(found.cost)), found.cost.shape[1]
        fitted = fit_pool(*to_fit, found.pool(every), self.stack, FINE).rows(every, count)
        doubtful = np.flatnonzero(fitted.cost[:, 0] > self.search.doubtful_cost)
        if len(doubtful) == 0:
            return fitted
        again = self.poses_of(shape, doubtful)
        better = again.cost[:, 0] < fitted.cost[doubtful, 0]
        return fitted.replaced(doubtful[better], take(again, better))
