"""Levenberg-Marquardt for frames that are coupled to their neighbours in time; cost is linear in their number.

A frame's residuals depend on its own unknowns, a coupling's on those of three consecutive frames. So the normal matrix
is block-banded, and one Cholesky factorisation along the band solves it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from ._levenberg_marquardt import AbstractEquations, NormalEquationsLM, not_zero

# A coupling involves a frame, the one before and the one after.
_REACH = 3


class Coupled(eqx.Module):
    """Residuals of a sequence, of frames and of couplings between them.

    Attributes:
        frames: Residuals of each single frame.
        couplings: Residuals of each three consecutive frames; empty with fewer than three.
    """

    frames: PyTree[Float[Array, "frames ..."]]
    couplings: PyTree[Float[Array, "couplings ..."]]


class BandedEquations(AbstractEquations):
    """Normal equations of `Coupled` residuals, unknowns ``frames x unknowns``: blocks on and above the diagonal.

    Attributes:
        next: Blocks between each frame and the next.
        second: Blocks between each frame and the next but one.
    """

    own: Float[Array, "frames unknowns unknowns"]
    next: Float[Array, "frames unknowns unknowns"]
    second: Float[Array, "frames unknowns unknowns"]
    gradient: Float[Array, "frames unknowns"]

    @classmethod
    def of(
        cls, y: Float[Array, "frames unknowns"], residual: Coupled, slope: Callable[[Any], Coupled]
    ) -> "BandedEquations":
        """Form the equations at `y`; `slope` maps a change v of `y` to the change of the residuals (``J v``)."""
        frames, count = y.shape
        units = jnp.eye(count, dtype=y.dtype)
        # One unknown of all frames at once: a frame's own residuals do not depend on other frames.
        every = jax.vmap(lambda unit: slope(jnp.broadcast_to(unit, y.shape)).frames)(units)
        own, gradient = jnp.zeros((*y.shape, count), y.dtype), jnp.zeros_like(y)
        found = cls(own, own, own, gradient)
        for columns, value in _leaves(every, residual.frames, frames):
            own = own + jnp.einsum("ufr,vfr->fuv", columns, columns)
            gradient = gradient + jnp.einsum("ufr,fr->fu", columns, value)
        found = cls(own, found.next, found.second, gradient)
        if frames < _REACH or not jax.tree.leaves(residual.couplings):
            return found
        # One unknown of every third frame at once: a coupling depends on only one of these frames.
        turn = jnp.arange(frames, dtype=jnp.int32) % _REACH
        colours = jnp.arange(_REACH, dtype=jnp.int32)[:, None] == turn[None]
        probe = jax.vmap(lambda unit: slope(unit).couplings)
        third = jax.vmap(lambda colour: probe(units[:, None, :] * colour[None, :, None]))(colours.astype(y.dtype))
        for columns, value in _leaves(third, residual.couplings, frames - 2):
            found = _coupled(found, columns, value)
        return found

    def applied(self, change: Float[Array, "frames unknowns"]) -> Float[Array, "frames unknowns"]:
        """``J^T J`` times a change of the unknowns."""
        result = jnp.einsum("fuv,fv->fu", self.own, change)
        for blocks, apart in ((self.next, 1), (self.second, 2)):
            between = blocks[: max(0, len(change) - apart)]
            result = result.at[:-apart].add(jnp.einsum("fuv,fv->fu", between, change[apart:]))
            result = result.at[apart:].add(jnp.einsum("fuv,fu->fv", between, change[:-apart]))
        return result

    def step(self, step_size: Any) -> Float[Array, "frames unknowns"]:
        """The step for a damping of ``1 / step_size``."""
        damping = jnp.eye(self.own.shape[1], dtype=self.own.dtype) / not_zero(step_size, self.own)
        return -solve_banded(eqx.tree_at(lambda s: s.own, self, self.own + damping[None]))


def _leaves(columns: Any, residuals: Any, count: int) -> list[tuple[Array, Array]]:
    """Columns of the Jacobian and residuals, with the axes ``... count rows`` and ``count rows``."""
    return [
        (column.reshape(*column.shape[: column.ndim - residual.ndim], count, -1), residual.reshape(count, -1))
        for column, residual in zip(jax.tree.leaves(columns), jax.tree.leaves(residuals), strict=True)
    ]


def _coupled(
    found: BandedEquations, columns: Float[Array, "3 unknowns couplings rows"], residual: Float[Array, "couplings rows"]
) -> BandedEquations:
    """Add the contribution of couplings, each of three frames."""
    number = np.arange(len(residual), dtype=np.int32)
    # Jacobian by the first, second and third frame of each coupling: 3 x couplings x unknowns x rows.
    parts = [columns[(number + place) % _REACH, :, number] for place in range(_REACH)]
    own, after, second, gradient = found.own, found.next, found.second, found.gradient
    for place, part in enumerate(parts):
        own = own.at[number + place].add(jnp.einsum("kur,kvr->kuv", part, part))
        gradient = gradient.at[number + place].add(jnp.einsum("kur,kr->ku", part, residual))
    for place in range(2):
        after = after.at[number + place].add(jnp.einsum("kur,kvr->kuv", parts[place], parts[place + 1]))
    second = second.at[number].add(jnp.einsum("kur,kvr->kuv", parts[0], parts[2]))
    return BandedEquations(own, after, second, gradient)


def solve_banded(equations: BandedEquations) -> Float[Array, "frames unknowns"]:
    """Solve ``matrix x = gradient`` by block Cholesky factorisation, two frames a block."""
    frames, count = equations.gradient.shape
    if frames % 2:
        # Pad with one frame that is not coupled to the others.
        equations = jax.tree.map(lambda a: jnp.concatenate([a, jnp.zeros_like(a[:1])]), equations)
        extra = jnp.eye(count, dtype=equations.own.dtype)
        equations = eqx.tree_at(lambda e: e.own, equations, equations.own.at[-1].set(extra))
    even, odd = (jax.tree.map(lambda a, s=s: a[s::2], equations) for s in (0, 1))
    diagonal = _square(even.own, even.next, even.next.swapaxes(1, 2), odd.own)
    # Blocks between each pair and the one before it.
    back = _square(even.second, jnp.zeros_like(even.second), odd.next, odd.second).swapaxes(1, 2)
    back = jnp.concatenate([jnp.zeros_like(back[:1]), back[:-1]])
    right = jnp.concatenate([even.gradient, odd.gradient], 1)
    eye = jnp.eye(2 * count, dtype=right.dtype)

    def forward(carry: Any, pair: Any) -> Any:
        inverse, value = carry
        own, behind, wanted = pair
        lower = behind @ inverse.T
        factor = jnp.linalg.cholesky(own - lower @ lower.T)
        inverse = jax.scipy.linalg.solve_triangular(factor, eye, lower=True)
        value = inverse @ (wanted - lower @ value)
        return (inverse, value), (inverse, lower, value)

    _, (inverses, lowers, values) = jax.lax.scan(forward, (eye, jnp.zeros_like(right[0])), (diagonal, back, right))

    def backward(after: Any, pair: Any) -> Any:
        pull, (inverse, lower, value) = after, pair
        found = inverse.T @ (value - pull)
        return lower.T @ found, found

    _, found = jax.lax.scan(backward, jnp.zeros_like(right[0]), (inverses, lowers, values), reverse=True)
    return found.reshape(-1, count)[:frames]


def _square(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Stack of block matrices ``[[a, b], [c, d]]``."""
    return jnp.concatenate([jnp.concatenate([a, b], 2), jnp.concatenate([c, d], 2)], 1)


def for_sequences(solver: Any) -> Any:
    """The solver with the band of blocks instead of a dense matrix, if it is one of this package; else unchanged."""
    if isinstance(solver, NormalEquationsLM):
        return replace(solver, equations=BandedEquations)
    return solver


def sequence_solver() -> NormalEquationsLM:
    """Levenberg-Marquardt for `refine_sequence`, with tolerances of 3 mm or 3 mrad."""
    return NormalEquationsLM(rtol=1e-2, atol=3e-3, equations=BandedEquations)
