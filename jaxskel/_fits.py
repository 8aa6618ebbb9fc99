"""Fits of many hypotheses at once: all take the same steps, any number of frames and hypotheses has the same shapes."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._descend import descend
from ._hypotheses import Hypotheses, beside
from ._skeleton import Pose, Skeleton
from ._stacks import single_precision, taken
from .parametrisations import HingedLimbs
from .terms import Objective, Observed, place

_HINGED = HingedLimbs()
_MOST_STEPS = 16  # of one fit
# Frames, and hypotheses of each, that are fitted at once.
_FRAMES, _AT_ONCE = 8, 2
# Steps look at one of so many rays; what a pose costs is told by all.
_FEW = 9


def fit_scales(*rounds: tuple[float, int]) -> tuple[Array, Array]:
    """Robust scales (m) and numbers of steps for them, as `fit_poses` takes them."""
    values = np.concatenate([np.full(steps, scale, np.float32) for scale, steps in rounds])
    return jnp.asarray(np.resize(values, _MOST_STEPS)), jnp.asarray(len(values), jnp.int32)


def fit_poses(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed, scales: tuple[Array, Array]
) -> Hypotheses:
    """Let hypotheses (axes ``frames hypotheses``) descend and order them by their cost.

    `scales` comes from [`fit_scales`][]; other steps do not compile again, nor do other numbers of frames.
    """
    return in_chunks(lambda poses, observed: fit_few(objective, skeleton, poses, observed, scales), poses, observed)


def in_chunks(work: Callable[[Any, Observed], Hypotheses], poses: Any, observed: Observed) -> Hypotheses:
    """Work on a fixed number of frames at a time, the last ones filled up with a frame that is there already."""
    count = len(observed.neck)
    done = []
    for start in range(0, count, _FRAMES):
        frames = np.minimum(np.arange(start, start + _FRAMES), count - 1)
        # On the device once, not with each of many calls: silhouettes are large.
        done.append(work(*jax.device_put(single_precision(taken((poses, observed), frames)))))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *done)


def fit_few(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed, scales: tuple[Array, Array]
) -> Hypotheses:
    """Fit the hypotheses of as many frames as `in_chunks` gives, a few of each frame at a time."""
    parts = []
    for start in range(0, poses.root.shape[1], _AT_ONCE):
        part = jax.tree.map(lambda a, s=start: np.asarray(a)[:, s : s + _AT_ONCE], poses)
        count = part.root.shape[1]
        part = jax.tree.map(lambda a, n=count: a[:, np.minimum(np.arange(_AT_ONCE), n - 1)], part)
        fitted, cost = jax.tree.map(np.asarray, _fitted(objective, skeleton, part, observed, scales))
        parts.append(jax.tree.map(lambda a, n=count: a[:, :n], Hypotheses(fitted, cost)))
    found = beside(parts)
    return found.ordered(np.argsort(found.cost, 1, kind="stable"))


def fit_hypothesis(
    objective: Objective, skeleton: Skeleton, pose: Pose, observed: Observed, scales: tuple[Array, Array]
) -> tuple[Pose, Float[Array, ""]]:
    """Let one hypothesis of one frame descend; also what it costs then, infinite where that is no number."""
    few = observed.thinned(_FEW)

    def step(number: Array, pose: Pose) -> Pose:
        scaled = eqx.tree_at(lambda o: o.terms["contours"].scale, objective, scales[0][number])
        return descend(scaled, _HINGED, skeleton, pose, few)

    pose = jax.lax.fori_loop(0, scales[1], step, pose)
    cost = sum(objective.costs(place(skeleton, pose), observed).values(), jnp.zeros(()))
    return pose, jnp.where(jnp.isfinite(cost), cost, jnp.inf)


@eqx.filter_jit
def _fitted(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed, scales: tuple[Array, Array]
) -> tuple[Pose, Float[Array, "frames hypotheses"]]:
    def fit(pose: Pose, observed: Observed) -> tuple[Pose, Array]:
        return fit_hypothesis(objective, skeleton, pose, observed, scales)

    single = jax.tree.map(jnp.asarray, poses)
    return jax.vmap(lambda poses, frame: jax.vmap(lambda pose: fit(pose, frame))(poses))(single, observed)
