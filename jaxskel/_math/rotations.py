"""Rotation matrices: the exponential map for the solver, alignment of directions for initial poses."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

# Below this squared angle (rad^2), power series replace the closed forms, which divide by the angle.
_SERIES = 1e-8


@jax.custom_jvp
def turned(
    vector: Float[Array, "*batch 3"], rotation: Float[Array | np.ndarray, "*batch 3 3"]
) -> Float[Array, "*batch 3 3"]:
    """A rotation followed by one about `vector` by its length (rad): Rodrigues' formula, smooth at zero.

    The derivative is an angular velocity times the result. Solvers push many tangents through this function; the custom
    rule costs a tenth of differentiating the formula.
    """
    sine, cosine, _ = _coefficients(vector)
    columns = (jnp.asarray(rotation[..., column]) for column in range(3))
    once = ((column, cross(vector, column)) for column in columns)
    return jnp.stack([column + sine * turn + cosine * cross(vector, turn) for column, turn in once], -1)


@partial(turned.defjvp, symbolic_zeros=True)
def _turned_tangent(primals: Any, tangents: Any) -> tuple[Array, Array]:
    (vector, rotation), (change, rotation_change) = primals, tangents
    result = turned(vector, rotation)
    tangent = jnp.zeros_like(result)
    if not isinstance(change, SymbolicZero):
        # Derivative of each element of the result by each component of the vector, shared by all tangents.
        generators = jnp.einsum("kij,...jl->...kil", _GENERATORS, result)
        effects = jnp.einsum("...ka,...kil->...ila", left_jacobian(vector), generators)
        tangent = tangent + jnp.einsum("...ila,...a->...il", effects, change)
    if not isinstance(rotation_change, SymbolicZero):
        tangent = tangent + turned(vector, rotation_change)
    return result, tangent


def exponential(vector: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """Rotation about `vector` by its length (rad)."""
    return turned(vector, jnp.broadcast_to(jnp.eye(3, dtype=vector.dtype), (*vector.shape, 3)))


def cross(one: Float[Array, "..."], other: Float[Array, "..."], axis: int = -1) -> Float[Array, "..."]:
    """Cross products of vectors along an axis, written out: faster than those of JAX, which transpose axes."""
    (a, b, c), (x, y, z) = (
        [jax.lax.index_in_dim(vector, i, axis, keepdims=False) for i in range(3)] for vector in (one, other)
    )
    return jnp.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis)


def dot(one: Float[Array, "..."], other: Float[Array, "..."]) -> Float[Array, "..."]:
    """Inner products of vectors along the last axis, written out: a sum over an axis is a kernel of its own in XLA."""
    return one[..., 0] * other[..., 0] + one[..., 1] * other[..., 1] + one[..., 2] * other[..., 2]


def _coefficients(vector: Float[Array, "*batch 3"]) -> tuple[Float[Array, "*batch 1"], ...]:
    """``sin(a) / a``, ``(1 - cos(a)) / a^2`` and ``(a - sin(a)) / a^3`` of the length a of a vector."""
    squared = dot(vector, vector)[..., None]
    small = squared < _SERIES
    # Where the series is used, the closed form gets the angle 1, so that no gradient is NaN.
    angle = jnp.sqrt(jnp.where(small, 1.0, squared))
    return (
        jnp.where(small, 1 - squared / 6, jnp.sin(angle) / angle),
        jnp.where(small, 0.5 - squared / 24, 2 * (jnp.sin(angle / 2) / angle) ** 2),
        jnp.where(small, 1 / 6 - squared / 120, (angle - jnp.sin(angle)) / angle**3),
    )


def left_jacobian(vector: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """Left Jacobian of SO(3): angular velocity per change of the rotation vector."""
    sine, cosine, rest = (coefficient[..., None] for coefficient in _coefficients(vector))
    skew = _skew(vector, jnp.stack)
    identity = jnp.broadcast_to(jnp.eye(3, dtype=vector.dtype), skew.shape)
    return sine * identity + cosine * skew + rest * vector[..., :, None] * vector[..., None, :]


def _skew(vector: Any, stack: Callable[..., Any] = np.stack) -> Any:
    """The matrix of the cross product with a vector, for NumPy or JAX."""
    x, y, z = (vector[..., i] for i in range(3))
    zero = 0 * x
    return stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*vector.shape, 3)


# Matrices of the cross products with the three axes.
_GENERATORS = _skew(np.eye(3, dtype=np.float32))


def turn_about(axis: Float[np.ndarray, "n 3"], angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotation about unit axes by angles (rad)."""
    cross = _skew(axis)
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def nearest_rotation(matrices: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """The rotation nearest to each matrix, in the sum of squares (Kabsch, Umeyama)."""
    left, _, right = np.linalg.svd(matrices)
    mirrored = np.linalg.det(left @ right) < 0
    left[..., 2] = np.where(mirrored[..., None], -left[..., 2], left[..., 2])
    return left @ right


def aligning(
    start: Float[np.ndarray, "*batch 3"], goal: Float[np.ndarray, "*batch 3"]
) -> Float[np.ndarray, "*batch 3 3"]:
    """The smallest rotation that takes each unit vector `start` to the unit vector `goal`."""
    axis = np.cross(start, goal)
    cosine = (start * goal).sum(-1)
    opposite = cosine < -1 + 1e-6
    # For opposite vectors any perpendicular axis will do: take that of `start` and its smallest component's axis.
    other = np.eye(3)[np.argmin(np.abs(start), -1)]
    perpendicular = np.cross(start, other)
    perpendicular /= np.linalg.norm(perpendicular, axis=-1, keepdims=True)
    half_turn = 2 * perpendicular[..., :, None] * perpendicular[..., None, :] - np.eye(3)
    cross = _skew(axis)
    scale = (1 / np.maximum(1 + cosine, 1e-6))[..., None, None]
    return np.where(opposite[..., None, None], half_turn, np.eye(3) + cross + cross @ cross * scale)


def frame(up: Float[np.ndarray, "*batch 3"], left: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Rotation with columns (front, left, up): `up` is kept, `left` is made perpendicular to it."""
    z = up / np.maximum(np.linalg.norm(up, axis=-1, keepdims=True), 1e-9)
    x = np.cross(left, z)
    x /= np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, np.cross(z, x), z], -1)


def perpendicular(direction: Float[Array, "n 3"]) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Two unit vectors perpendicular to each unit vector and each other (Duff et al. 2017)."""
    x, y, z = direction.T
    sign = jnp.where(z < 0, -1.0, 1.0).astype(z.dtype)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        jnp.stack([1.0 + sign * x * x * a, sign * b, -sign * x], -1),
        jnp.stack([b, sign + y * y * a, -y], -1),
    )
