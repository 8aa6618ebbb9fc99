"""One step of the refinement of a rig: residuals that are linear in the unknowns, and a prior."""

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ._coherence import NOTHING, Sensitivity
from ._kept import kept

# Noise (px, standard deviation) that even the outlines of clean masks have, from their pixels.
_LEAST_NOISE = 0.25
# Of normal noise: what the median of its absolute values must be multiplied by.
_FROM_MEDIAN = 1.48
# Residuals of this many standard deviations begin to count less: there the mask is wrong, not the camera.
_TAIL = 3.0
# Errors of masks, and depths, are alike along a limb: so many rays of it count as one measurement.
_ALIKE = 12.0
_STEPS = 6
"""Of Newton's method: the density is no parabola."""


class Pull(eqx.Module):
    """Where the residuals of rays are drawn to."""

    slope: Float[Array, " rays"]
    """Of the logarithm of how probable they are (1/px)."""
    curvature: Float[Array, " rays"]
    """Its negative second derivative, or less, but not below zero (1/px^2)."""


@runtime_checkable
class Evidence(Protocol):
    """What the residuals of rays say."""

    def pull(self, residuals: Float[Array, " rays"]) -> Pull:
        """At some residuals (px)."""
        ...


class OneSided(eqx.Module):
    """Only what is positive is evidence: a ray may run deep through a wide hull.

    What rays miss by less than the noise of outlines that are made of pixels is no evidence either. As noise does not
    cancel here, the rig would be bent until no ray missed by it.
    """

    noise: Float[Array | np.ndarray, ""]
    """Standard deviation (px), see `noise_of`."""

    def pull(self, residuals: Float[Array, " rays"]) -> Pull:
        """With Geman and McClure's weights."""
        weight = _weight(residuals, jnp.asarray(self.noise)) ** 2
        missed = jnp.maximum(residuals - _LEAST_NOISE, 0.0)
        return Pull(-weight * missed, jnp.where(missed > 0, weight, 0.0))


class CameraStep(eqx.Module):
    """Where a step leads, in units of the prior's standard deviations."""

    unknowns: Float[Array, "cams 6"]
    """Rotation vectors and shifts, from the rig as it was given."""
    spread: Float[Array, "cams 6"]
    """Their standard deviations by the outlines and the prior together: 1 where outlines say nothing."""


def noise_of(residuals: Float[Array | np.ndarray, " planes"]) -> float:
    """Standard deviation of outlines (px) that residuals show, most of which are noise at the end."""
    return max(_LEAST_NOISE, _FROM_MEDIAN * float(np.median(residuals))) if np.size(residuals) else _LEAST_NOISE


@kept
def camera_step(
    rays: Sensitivity,
    tangents: Sensitivity,
    now: Float[Array | np.ndarray, "cams 6"],
    units: Float[Array | np.ndarray, "6"],
    evidence: Evidence,
    noise: Float[Array | np.ndarray, ""],
) -> CameraStep:
    """The rig that is most probable: by its rays, its planes, which err on either side, and the prior.

    Args:
        rays: Residuals of the rig as it is now.
        tangents: Residuals that are evidence in either direction.
        now: The rig's unknowns.
        units: The prior's standard deviations of the unknowns of a camera (rad and m).
        evidence: What the rays' residuals say: a `Frontier`, or `OneSided`.
        noise: Of the planes, see `noise_of`.
    """
    start = jnp.asarray(now).reshape(-1)
    through = (rays.slopes * units[None, None]).reshape(len(rays.value), -1)
    told = jnp.where(rays.value > NOTHING, 1 / _ALIKE, 0.0)

    # The planes of a view with each of the others touch about the same place of its outline, and err together.
    weight = _weight(tangents.value, jnp.asarray(noise)) / np.sqrt(max(_ALIKE, len(now) - 1.0))
    touching = (tangents.slopes * units[None, None]).reshape(len(tangents.value), -1) * weight[:, None]
    apart = tangents.value * weight
    known = touching.T @ touching + jnp.eye(start.size)

    def newton(_: Int[Array, ""], state: tuple[Array, Array]) -> tuple[Array, Array]:
        unknowns, _ = state
        change = unknowns - start
        pulled = evidence.pull(rays.value + through @ change)
        matrix = known + (through * (told * pulled.curvature)[:, None]).T @ through
        down = through.T @ (told * pulled.slope) - touching.T @ (apart + touching @ change) - unknowns
        return unknowns + jnp.linalg.solve(matrix, down), matrix

    unknowns, matrix = jax.lax.fori_loop(0, _STEPS, newton, (start, known))
    return CameraStep(unknowns.reshape(-1, 6), jnp.sqrt(jnp.diagonal(jnp.linalg.inv(matrix))).reshape(-1, 6))


def _weight(residuals: Float[Array | np.ndarray, " some"], noise: Float[Array, ""]) -> Float[Array, " some"]:
    """Geman and McClure's: one over the noise, and less where residuals are out of proportion to it (1/px)."""
    return 1 / (1 + (jnp.asarray(residuals) / (_TAIL * noise)) ** 2) / noise
