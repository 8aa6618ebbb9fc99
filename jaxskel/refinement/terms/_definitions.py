"""Classes of terms that are defined twice, as in a notebook's cell that is run again.

Python makes another class then, and JAX compiles everything for it anew. So an objective takes the first class of those
that are defined alike.
"""

from collections.abc import Hashable
from dataclasses import fields
from types import FunctionType
from typing import Any

import equinox as eqx

from ._code import Code

# Of a class, what Python and its libraries add, or what `_definition` compares otherwise.
_LEFT_OUT = {
    "__module__", "__doc__", "__dict__", "__weakref__", "__annotations__", "__annotate_func__", "__annotations_cache__",
    "__abstractmethods__", "_abc_impl", "__dataclass_fields__", "__dataclass_params__", "__firstlineno__",
}  # fmt: skip
_GENERATED = "<string>"  # the file of an __init__ that `dataclasses` writes

_first: dict[Hashable, type] = {}
_definitions: dict[type, Hashable] = {}  # as they were when a class was seen first


def as_first_defined(value: Any) -> Any:
    """A Module, and each Module that is a field of it, as an instance of the first class that is defined alike.

    Only classes of a notebook or a script (``__main__``) are looked at. They are alike if their fields and their code
    are, and the outer variables that the code uses.
    """
    if not isinstance(value, eqx.Module):
        return value
    before = {field.name: getattr(value, field.name) for field in fields(value) if hasattr(value, field.name)}
    after = {name: as_first_defined(each) for name, each in before.items()}
    kind = _first_defined(type(value))
    if kind is type(value) and all(after[name] is before[name] for name in after):
        return value
    made = object.__new__(kind)
    for name, each in after.items():
        object.__setattr__(made, name, each)
    return made


def _first_defined(kind: type) -> type:
    if kind.__module__ != "__main__":
        return kind
    try:
        definition = _definition(kind)
        before = _definitions.setdefault(kind, definition)
    except (AttributeError, TypeError, ValueError):  # it holds something that cannot be compared
        return kind
    if before != definition:  # an outer variable has changed, so what was compiled for it is of either value
        _first.pop(before, None)
        _definitions[kind] = None  # for good, also if the variable gets its first value back
        return kind
    return _first.setdefault(definition, kind)


def _definition(kind: type) -> Hashable:
    """What a class is made of: equal for classes that are defined alike."""
    described = tuple(
        (field.name, repr(field.type), field.init, field.default, field.default_factory, tuple(field.metadata.items()))
        for field in fields(kind)  # pyright: ignore[reportArgumentType]
    )
    content = tuple((name, *_compared(value)) for name, value in sorted(vars(kind).items()) if name not in _LEFT_OUT)
    bases = tuple(_first_defined(base) for base in kind.__bases__)
    return kind.__qualname__, type(kind), bases, described, content


def _compared(value: Any) -> tuple[type, Hashable]:
    """The type of an attribute of a class, and something that is equal if it does the same."""
    inner = value
    for name in ("__func__", "fget"):
        inner = getattr(inner, name, inner)
    return type(value), Code(inner, "from_function") if isinstance(inner, FunctionType) else value
