"""Term that attracts bones to the skeletal graph, where Pinocchio uses the medial surface (Sect. 3.3)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import JOINT_NAMES, JOINT_PARENTS
from ...matching import L_FOOT, L_HAND, R_FOOT, R_HAND
from ._base import AbstractTerm, Observed, PlacedBody, number

# The attracted bones, by the joint at their end, and the path each belongs to. Hips and shoulders lie beside the
# centre-line. Head and trunk use a path to a foot, because paths to a hand may leave the trunk early.
_ATTRACTED = {
    "neck": L_FOOT, "head": L_FOOT, "l_elbow": L_HAND, "l_hand": L_HAND, "r_elbow": R_HAND, "r_hand": R_HAND,
    "l_knee": L_FOOT, "l_foot": L_FOOT, "r_knee": R_FOOT, "r_foot": R_FOOT,
}  # fmt: skip
# 32 bits, here and below, because JAX mixes up wider constants when float64 is switched on after the first use.
_ENDS = np.array([JOINT_NAMES.index(name) for name in _ATTRACTED], np.int32)
_BONES = np.stack([np.array(JOINT_PARENTS, np.int32)[_ENDS], _ENDS], 1)
_PATHS = np.array(list(_ATTRACTED.values()), np.int32)
# Positions of samples along the bone. The bone from knee to ball of foot leaves the centre-line, which bends at the
# ankle, so only its upper part is sampled.
_PLACES = np.stack([np.linspace(0.0, 0.4, 5) if name.endswith("foot") else np.linspace(0.2, 1.0, 5)
                    for name in _ATTRACTED]).astype(np.float32)  # fmt: skip


class GraphAttraction(AbstractTerm):
    """Samples on each bone minus the closest point of that limb's path, with a robust weight (Geman-McClure).

    Attributes:
        scale: Distance (m) beyond which a sample has little weight.
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=number, default=0.1)

    def correspond(
        self, body: PlacedBody, observed: Observed
    ) -> tuple[Float[Array, "bones=10 2 2"], Float[Array, "bones=10 2 3"], Float[Array, " bones=10"]]:
        """Closest point and robust weight of each sample, condensed for `residual`: see `_condensed`."""
        places, ends = _PLACES, body.joints[_BONES]
        samples = (1 - places)[..., None] * ends[:, :1] + places[..., None] * ends[:, 1:]
        paths = observed.paths[_PATHS]
        start, along = paths[:, None, :-1], (paths[:, 1:] - paths[:, :-1])[:, None]
        squared = jnp.maximum((along * along).sum(-1), 1e-12)
        part = jnp.clip(((samples[:, :, None] - start) * along).sum(-1) / squared, 0.0, 1.0)
        points = start + part[..., None] * along
        distance = ((samples[:, :, None] - points) ** 2).sum(-1)
        nearest = jnp.argmin(distance, -1)[..., None]
        closest = jnp.take_along_axis(points, nearest[..., None], 2)[:, :, 0]
        robust = 1 / (1 + jnp.take_along_axis(distance, nearest, 2)[..., 0] / self.scale**2)
        # The root makes the squared norm a mean over the samples of a bone.
        weights = robust * observed.found[_PATHS][:, None] / np.sqrt(_PLACES.shape[1])
        return _condensed(weights[..., None] * jnp.stack([1 - places, places], -1), weights[..., None] * closest)

    def residual(
        self,
        body: PlacedBody,
        observed: Observed,
        fixed: tuple[Float[Array, "bones=10 2 2"], Float[Array, "bones=10 2 3"], Float[Array, " bones=10"]],
    ) -> Float[Array, "bones=10 7"]:
        """Seven numbers for each bone; their norm is that of the weighted distances of its samples (m)."""
        triangle, goals, rest = fixed
        off = (triangle @ body.joints[_BONES] - goals).reshape(-1, 6)
        return jnp.concatenate([off, rest[:, None]], -1)


def _condensed(
    shares: Float[Array, "bones samples 2"], goals: Float[Array, "bones samples 3"]
) -> tuple[Float[Array, "bones 2 2"], Float[Array, "bones 2 3"], Float[Array, " bones"]]:
    """A QR decomposition: ``|shares @ ends - goals|`` is ``|triangle @ ends - q^T goals|`` and a constant rest.

    The samples are linear in the bone's two ends, so any number of samples reduces to two rows.
    """
    first, second = shares[..., 0], shares[..., 1]
    length = _norm(first)
    one = first / jnp.maximum(length, 1e-12)[:, None]
    common = (one * second).sum(-1)
    across = second - common[:, None] * one
    width = _norm(across)
    two = across / jnp.maximum(width, 1e-12)[:, None]
    triangle = jnp.stack([jnp.stack([length, common], -1), jnp.stack([jnp.zeros_like(width), width], -1)], 1)
    basis = jnp.stack([one, two], 1)
    found = basis @ goals
    return triangle, found, _norm((goals - basis.swapaxes(1, 2) @ found).reshape(len(goals), -1))


def _norm(rows: Float[Array, "bones n"]) -> Float[Array, " bones"]:
    """Lengths, with a finite derivative at zero."""
    squared = (rows * rows).sum(-1)
    return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
