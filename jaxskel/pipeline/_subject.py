"""Who is it? Dimensions and flesh of a subject together with its poses in some frames.

Poses are searched for with a first guess of the body; then lengths, flesh and the poses of all frames are adjusted at
once, and both once more.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float

from .._runtime.batching import filled, on_device, single_precision, take
from ..body import Body, Pose, Prior, Skeleton, measured_body
from ..body_calibration import bundle_adjust
from ..matching import Limbs
from ..refinement.terms import Observed
from ..search import Search, fit_poses, fit_scales, graphless_poses, make_model, solve_frames, start_poses

SUBJECT_STAGES = ("searching", "adjusting", "searching again", "adjusting again", "judging")
"""What `find_subject` does, one after the other."""
# The frames with the worst fits may have wrong poses; they are left out.
_USED = 0.8
# One ray in this many is used, because neighbouring rays are correlated.
_SOME = 3
_SCALES = fit_scales((0.04, 4))


class Sight(NamedTuple):
    """What the chosen frames show."""

    observed: Observed
    limbs: Limbs
    facing: Float[np.ndarray, "frames 3"]
    middles: Float[np.ndarray, "frames 3"]


class Costs(eqx.Module):
    """Costs of correct poses of a subject in one recording, in the units of `volume_objective`."""

    low: float
    """The 10 % quantile over the frames."""
    typical: float
    """The median over the frames."""


class Subject(NamedTuple):
    """A subject's body, and the poses that it was found with."""

    body: Body
    covariance: Float[np.ndarray, "lengths=11 lengths"]
    """Of the logarithms of the lengths, in the order of `LENGTH_NAMES`."""
    costs: Costs
    poses: Pose
    """Axis ``used``: the frames that count."""
    used: Bool[np.ndarray, " frames"]


def find_subject(
    template: Skeleton,
    prior: Prior,
    sight: Sight,
    search: Search,
    on_stage: Callable[[str], None] = lambda _: None,
) -> Subject:
    """Find a subject's body.

    Args:
        template: Skeleton that the prior is relative to (m).
        prior: What is known of the body before.
        sight: What the frames show.
        search: Breadth and depth of the search for poses.
        on_stage: Called with each of `SUBJECT_STAGES` as it begins.
    """
    shape, body = prior.mean, measured_body(template, prior.mean)
    stack = on_device(sight.observed)
    for searching, adjusting in (SUBJECT_STAGES[:2], SUBJECT_STAGES[2:4]):
        on_stage(searching)
        starts = start_poses(sight.limbs, sight.facing, body.skeleton)
        fallback = graphless_poses(sight.middles, body.skeleton)
        found = solve_frames(make_model(body), search, starts, fallback, stack)
        used = found.cost[:, 0] <= np.quantile(found.cost[:, 0], _USED)
        on_stage(adjusting)
        adjusted = bundle_adjust(template, prior, shape, filled(found.best), stack.thinned(_SOME), used)
        shape, body = adjusted.shape, measured_body(template, adjusted.shape)
    on_stage(SUBJECT_STAGES[4])
    poses = take(adjusted.poses, np.flatnonzero(used))
    fitted = fit_poses(
        single_precision(body), jax.tree.map(lambda a: a[:, None], poses), take(sight.observed, used), _SCALES
    )
    low, typical = np.quantile(fitted.cost[:, 0], (0.1, 0.5))
    return Subject(body, adjusted.covariance, Costs(float(low), float(typical)), poses, used)
