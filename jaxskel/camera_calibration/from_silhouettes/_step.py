"""One step of the refinement of a rig: linearised residuals, robust weights, and a prior."""

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
# Noise of the planes tangent to smooth outlines (px): for the true rig of a clean film they miss by 0.11 to 0.12.
LEAST_NOISE_OF_PLANES = 0.1
# Ratio of the standard deviation to the median absolute value, for normal noise.
_FROM_MEDIAN = 1.48
# Residuals beyond this many standard deviations are down-weighted: there the mask is wrong, not the camera.
_TAIL = 3.0
# Plane errors are correlated even without shared outline points: at least this many count as one.
_PLANES_ALIKE = 3.0
_SOLVER = NormalEquationsLM(rtol=1e-3, atol=1e-3)
_MAX_STEPS = 30


class CameraStep(eqx.Module):
    """Result of a step, in units of the prior's standard deviations.

    Attributes:
        unknowns: Rotation vectors and shifts, relative to the rig as given.
        spread: Their standard deviations from outlines and prior together: 1 if the outlines tell nothing.
    """

    unknowns: Float[Array, "cams 6"]
    spread: Float[Array, "cams 6"]


def noise_of(residuals: Float[Array | np.ndarray, " rays"], least: float) -> float:
    """Robust standard deviation of outlines (px) from residuals that are mostly noise; at least `least`."""
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
    """Minimise ``sum w max(0, r - n)^2 + sum w q^2 + |unknowns|^2``, the last term being the prior.

    Misses of rays below the noise ``n`` of pixel outlines are no evidence. Only positive residuals count, so noise does
    not cancel: without ``n`` the rig would be bent until no ray missed because of it.

    Args:
        rays: Residuals r of the current rig, which are evidence if positive.
        tangents: Residuals q, which are evidence in either direction.
        alike: Number of tangents that share the errors of each tangent.
        now: Current unknowns of the rig.
        units: Standard deviations of the prior for the unknowns of a camera (rad and m).
        noise: Noise of the rays and of the tangents, see `noise_of`.
    """
    start = jnp.asarray(now).reshape(-1)

    def weighted(found: Sensitivity, noise: Array, alike: Array | float, margin: float) -> tuple[Array, Array]:
        # Geman and McClure's weights.
        weight = 1 / (1 + (found.value / (_TAIL * noise)) ** 2) / (noise * jnp.sqrt(alike))
        rows = (found.slopes * units[None, None]).reshape(len(found.value), -1) * weight[:, None]
        return rows, (found.value - margin) * weight - rows @ start

    noise = jnp.asarray(noise)
    shared = jnp.maximum(jnp.asarray(alike), _PLANES_ALIKE)
    # Rays of a view are five pixels apart, so their errors are independent.
    given = weighted(rays, noise[0], 1.0, LEAST_NOISE), weighted(tangents, noise[1], shared, 0.0)

    def residuals(unknowns: Float[Array, " unknowns"], given: tuple[tuple[Array, Array], ...]) -> tuple[Array, ...]:
        missed, apart = (rows @ unknowns + values for rows, values in given)
        return jnp.maximum(missed, 0.0), apart, unknowns

    solution = optx.least_squares(residuals, _SOLVER, start, args=given, max_steps=_MAX_STEPS, throw=False).value
    missing = jnp.where(residuals(solution, given)[0][:, None] > 0, given[0][0], 0.0)
    known = missing.T @ missing + given[1][0].T @ given[1][0] + jnp.eye(start.size)
    return CameraStep(solution.reshape(-1, 6), jnp.sqrt(jnp.diagonal(jnp.linalg.inv(known))).reshape(-1, 6))
