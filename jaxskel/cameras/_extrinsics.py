"""Small changes of extrinsics as unknowns: each camera rotates about its optical centre, and the centre moves."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._math.rotations import turned
from ._cameras import Cameras


class ExtrinsicChange(eqx.Module):
    """Rotation and shift of each camera of a rig.

    Attributes:
        rotation: Rotation vectors in the frame of each camera (rad): the new rotation is ``exp(rotation) R``.
        shift: Shifts of the optical centres, in the world (m).
    """

    rotation: Float[Array | np.ndarray, "cams 3"]
    shift: Float[Array | np.ndarray, "cams 3"]


def no_change(cameras: Cameras) -> ExtrinsicChange:
    """The change that leaves all cameras as they are."""
    return ExtrinsicChange(np.zeros((len(cameras), 3)), np.zeros((len(cameras), 3)))


def optical_centres(cameras: Cameras) -> Float[Array, "cams 3"]:
    """Optical centres in the world (m), also of traced cameras."""
    return -jnp.einsum("cji,cj->ci", jnp.asarray(cameras.R), jnp.asarray(cameras.t))


def changed(cameras: Cameras, change: ExtrinsicChange) -> Cameras:
    """The rig after a change, with the same intrinsics. Differentiable with respect to the change."""
    rotations = turned(jnp.asarray(change.rotation), cameras.R)
    centres = optical_centres(cameras) + jnp.asarray(change.shift)
    return eqx.tree_at(lambda c: (c.R, c.t), cameras, (rotations, -jnp.einsum("cij,cj->ci", rotations, centres)))
