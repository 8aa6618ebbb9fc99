"""Prior of arms: how people hold them, as a Gaussian mixture over the directions of upper arm and forearm.

In a coat, or seen by few cameras, a hand behind the back explains the silhouettes as well as one that hangs. A table of
how people hold their arms then decides, as far as the silhouettes do not.
"""

from functools import cache
from importlib.resources import files
from math import log

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._math.rotations import cross, dot
from ...body import JOINT_NAMES
from ._base import AbstractTerm, Observed, PlacedBody, number

_PELVIS, _NECK = (JOINT_NAMES.index(name) for name in ("pelvis", "neck"))
_SHOULDERS, _ELBOWS, _HANDS = (
    np.array([JOINT_NAMES.index(f"{side}_{name}") for side in "lr"], np.int32) for name in ("shoulder", "elbow", "hand")
)
_MIRRORS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]], np.float32)
_SMALL = 1e-9
# Standard deviation of each Gaussian (radius of the unit sphere), and share of arms that are held in no usual way. Of
# 224 hands of seven people in clothes (crowd p00 to p07, with a table of other people and clips), 52 were wrong without
# a prior, 35 with half of its weight, 27 with 256 postures; 64 postures of width 0.45 were a little worse.
_WIDTH, _UNUSUAL = 0.3, 0.05
_AT_ONCE = 128  # postures of a table
# Added below the root, whose slope must not be infinite at the most usual posture.
_LEAST = 1e-6


class ArmPrior(AbstractTerm):
    """How much less usual the posture of each arm is than the most usual one. See [`usual_arms`][].

    Attributes:
        means: Directions of upper arm and forearm as two unit vectors: front, left, up, of a left arm. Up is from
            pelvis to neck, left from shoulder to shoulder.
        log_shares: Logarithm of the share of each.
        top: Largest logarithm of the density.
    """

    needs_graph = False

    means: Float[Array | np.ndarray, "postures 6"]
    log_shares: Float[Array | np.ndarray, " postures"]
    top: Float[Array | np.ndarray, ""]
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "arms=2"]:
        """Root of the difference of the logarithms of the densities, of the left and of the right arm."""
        directions = arm_directions(body.joints)
        density = _log_density(directions, jnp.asarray(self.means), jnp.asarray(self.log_shares))
        return jnp.sqrt(jnp.maximum(self.top - density, 0.0) + _LEAST)

    def posture_costs(
        self, limb: str, directions: Float[np.ndarray, "postures 6"]
    ) -> Float[np.ndarray, " postures"] | None:
        """Difference of the logarithms of the densities, for arms."""
        if limb != "arm":
            return None
        means, shares = np.asarray(self.means), np.asarray(self.log_shares)
        # Small parts: memory for all at once is new each time, and takes three times as long as the rest.
        parts = (directions[start : start + _AT_ONCE] for start in range(0, len(directions), _AT_ONCE))
        densities = [_with_slope(part.astype(np.float32), means, shares)[0] for part in parts]
        return np.maximum(float(self.top) - np.concatenate([np.zeros(0), *densities]), 0.0)

    def with_prior(self, factor: float) -> "ArmPrior":
        """The same term with `factor` times the weight."""
        return eqx.tree_at(lambda t: t.weight, self, self.weight * factor)


def arm_prior(
    directions: Float[np.ndarray, "postures 6"], shares: Float[np.ndarray, " postures"], weight: float = 1.0
) -> ArmPrior:
    """Make the prior from example postures.

    Args:
        directions: Of upper arm and forearm, see [`arm_directions`][].
        shares: Share of each.
        weight: Weight of the term.
    """
    means, log_shares = directions.astype(np.float32), np.log(shares / shares.sum()).astype(np.float32)
    top = np.max(_with_slope(means, means, log_shares)[0])
    return ArmPrior(means=means, log_shares=log_shares, top=np.asarray(top), weight=number(weight))


def usual_arms(weight: float = 1.0) -> ArmPrior:
    """How people hold their arms, by clips of the CMU database, see ``benchmarks/arm_postures.py``.

    Args:
        weight: Weight of the term.
    """
    return eqx.tree_at(lambda t: t.weight, _usual_arms(), number(weight))


@cache
def _usual_arms() -> ArmPrior:
    lines = files("jaxskel.refinement.terms").joinpath("arm_postures.csv").read_text(encoding="utf-8").splitlines()
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    return arm_prior(rows[:, 1:], rows[:, 0])


def arm_directions(joints: Float[Array | np.ndarray, "*frames joints=15 3"]) -> Float[Array, "*frames arms=2 6"]:
    """Directions of upper arm and forearm, as of a left arm: two unit vectors, relative to the trunk.

    Args:
        joints: In the order of `JOINT_NAMES` (m).
    """
    joints = jnp.asarray(joints)
    up = _unit(joints[..., _NECK, :] - joints[..., _PELVIS, :])
    across = joints[..., _SHOULDERS[0], :] - joints[..., _SHOULDERS[1], :]
    left = _unit(across - dot(across, up)[..., None] * up)
    trunk = [axis[..., None, :] for axis in (cross(left, up), left, up)]
    upper = _unit(joints[..., _ELBOWS, :] - joints[..., _SHOULDERS, :])
    lower = _unit(joints[..., _HANDS, :] - joints[..., _ELBOWS, :])
    mirrors = _MIRRORS.reshape((1,) * (upper.ndim - 2) + _MIRRORS.shape)
    turned = [jnp.stack([dot(axis, bone) for axis in trunk], -1) * mirrors for bone in (upper, lower)]
    return jnp.concatenate(turned, -1)


@jax.custom_jvp
def _log_density(
    directions: Float[Array, "*arms 6"], means: Float[Array, "postures 6"], log_shares: Float[Array, " postures"]
) -> Float[Array, "*arms"]:
    """Logarithm of the density of postures, relative to arms that point anywhere alike."""
    return jnp.asarray(_with_slope(directions, means, log_shares)[0])


@_log_density.defjvp
def _(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    # The slope once, in place of a product with all postures for each of some forty unknowns. The table is constant.
    density, slope = _with_slope(*primals)
    return jnp.asarray(density), (slope * tangents[0]).sum(-1)


def _with_slope(
    directions: Float[Array | np.ndarray, "*arms 6"],
    means: Float[Array | np.ndarray, "postures 6"],
    log_shares: Float[Array | np.ndarray, " postures"],
) -> tuple[Float[Array | np.ndarray, "*arms"], Float[Array | np.ndarray, "*arms 6"]]:
    """The logarithm of the density, and its slope by the directions."""
    xp = np if isinstance(directions, np.ndarray) else jnp
    broad = (1,) * (directions.ndim - 1) + (-1,)
    squared = (directions**2).sum(-1, keepdims=True) - 2 * directions @ means.T + (means**2).sum(-1).reshape(broad)
    # Relative to the uniform density, 1 / (4 pi)^2.
    each = log_shares.reshape(broad) - squared / (2 * _WIDTH**2) + log((1 - _UNUSUAL) * 4 / _WIDTH**4)
    most = xp.maximum(each.max(-1), log(_UNUSUAL))
    parts = xp.exp(each - most[..., None])
    total = parts.sum(-1) + _UNUSUAL * xp.exp(-most)
    slope = (parts @ means - parts.sum(-1, keepdims=True) * directions) / (_WIDTH**2 * total[..., None])
    return xp.log(total) + most, slope


def _unit(vectors: Float[Array, "*each 3"]) -> Float[Array, "*each 3"]:
    return vectors / jnp.sqrt(dot(vectors, vectors) + _SMALL)[..., None]
