"""Probabilities of isotropic Gaussians in space."""

import numpy as np
from jaxtyping import Float
from scipy.special import erf, gammaincinv


def probability_within(
    radius: float, offset: Float[np.ndarray, "*batch"], deviation: Float[np.ndarray, "*batch"]
) -> Float[np.ndarray, "*batch"]:
    """Probability that a point is within `radius` of the origin.

    Args:
        radius: In any unit of length.
        offset: Distance of the Gaussian's mean from the origin.
        deviation: Standard deviation along each axis, greater than zero.
    """
    # Below this offset, the closed form divides two tiny numbers; the value hardly depends on the offset there.
    offset = np.maximum(offset, 1e-3 * deviation)
    low, high = (radius - offset) / deviation, (radius + offset) / deviation
    shell = (np.exp(-(low**2) / 2) - np.exp(-(high**2) / 2)) * deviation / (offset * np.sqrt(2 * np.pi))
    return np.clip((erf(low / np.sqrt(2)) + erf(high / np.sqrt(2))) / 2 - shell, 0.0, 1.0)


def deviation_for(radius: float, probability: Float[np.ndarray, "*batch"]) -> Float[np.ndarray, "*batch"]:
    """Standard deviation along each axis of a Gaussian around the origin that is within `radius` with a probability."""
    return radius / np.sqrt(2 * gammaincinv(1.5, probability))  # chi-squared with three degrees of freedom
