"""One step of the refinement of a rig: residuals that are linear in the unknowns, robust weights, and a prior."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..._runtime.compile_cache import cached_jit
from ...refinement.solvers import NormalEquationsLM
from ._coherence import Sensitivity

# Noise (px, standard deviation) that even the outlines of clean masks have, from their pixels.
LEAST_NOISE = 0.25
# Likewise of planes that touch smooth ones: at the true rig of a clean film they miss each other by 0.11 to 0.12.
LEAST_NOISE_OF_PLANES = 0.1
# Of normal noise: what the median of its absolute values must be multiplied by.
_FROM_MEDIAN = 1.48
# Residuals of this many standard deviations begin to count less: there the mask is wrong, not the camera.
_TAIL = 3.0
# Errors of planes are alike even where no others touch the same place: at least so many count as one.
_PLANES_ALIKE = 3.0
_SOLVER = NormalEquationsLM(rtol=1e-3, atol=1e-3)
_MAX_STEPS = 30


class CameraStep(eqx.Module):
    """Where a step leads, in units of the prior's standard deviations."""

    unknowns: Float[Array, "cams 6"]
    """Rotation vectors and shifts, from the rig as it was given."""
    spread: Float[Array, "cams 6"]
    """Their standard deviations by the outlines and the prior together: 1 where outlines say nothing."""


def noise_of(residuals: Float[Array | np.ndarray, " rays"], least: float) -> float:
    """Standard deviation of outlines (px) that residuals show, most of which are noise at the end; `least` or more."""
    return max(least, _FROM_MEDIAN * float(np.median(residuals))) if np.size(residuals) else least


@cached_jit
def camera_step(
    rays: Sensitivity,
    tangents: Sensitivity,
    alike: Float[Array | np.ndarray, " tangents"],
    now: Float[Array | np.ndarray, "cams 6"],
    units: Float[Array | np.ndarray, "6"],
    noise: Float[Array | np.ndarray, "2"],
) -> CameraStep:
    """Bring silhouettes together: ``sum w max(0, r - n)^2 + sum w q^2 + |unknowns|^2``, the last part the prior.

    What rays miss by less than the noise ``n`` of outlines that are made of pixels is no evidence. As only what is
    positive counts, noise does not cancel: the rig would be bent until no ray missed by it.

    Args:
        rays: Residuals r of the rig as it is now, evidence where they are positive.
        tangents: Residuals q that are evidence in either direction.
        alike: So many of these err together.
        now: The rig's unknowns.
        units: The prior's standard deviations of the unknowns of a camera (rad and m).
        noise: Of the rays and of the tangents, see `noise_of`.
    """
    start = jnp.asarray(now).reshape(-1)

    def weighted(found: Sensitivity, noise: Array, alike: Array | float, margin: float) -> tuple[Array, Array]:
        # Geman and McClure's weights.
        weight = 1 / (1 + (found.value / (_TAIL * noise)) ** 2) / (noise * jnp.sqrt(alike))
        rows = (found.slopes * units[None, None]).reshape(len(found.value), -1) * weight[:, None]
        return rows, (found.value - margin) * weight - rows @ start

    noise = jnp.asarray(noise)
    shared = jnp.maximum(jnp.asarray(alike), _PLANES_ALIKE)
    # Rays of a view are five pixels apart: each errs by itself.
    given = weighted(rays, noise[0], 1.0, LEAST_NOISE), weighted(tangents, noise[1], shared, 0.0)

    def residuals(unknowns: Float[Array, " unknowns"], given: tuple[tuple[Array, Array], ...]) -> tuple[Array, ...]:
        missed, apart = (rows @ unknowns + values for rows, values in given)
        return jnp.maximum(missed, 0.0), apart, unknowns

    solution = optx.least_squares(residuals, _SOLVER, start, args=given, max_steps=_MAX_STEPS, throw=False).value
    missing = jnp.where(residuals(solution, given)[0][:, None] > 0, given[0][0], 0.0)
    known = missing.T @ missing + given[1][0].T @ given[1][0] + jnp.eye(start.size)
    return CameraStep(solution.reshape(-1, 6), jnp.sqrt(jnp.diagonal(jnp.linalg.inv(known))).reshape(-1, 6))
