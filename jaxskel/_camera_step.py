"""One step of the refinement of a rig: residuals that are linear in the unknowns, robust weights, and a prior."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ._coherence import Sensitivity
from ._kept import kept
from ._levenberg_marquardt import LevenbergMarquardt

# Noise (px, standard deviation) that even the outlines of clean masks have, from their pixels.
_LEAST_NOISE = 0.25
# Of normal noise: what the median of its absolute values must be multiplied by.
_FROM_MEDIAN = 1.48
# Residuals of this many standard deviations begin to count less: there the mask is wrong, not the camera.
_TAIL = 3.0
# Errors of masks are alike for neighbouring rays: so many count as one measurement.
_ALIKE = 10.0
_SOLVER = LevenbergMarquardt(rtol=1e-3, atol=1e-3)
_MAX_STEPS = 30


class CameraStep(eqx.Module):
    """Where a step leads, in units of the prior's standard deviations."""

    unknowns: Float[Array, "cams 6"]
    """Rotation vectors and shifts, from the rig as it was given."""
    spread: Float[Array, "cams 6"]
    """Their standard deviations by the outlines and the prior together: 1 where outlines say nothing."""


def noise_of(residuals: Float[Array | np.ndarray, " rays"]) -> float:
    """Standard deviation of outlines (px) that positive residuals show, most of which are noise at the end."""
    positive = np.asarray(residuals)
    positive = positive[positive > 0]
    return max(_LEAST_NOISE, _FROM_MEDIAN * float(np.median(positive))) if len(positive) else _LEAST_NOISE


@kept
def camera_step(
    found: Sensitivity,
    now: Float[Array | np.ndarray, "cams 6"],
    units: Float[Array | np.ndarray, "6"],
    noise: Float[Array | np.ndarray, ""],
) -> CameraStep:
    """Bring rays to the silhouettes that they miss: ``sum w max(0, r)^2 + |unknowns|^2``, the second part the prior.

    Args:
        found: Residuals of the rig as it is now.
        now: Its unknowns.
        units: The prior's standard deviations of the unknowns of a camera (rad and m).
        noise: See `noise_of`.
    """
    # Geman and McClure's weights.
    weight = 1 / (1 + (jnp.maximum(found.value, 0.0) / (_TAIL * noise)) ** 2) / (noise * jnp.sqrt(_ALIKE))
    start = jnp.asarray(now).reshape(-1)
    rows = (found.slopes * units[None, None]).reshape(len(found.value), -1) * weight[:, None]
    values = found.value * weight - rows @ start

    def residuals(unknowns: Float[Array, " unknowns"], given: tuple[Array, Array]) -> tuple[Array, Array]:
        rows, values = given
        return jnp.maximum(rows @ unknowns + values, 0.0), unknowns

    solution = optx.least_squares(
        residuals, _SOLVER, start, args=(rows, values), max_steps=_MAX_STEPS, throw=False
    ).value
    missing = jnp.where(residuals(solution, (rows, values))[0][:, None] > 0, rows, 0.0)
    spread = jnp.sqrt(jnp.diagonal(jnp.linalg.inv(missing.T @ missing + jnp.eye(start.size))))
    return CameraStep(solution.reshape(-1, 6), spread.reshape(-1, 6))
