"""Gradients of a solve: NaN where it has not converged, because they would be wrong there."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, Bool, Float, PyTree

# The implicit function theorem holds at a minimum only: elsewhere derivatives were wrong by factors of 3 to 42.
# Zero where the solve has converged or nothing changes, else NaN. A primitive, because the transpose of no other linear
# map keeps a zero apart: 0 times NaN is NaN.
_alarm = Primitive("alarm")
# Inputs are summed with different weights, so that changes that cancel out are no less a change.
_WEIGHTS = 97


def trusted_gradient(value: PyTree, converged: Bool[Array, ""], inputs: PyTree) -> PyTree:
    """The value itself; where the solve has not converged, its derivatives by the inputs are NaN instead of wrong.

    A loss that leaves such a frame out, ``jnp.where(converged, loss, 0.0)``, has the right gradient. NaN goes around
    the solve, because the linear solver of its derivative refuses NaN with an error.

    Args:
        value: What the solve has found.
        converged: Whether it has converged.
        inputs: What the solve depends on.
    """
    numbers = [leaf for leaf in jax.tree.leaves(inputs) if eqx.is_inexact_array(leaf)]  # others may be functions
    source = sum((_weighted(leaf) for leaf in numbers), jnp.zeros(()))
    return jax.tree.map(lambda found: _trusted(found, converged, source), value)


def _weighted(leaf: Any) -> Float[Array, ""]:
    flat = jnp.ravel(jnp.asarray(leaf))
    return (flat * (1 + jnp.arange(flat.size, dtype=jnp.int32) % _WEIGHTS).astype(flat.dtype)).sum()


@jax.custom_jvp
def _trusted(value: Float[Array, "*shape"], converged: Bool[Array, ""], source: Float[Array, ""]) -> Any:
    return value


@_trusted.defjvp
def _(primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Array, Array]:
    value, converged, _ = primals
    change, _, source = tangents
    everywhere = jnp.broadcast_to(converged, value.shape)
    alarm = _alarm.bind(jnp.broadcast_to(source.astype(value.dtype), value.shape), everywhere)
    return value, jnp.where(everywhere, change, jnp.zeros_like(change)) + alarm


def _raised(change: Array, converged: Array) -> Array:
    return jnp.where(converged | (change == 0), jnp.zeros_like(change), jnp.full_like(change, jnp.nan))


def _transposed(cotangent: Any, change: Any, converged: Array) -> list[Any]:
    return [cotangent if type(cotangent) is ad.Zero else _alarm.bind(cotangent, converged), None]


_alarm.def_impl(_raised)
_alarm.def_abstract_eval(lambda change, converged: change)
mlir.register_lowering(_alarm, mlir.lower_fun(_raised, multiple_results=False))
batching.primitive_batchers[_alarm] = lambda given, axes: (
    _alarm.bind(*(_moved(each, axis, given, axes) for each, axis in zip(given, axes, strict=True))), 0,
)  # fmt: skip
ad.primitive_jvps[_alarm] = lambda primals, tangents: (
    _alarm.bind(*primals),
    tangents[0] if type(tangents[0]) is ad.Zero else _alarm.bind(tangents[0], primals[1]),
)
ad.primitive_transposes[_alarm] = _transposed


def _moved(each: Array, axis: int | None, given: tuple[Array, ...], axes: tuple[int | None, ...]) -> Array:
    """An argument with the batch axis first."""
    if axis is not None:
        return jnp.moveaxis(each, axis, 0)
    size = next(other.shape[own] for other, own in zip(given, axes, strict=True) if own is not None)
    return jnp.broadcast_to(each[None], (size, *each.shape))
