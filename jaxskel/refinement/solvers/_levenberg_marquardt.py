"""Levenberg-Marquardt for batches of small problems, with the normal equations formed once for each accepted step.

`optimistix.LevenbergMarquardt` stores the linearised residuals and, for each damping, solves a stacked system of the
Jacobian and the root of the damping. For a few dozen unknowns the normal equations give the same step and the same
predicted decrease in a fraction of the memory, which limits the speed of batches of frames. Trust region and stopping
criteria are those of Optimistix.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, PyTree

# Rounding error of a cost, in units of machine precision: positions, rotations and sums each add to it.
_ROUNDING = 4


class AbstractEquations(eqx.Module):
    """Normal equations ``J^T J``, ``J^T r`` of a linearised problem, in a form that suits its structure.

    Attributes:
        gradient: ``J^T r``, with the structure of the unknowns.
    """

    gradient: eqx.AbstractVar[Any]

    @classmethod
    @abstractmethod
    def of(cls, y: Any, residual: Any, slope: Callable[[Any], Any]) -> "AbstractEquations":
        """Form the equations at `y`; `slope` maps a change v of `y` to the change of the residual (``J v``)."""

    @abstractmethod
    def applied(self, change: Any) -> Any:
        """``J^T J`` times a change of the unknowns."""

    @abstractmethod
    def step(self, step_size: Any) -> Any:
        """The step ``-(J^T J + I / step_size)^-1 J^T r``; not finite if the matrix is not."""


class NormalEquations(AbstractEquations):
    """Dense normal equations, for a few dozen unknowns."""

    matrix: Float[Array, "unknowns unknowns"]
    gradient: PyTree[Float[Array, "..."]]

    @classmethod
    def of(cls, y: Any, residual: Any, slope: Callable[[Any], Any]) -> "NormalEquations":
        """Form the equations at `y`; `slope` maps a change v of `y` to the change of the residual (``J v``)."""
        flat, unravel = ravel_pytree(y)
        units = jnp.eye(flat.size, dtype=flat.dtype)
        # Unknowns are the last axis, because long rows vectorise well, unlike points and rotations.
        columns = jax.vmap(lambda unit: slope(unravel(unit)), out_axes=-1)(units)
        matrix, gradient = jnp.zeros((flat.size, flat.size), flat.dtype), jnp.zeros_like(flat)
        # Residuals are added one by one: stacking them into one matrix would copy them all.
        for part, value in zip(jax.tree.leaves(columns), jax.tree.leaves(residual), strict=True):
            rows = part.reshape(-1, flat.size)
            matrix, gradient = matrix + rows.T @ rows, gradient + value.ravel() @ rows
        return cls(matrix, unravel(gradient))

    def applied(self, change: Any) -> Any:
        """``J^T J`` times a change of the unknowns."""
        flat, unravel = ravel_pytree(change)
        return unravel(self.matrix @ flat)

    def step(self, step_size: Any) -> Any:
        """The step for a damping of ``1 / step_size``, by Cholesky factorisation."""
        gradient, unravel = ravel_pytree(self.gradient)
        damped = self.matrix + jnp.eye(gradient.size, dtype=gradient.dtype) / not_zero(step_size, gradient)
        return unravel(-jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(damped, lower=True), gradient))


def not_zero(step_size: Any, like: Array) -> Float[Array, ""]:
    """The step size, bounded from below so that it can be divided by."""
    return jnp.maximum(step_size, jnp.finfo(like.dtype).eps)


class _State(eqx.Module):
    """Solver state between two steps.

    Attributes:
        trial: Unknowns to evaluate next.
        residual: Residual at the last accepted unknowns; the equations are taken there too.
        idle: Whether the trial promises too little to go on from it.
    """

    first: Bool[Array, ""]
    trial: Any
    search: Any
    residual: Any
    equations: Any
    terminate: Bool[Array, ""]
    idle: Bool[Array, ""]
    result: optx.RESULTS


class NormalEquationsLM(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt on normal equations; tolerances of `optimistix.LevenbergMarquardt`, and `ftol`.

    Attributes:
        ftol: A solve also ends before a step that would lower the cost by a smaller share than this, as far as the
            equations tell. With large residuals the steps shrink slowly, and many more would gain almost nothing. That
            step is taken without another look at the equations, if the cost gets lower.
    """

    rtol: float
    atol: float
    ftol: float = 0.0
    norm: Callable[[Any], Any] = optx.max_norm
    equations: type[AbstractEquations] = NormalEquations
    search: optx.ClassicalTrustRegion = eqx.field(default_factory=optx.ClassicalTrustRegion)

    def init(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], f_struct: Any, aux_struct: Any, tags: frozenset
    ) -> _State:
        """Initial state: the first trial is the start itself."""

        def zeros(tree: Any) -> Any:
            return jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), tree)

        residual = zeros(f_struct)
        # Only shapes are needed: the residual's derivative, which takes long to trace, is left to the step.
        equations = zeros(jax.eval_shape(lambda y: self.equations.of(y, residual, lambda _: residual), y))
        search = self.search.init(y, f_struct)
        return _State(
            jnp.array(True), y, search, residual, equations, jnp.array(False), jnp.array(False), optx.RESULTS.successful
        )  # fmt: skip

    def step(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _State, tags: frozenset
    ) -> tuple[Any, _State, Any]:
        """Evaluate the trial, accept or reject it, and compute the next one."""
        residual, slope, aux = jax.linearize(lambda y: fn(y, args), state.trial, has_aux=True)
        change = _change_of_cost(residual, state.residual)
        nothing = jnp.finfo(change.dtype).eps * _half_product(state.residual, state.residual)
        moved = _difference(state.trial, y)
        hessian = lx.FunctionLinearOperator(state.equations.applied, jax.eval_shape(lambda: y))
        before = optx.FunctionInfo.EvalGradHessian(nothing, state.equations.gradient, hessian)
        now = optx.FunctionInfo.Eval(change)
        step_size, accept, _, search = self.search.step(state.first, y, state.trial, before, now, state.search)

        def accepted() -> tuple[Any, Any, AbstractEquations, Bool[Array, ""]]:
            different = _difference(residual, state.residual)
            terminate = self._small(moved, state.trial) & self._small(different, residual)
            return state.trial, residual, self.equations.of(state.trial, residual, slope), terminate

        def rejected() -> tuple[Any, Any, AbstractEquations, Bool[Array, ""]]:
            return y, state.residual, state.equations, jnp.array(False)

        y, residual, equations, terminate = jax.lax.cond(accept, accepted, rejected)
        step = equations.step(step_size)
        finite = jnp.stack([jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(step)]).all()
        # A step that predicts a smaller decrease than rounding hides cannot be judged, so the solve ends before it:
        # otherwise it would wander at random.
        curved = jax.tree.map(lambda g, c: 2 * g + c, equations.gradient, equations.applied(step))
        least = max(_ROUNDING * jnp.finfo(change.dtype).eps, self.ftol) * _half_product(residual, residual)
        idle = -_half_product(step, curved) <= least
        result = optx.RESULTS.where(finite, optx.RESULTS.successful, optx.RESULTS.nonlinear_divergence)
        trial = jax.tree.map(jnp.add, y, step)
        return y, _State(jnp.array(False), trial, search, residual, equations, terminate | idle, idle, result), aux

    def _small(self, change: Any, value: Any) -> Bool[Array, ""]:
        """Whether a change is within the tolerances."""
        return (
            self.norm(jax.tree.map(lambda c, v: jnp.abs(c) / (self.atol + self.rtol * jnp.abs(v)), change, value)) < 1
        )

    def terminate(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _State, tags: frozenset
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Whether the last accepted step was within the tolerances, or the last one predicted too small a decrease."""
        return state.terminate, state.result

    def postprocess(
        self,
        fn: Any,
        y: Any,
        aux: Any,
        args: Any,
        options: dict[str, Any],
        state: _State,
        tags: frozenset,
        result: optx.RESULTS,
    ) -> tuple[Any, Any, dict[str, Any]]:
        """Take the last step, which was too small to go on from it, if the cost gets lower."""
        residual, _ = fn(state.trial, args)
        lower = state.idle & (_change_of_cost(residual, state.residual) < 0)
        return jax.tree.map(lambda last, y: jnp.where(lower, last, y), state.trial, y), aux, {}


def _difference(one: Any, other: Any) -> Any:
    return jax.tree.map(jnp.subtract, one, other)


def _change_of_cost(after: Any, before: Any) -> Float[Array, ""]:
    """Change of half the squared norm, residual by residual: a difference of two sums would be mostly rounding."""
    return _half_product(_difference(after, before), jax.tree.map(jnp.add, after, before))


def _half_product(one: Any, other: Any) -> Float[Array, ""]:
    return 0.5 * jnp.stack([(a * b).sum() for a, b in zip(*map(jax.tree.leaves, (one, other)), strict=True)]).sum()


def default_solver() -> optx.AbstractLeastSquaresSolver:
    """Levenberg-Marquardt for `refine_frames`, with tolerances of 3 mm or 3 mrad."""
    return NormalEquationsLM(rtol=1e-2, atol=3e-3)
