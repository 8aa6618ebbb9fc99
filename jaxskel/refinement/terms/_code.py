"""Plain functions in an objective: which ones are the same, and which are refused."""

import dis
import inspect
from collections.abc import Callable, Iterator
from types import CodeType, FunctionType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree


class Code:
    """A function that equals another with the same code, so that re-running a notebook cell does not compile again.

    In which lines of which file the code stands does not matter.

    The outer variables that the code uses are compared too, so none of them may be an array.

    Args:
        function: A plain function.
        maker: Name of the public function that it was given to, for messages.
    """

    def __init__(self, function: FunctionType, maker: str):
        self.function = function
        self._key = (
            _anywhere(function.__code__),
            function.__defaults__,
            tuple((function.__kwdefaults__ or {}).items()),
        )
        self._key += tuple(_surroundings(function, maker))
        try:
            hash(self._key)
        except TypeError:
            raise ValueError(
                f"{function.__qualname__}: a default or an outer variable of it can change; pass it as a parameter, "
                f"{maker}({function.__name__}, value)"
            ) from None

    def __call__(self, *args: Any) -> Any:
        return self.function(*args)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Code) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


def code_and_parameters(
    function: Callable[..., Any], parameters: tuple[PyTree, ...], sees: tuple[str, ...], maker: str, base: str
) -> tuple[Code, tuple[PyTree, ...]]:
    """A function as a static field, and its parameters as arrays.

    Args:
        function: What a user gave.
        parameters: Numbers, arrays, or trees of them.
        sees: Names of the arguments before the parameters.
        maker: Name of the public function that it was given to, for messages.
        base: Name of the class to derive from instead, for messages.

    Raises:
        ValueError: One line: it is no plain function, takes other arguments, or uses an outer array.
    """
    if not isinstance(function, FunctionType):
        raise ValueError(f"{function!r} is no plain function; write one, or a Module derived from {base}")
    try:
        inspect.signature(function).bind(*sees, *parameters)
    except TypeError as error:
        raise ValueError(
            f"{function.__qualname__}: {error}; it is called with {', '.join(sees)} and the parameters given to {maker}"
        ) from None
    given = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.result_type(float)), parameters)
    return Code(function, maker), given


def _anywhere(code: CodeType) -> CodeType:
    """The same code without the lines and the file that it stands in."""
    inner = tuple(_anywhere(each) if isinstance(each, CodeType) else each for each in code.co_consts)
    return code.replace(co_consts=inner, co_firstlineno=1, co_linetable=b"", co_filename="")


def _surroundings(function: FunctionType, maker: str) -> Iterator[tuple[str, type, Any]]:
    """Names, types and values of the outer variables that a function uses."""
    # Types are compared too, because 1, 1.0 and True are equal but compile differently.
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, type(cell.cell_contents), _constant(function, name, cell.cell_contents, maker)
    for name in sorted(_global_names(function.__code__)):
        if name in function.__globals__:
            value = function.__globals__[name]
            yield name, type(value), _constant(function, name, value, maker)


def _global_names(code: CodeType) -> set[str]:
    names = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= _global_names(constant)
    return names


def _constant(function: FunctionType, name: str, value: Any, maker: str) -> Any:
    if any(isinstance(leaf, np.ndarray | jax.Array) for leaf in jax.tree.leaves(value)):
        raise ValueError(
            f"{function.__qualname__} uses the array `{name}` from around it; make it its last argument and pass it as "
            f"a parameter: {maker}({function.__name__}, {name})"
        )
    return value
