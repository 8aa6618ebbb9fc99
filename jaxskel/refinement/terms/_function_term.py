"""Terms made of plain functions, for use in notebooks."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ._base import AbstractCoupling, AbstractTerm, Observed, PlacedBody, number
from ._code import Code, code_and_parameters


class FunctionTerm(AbstractTerm):
    """A function of the placed body, the observations, and parameters. See [`from_function`][].

    Attributes:
        looks_at: Whether the function uses the labelled graph, and whether it uses the outlines.
    """

    function: Code = eqx.field(static=True)
    parameters: tuple[PyTree, ...]
    weight: Float[Array, ""] = eqx.field(converter=number)
    looks_at: tuple[bool, bool] = eqx.field(static=True, default=(False, False))

    @property
    def needs_graph(self) -> bool:
        """Whether the function uses the labelled graph."""
        return self.looks_at[0]

    @property
    def needs_outlines(self) -> bool:
        """Whether the function uses the outlines of the silhouettes."""
        return self.looks_at[1]

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "..."]:
        """The value of the function."""
        return jnp.asarray(self.function(body, observed, *self.parameters))


def from_function(
    function: Callable[..., Any],
    *parameters: PyTree,
    weight: Any = 1.0,
    needs_graph: bool = False,
    needs_outlines: bool = False,
) -> FunctionTerm:
    """Make a term of a function ``residual(body, observed, *parameters)`` of one frame.

    Args:
        function: Returns residuals of any shape, whose squared norm is minimised; positions are in the world (m).
        *parameters: Numbers, arrays, or trees of them. New values do not compile again, and gradients reach them.
        weight: Weight of the squared norm.
        needs_graph: The function uses the labelled graph: ``paths``, ``found``, ``neck``, ``pelvis``.
        needs_outlines: The function uses ``observed.contours`` or ``observed.silhouettes``.

    Raises:
        ValueError: It is no plain function of these arguments, or it uses an outer array: the solver is compiled once
            and would not notice that the array has changed.
    """
    code, given = code_and_parameters(function, parameters, ("body", "observed"), "from_function", "AbstractTerm")
    return FunctionTerm(function=code, parameters=given, weight=weight, looks_at=(needs_graph, needs_outlines))


class FunctionCoupling(AbstractCoupling):
    """A function of the bodies of three consecutive frames, and parameters. See [`coupling_from_function`][]."""

    function: Code = eqx.field(static=True)
    parameters: tuple[PyTree, ...]
    weight: Float[Array, ""] = eqx.field(converter=number)

    def residual(self, before: PlacedBody, body: PlacedBody, after: PlacedBody) -> Float[Array, "..."]:
        """The value of the function."""
        return jnp.asarray(self.function(before, body, after, *self.parameters))


def coupling_from_function(function: Callable[..., Any], *parameters: PyTree, weight: Any = 1.0) -> FunctionCoupling:
    """Make a coupling of a function ``residual(before, body, after, *parameters)`` of three consecutive frames.

    Args:
        function: Returns residuals of any shape, whose squared norm is minimised; positions are in the world (m).
        *parameters: Numbers, arrays, or trees of them. New values do not compile again.
        weight: Weight of the squared norm.

    Raises:
        ValueError: As for `from_function`.
    """
    sees = "before", "body", "after"
    code, given = code_and_parameters(function, parameters, sees, "coupling_from_function", "AbstractCoupling")
    return FunctionCoupling(function=code, parameters=given, weight=weight)
