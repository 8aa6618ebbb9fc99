"""Terms made of plain functions, for use in notebooks."""

import dis
from collections.abc import Callable, Iterator
from types import CodeType, FunctionType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from ._base import AbstractTerm, Observed, PlacedBody, number


class Code:
    """A function that equals another with the same code, so that re-running a notebook cell does not compile again.

    In which lines of which file the code stands does not matter.

    The outer variables that the code uses are compared too, so none of them may be an array.
    """

    def __init__(self, function: FunctionType):
        self.function = function
        self._key = (
            _anywhere(function.__code__),
            function.__defaults__,
            tuple((function.__kwdefaults__ or {}).items()),
        )
        self._key += tuple(_surroundings(function))
        try:
            hash(self._key)
        except TypeError:
            raise ValueError(
                f"{function.__qualname__}: a default or an outer variable of it can change; pass it as a parameter, "
                f"from_function({function.__name__}, value)"
            ) from None

    def __call__(self, *args: Any) -> Any:
        return self.function(*args)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Code) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


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
        ValueError: It is no plain function, or it uses an outer array: the solver is compiled once and would not
            notice that the array has changed.
    """
    if not isinstance(function, FunctionType):
        raise ValueError(f"{function!r} is no plain function; write one, or a Module derived from AbstractTerm")
    given = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.result_type(float)), parameters)
    return FunctionTerm(Code(function), given, weight, (needs_graph, needs_outlines))


def _anywhere(code: CodeType) -> CodeType:
    """The same code without the lines and the file that it stands in."""
    inner = tuple(_anywhere(each) if isinstance(each, CodeType) else each for each in code.co_consts)
    return code.replace(co_consts=inner, co_firstlineno=1, co_linetable=b"", co_filename="")


def _surroundings(function: FunctionType) -> Iterator[tuple[str, type, Any]]:
    """Names, types and values of the outer variables that a function uses."""
    # Types are compared too, because 1, 1.0 and True are equal but compile differently.
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, type(cell.cell_contents), _constant(function, name, cell.cell_contents)
    for name in sorted(_global_names(function.__code__)):
        if name in function.__globals__:
            value = function.__globals__[name]
            yield name, type(value), _constant(function, name, value)


def _global_names(code: CodeType) -> set[str]:
    names = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= _global_names(constant)
    return names


def _constant(function: FunctionType, name: str, value: Any) -> Any:
    if any(isinstance(leaf, np.ndarray | jax.Array) for leaf in jax.tree.leaves(value)):
        raise ValueError(
            f"{function.__qualname__} uses the array `{name}` from around it; make it an argument after `observed` and "
            f"pass it as a parameter: from_function({function.__name__}, {name})"
        )
    return value
