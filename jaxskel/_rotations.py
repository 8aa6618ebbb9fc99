"""Rotations as matrices: the exponential map for the solver, alignment of directions for initial poses."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def exponential(vector: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """Rotation about `vector` by its length (rad): Rodrigues' formula, smooth at zero."""
    squared = (vector * vector).sum(-1)[..., None, None]
    small = squared < 1e-8
    # Where the series is used the closed form is fed a harmless 1, so that no gradient is NaN.
    angle = jnp.sqrt(jnp.where(small, 1.0, squared))
    sine = jnp.where(small, 1 - squared / 6, jnp.sin(angle) / angle)
    cosine = jnp.where(small, 0.5 - squared / 24, (1 - jnp.cos(angle)) / (angle * angle))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = jnp.zeros_like(x)
    cross = jnp.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*vector.shape[:-1], 3, 3)
    identity = jnp.broadcast_to(jnp.eye(3, dtype=vector.dtype), cross.shape)
    return identity + sine * cross + cosine * (cross @ cross)


def turn_about(axis: Float[np.ndarray, "n 3"], angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotation about unit axes by angles (rad)."""
    x, y, z = axis.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], 1).reshape(-1, 3, 3)
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def aligning(
    start: Float[np.ndarray, "*batch 3"], goal: Float[np.ndarray, "*batch 3"]
) -> Float[np.ndarray, "*batch 3 3"]:
    """The smallest rotation that turns each unit vector `start` to the unit vector `goal`."""
    axis = np.cross(start, goal)
    cosine = (start * goal).sum(-1)
    opposite = cosine < -1 + 1e-6
    # For opposite vectors every perpendicular axis will do: take the one farthest from the vector's largest part.
    other = np.eye(3)[np.argmin(np.abs(start), -1)]
    perpendicular = np.cross(start, other)
    perpendicular /= np.linalg.norm(perpendicular, axis=-1, keepdims=True)
    half_turn = 2 * perpendicular[..., :, None] * perpendicular[..., None, :] - np.eye(3)
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*axis.shape[:-1], 3, 3)
    scale = (1 / np.maximum(1 + cosine, 1e-6))[..., None, None]
    return np.where(opposite[..., None, None], half_turn, np.eye(3) + cross + cross @ cross * scale)


def frame(up: Float[np.ndarray, "*batch 3"], left: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Rotation with columns (front, left, up): `up` is kept, `left` made perpendicular to it."""
    z = up / np.maximum(np.linalg.norm(up, axis=-1, keepdims=True), 1e-9)
    x = np.cross(left, z)
    x /= np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, np.cross(z, x), z], -1)
