"""Levenberg-Marquardt for many small problems at once: Optimistix' own, with normal equations made once a step.

The descent of `optimistix.LevenbergMarquardt` solves the damped problem anew for each damping, with the Jacobian and a
square root of the damping below it. For a few dozen unknowns the normal matrix says the same in a fraction of the
memory, and batches of frames are bound by memory.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float


class NormalEquations(eqx.Module):
    """Of one linearised problem: ``J^T J`` and ``J^T r``."""

    matrix: Float[Array, "unknowns unknowns"]
    gradient: Float[Array, " unknowns"]


class DampedNormalDescent(optx.AbstractDescent):
    """The step ``-(J^T J + I / step size)^-1 J^T r``, by Cholesky."""

    def init(self, y: Any, f_info_struct: Any) -> NormalEquations:
        """Nothing is known yet."""
        flat = ravel_pytree(y)[0]
        return NormalEquations(jnp.zeros((flat.size, flat.size), flat.dtype), jnp.zeros_like(flat))

    def query(self, y: Any, f_info: Any, state: NormalEquations) -> NormalEquations:
        """Take in the linearised problem at `y`."""
        flat, unravel = ravel_pytree(y)
        units = jnp.eye(flat.size, dtype=flat.dtype)
        # Unknowns as the last axis: rows of them are long enough for a processor, points and rotations are not.
        columns = jax.vmap(lambda unit: f_info.jac.mv(unravel(unit)), out_axes=-1)(units)
        matrix, gradient = jnp.zeros((flat.size, flat.size), flat.dtype), jnp.zeros_like(flat)
        # Residuals one after the other: put into one matrix first, all would be copied.
        for part, residual in zip(jax.tree.leaves(columns), jax.tree.leaves(f_info.residual), strict=True):
            rows = part.reshape(-1, flat.size)
            matrix, gradient = matrix + rows.T @ rows, gradient + residual.ravel() @ rows
        return NormalEquations(matrix, gradient)

    def step(self, step_size: Any, state: NormalEquations) -> tuple[Any, optx.RESULTS]:
        """The step for a damping of one over `step_size`."""
        eps = jnp.finfo(state.matrix.dtype).eps
        damped = state.matrix + jnp.eye(len(state.gradient), dtype=state.matrix.dtype) / jnp.maximum(step_size, eps)
        step = -jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(damped, lower=True), state.gradient)
        solved = jnp.isfinite(step).all()
        return step, optx.RESULTS.where(solved, optx.RESULTS.successful, optx.RESULTS.nonlinear_divergence)


def _quiet(**_: Any) -> None:
    """Say nothing. A function with a name: solvers go to other processes."""


class LevenbergMarquardt(optx.AbstractGaussNewton):
    """Levenberg-Marquardt on normal equations; tolerances as in `optimistix.LevenbergMarquardt`."""

    rtol: float
    atol: float
    norm: Callable[[Any], Any] = optx.max_norm
    descent: optx.AbstractDescent = DampedNormalDescent()
    search: optx.ClassicalTrustRegion = eqx.field(default_factory=optx.ClassicalTrustRegion)
    verbose: Callable[..., None] = _quiet


def default_solver() -> optx.AbstractLeastSquaresSolver:
    """Levenberg-Marquardt to three millimetres or milliradians."""
    return LevenbergMarquardt(rtol=1e-2, atol=3e-3)
