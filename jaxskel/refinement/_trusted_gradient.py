"""Gradients of a solve: NaN where it has not converged, because they would be wrong there."""

from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, Bool, Float

# The implicit function theorem holds at a minimum only: elsewhere derivatives were wrong by factors of 3 to 42.
# A primitive, because the transpose of no other linear map keeps a zero apart: 0 times NaN is NaN.
_trusted = Primitive("trusted_gradient")


@jax.custom_jvp
def trusted_gradient(value: Float[Array, "*shape"], converged: Bool[Array, ""]) -> Float[Array, "*shape"]:
    """The value itself; where the solve has not converged, its derivatives are NaN instead of wrong.

    A loss that leaves such a frame out, ``jnp.where(converged, loss, 0.0)``, has the right gradient.
    """
    return value


@trusted_gradient.defjvp
def _(primals: tuple[Any, Any], tangents: tuple[Any, Any]) -> tuple[Array, Array]:
    value, converged = primals
    return value, _trusted.bind(tangents[0], jnp.broadcast_to(converged, value.shape))


def _value(change: Array, converged: Array) -> Array:
    return jnp.where(converged | (change == 0), change, jnp.full_like(change, jnp.nan))


def _transposed(cotangent: Any, change: Any, converged: Array) -> list[Any]:
    return [cotangent if type(cotangent) is ad.Zero else _trusted.bind(cotangent, converged), None]


_trusted.def_impl(_value)
_trusted.def_abstract_eval(lambda change, converged: change)
mlir.register_lowering(_trusted, mlir.lower_fun(_value, multiple_results=False))
batching.primitive_batchers[_trusted] = lambda given, axes: (
    _trusted.bind(*(_moved(each, axis, given, axes) for each, axis in zip(given, axes, strict=True))), 0,
)  # fmt: skip
ad.primitive_jvps[_trusted] = lambda primals, tangents: (
    _trusted.bind(*primals),
    tangents[0] if type(tangents[0]) is ad.Zero else _trusted.bind(tangents[0], primals[1]),
)
ad.primitive_transposes[_trusted] = _transposed


def _moved(each: Array, axis: int | None, given: tuple[Array, ...], axes: tuple[int | None, ...]) -> Array:
    """An argument with the batch axis first."""
    if axis is not None:
        return jnp.moveaxis(each, axis, 0)
    size = next(other.shape[own] for other, own in zip(given, axes, strict=True) if own is not None)
    return jnp.broadcast_to(each[None], (size, *each.shape))
