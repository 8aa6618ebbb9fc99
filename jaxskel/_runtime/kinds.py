"""Refuses arguments of a wrong kind in one line that names them, where they come in."""

from types import UnionType
from typing import Any

import numpy as np


def check_kind(name: str, value: Any, kind: type | UnionType, give: str) -> None:
    """Refuse a value that is no instance of a kind.

    Args:
        name: Of the argument.
        value: What was given.
        kind: What it must be an instance of; a class itself is none.
        give: What to give instead.

    Raises:
        ValueError: One line.
    """
    if isinstance(value, type) or not isinstance(value, kind):
        raise ValueError(f"{name}: is {told(value)}; give {give}")


def check_number(name: str, value: Any, least: float, most: float, give: str) -> None:
    """Refuse what is no number, or not between two limits.

    Raises:
        ValueError: One line.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not least <= value <= most:
        raise ValueError(f"{name}: is {value!r}; give {give}")


def check_count(name: str, value: Any, least: int = 1) -> None:
    """Refuse what is no whole number, or a smaller one than `least`.

    Raises:
        ValueError: One line.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name}: is {value!r}; give a whole number, {least} or more")


def told(value: Any) -> str:
    """What a value is, in a few words."""
    if isinstance(value, type):
        return f"the class {value.__name__}, not an instance of it"
    if callable(value) and hasattr(value, "__name__"):
        return f"the function {value.__name__}"
    return f"a {type(value).__name__}"
