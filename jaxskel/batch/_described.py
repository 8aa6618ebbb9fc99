"""Settings as plain data, the same in every process, to be stored and compared."""

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np


def described(value: Any) -> Any:
    """A value as JSON data: a Module by its class and fields, functions and classes by their names.

    Fields with the metadata ``described=False`` are left out: they do not affect the poses.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return np.asarray(value).tolist()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, dict):
        return {str(key): described(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [described(each) for each in value]
    if is_dataclass(value) and not isinstance(value, type):
        told = [field for field in fields(value) if field.metadata.get("described", True)]
        held = {field.name: described(getattr(value, field.name)) for field in told}
        return {"class": _name(type(value))} | held
    return _name(value if hasattr(value, "__qualname__") else type(value))


def _name(value: Any) -> str:
    # Names of this package leave out the module, because a definition that moves stays the same.
    ours = value.__module__.partition(".")[0] == __name__.partition(".")[0]
    return value.__qualname__ if ours else f"{value.__module__}.{value.__qualname__}"
