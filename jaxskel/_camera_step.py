"""One step of the refinement of a rig: residuals that are linear in the unknowns, robust weights, and a prior."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ._coherence import NOTHING, Sensitivity
from ._kept import kept
from ._levenberg_marquardt import LevenbergMarquardt

# Of a squared residual above the typical one; below, the rest counts. Above a half by far: see `camera_step`.
_ABOVE = 0.9
# Noise (px, standard deviation) that even the outlines of clean masks have, from their pixels.
_LEAST_NOISE = 0.25
# Of normal noise: what the median of its absolute values must be multiplied by.
_FROM_MEDIAN = 1.48
# Residuals of this many standard deviations begin to count less: there the mask is wrong, not the camera.
_TAIL = 3.0
# Errors of masks are alike for neighbouring rays: so many count as one measurement.
_ALIKE = 3.0
_SOLVER = LevenbergMarquardt(rtol=1e-3, atol=1e-3)
_MAX_STEPS = 30


class CameraStep(eqx.Module):
    """Where a step leads, in units of the prior's standard deviations."""

    unknowns: Float[Array, "cams 6"]
    """Rotation vectors and shifts, from the rig as it was given."""
    spread: Float[Array, "cams 6"]
    """Their standard deviations by the outlines and the prior together: 1 where outlines say nothing."""


def noise_of(residuals: Float[Array | np.ndarray, " rays"]) -> float:
    """Standard deviation of outlines (px) that residuals show, most of which are noise at the end."""
    return max(_LEAST_NOISE, _FROM_MEDIAN * float(np.median(residuals))) if np.size(residuals) else _LEAST_NOISE


@kept
def camera_step(
    rays: Sensitivity,
    tangents: Sensitivity,
    now: Float[Array | np.ndarray, "cams 6"],
    units: Float[Array | np.ndarray, "6"],
    noise: Float[Array | np.ndarray, "2"],
) -> CameraStep:
    """Bring silhouettes together: ``sum w a (r - c)^2 + sum w q^2 + |unknowns|^2``, the last part the prior.

    An expectile regression: ``a`` is large above ``c`` and small below, since a ray that misses the others' hull shows
    an error, and one that runs through it may well do so. How deep rays run typically, ``c``, is found with the rig:
    were it held at zero, the noise of outlines would not cancel, and the rig would be bent until no ray missed by it.

    Args:
        rays: Residuals r of the rig as it is now.
        tangents: Residuals q that are evidence in either direction.
        now: The rig's unknowns.
        units: The prior's standard deviations of the unknowns of a camera (rad and m).
        noise: Of the rays and of the tangents, see `noise_of`.
    """
    start = jnp.asarray(now).reshape(-1)

    def weighted(found: Sensitivity, noise: Float[Array, ""], alike: float) -> tuple[Array, Array, Array]:
        # Geman and McClure's weights.
        weight = 1 / (1 + (found.value / (_TAIL * noise)) ** 2) / (noise * np.sqrt(alike))
        weight = jnp.where(found.value > NOTHING, weight, 0.0)
        rows = (found.slopes * units[None, None]).reshape(len(found.value), -1) * weight[:, None]
        return rows, found.value * weight - rows @ start, weight

    noise = jnp.asarray(noise)
    # The planes of a view with each of the others touch about the same place of its outline, and err together.
    shared = max(_ALIKE, len(now) - 1.0)
    given = weighted(rays, noise[0], _ALIKE), weighted(tangents, noise[1], shared)

    def residuals(unknowns: Float[Array, " unknowns"], given: tuple[tuple[Array, ...], ...]) -> tuple[Array, ...]:
        (through, missed, weight), (touching, apart, _) = given
        missed = through @ unknowns[:-1] + missed - weight * unknowns[-1]
        share = jnp.where(missed > 0, _ABOVE, 1 - _ABOVE)
        return jnp.sqrt(share) * missed, touching @ unknowns[:-1] + apart, unknowns[:-1]

    begin = jnp.append(start, 0.0)
    solution = optx.least_squares(residuals, _SOLVER, begin, args=given, max_steps=_MAX_STEPS, throw=False).value
    rows = jax.jacfwd(lambda unknowns: jnp.concatenate(residuals(unknowns, given)))(solution)
    # How deep rays run is held as weakly as the numbers allow, in case no ray tells anything.
    known = rows.T @ rows + 1e-9 * jnp.eye(begin.size)
    spread = jnp.sqrt(jnp.diagonal(jnp.linalg.inv(known))[:-1])
    return CameraStep(solution[:-1].reshape(-1, 6), spread.reshape(-1, 6))
