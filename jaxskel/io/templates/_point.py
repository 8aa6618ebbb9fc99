"""One joint or tip of a template file, and the values that it is given."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..files import fault


@dataclass(frozen=True)
class Point:
    """A joint or a tip as the file describes it.

    Attributes:
        kind: The table that it stands in: joints or tips.
        table: Its keys and values.
    """

    keys: ClassVar[tuple[str, ...]] = (
        "parent", "at", "is", "inner", "segment", "bends", "range", "twist", "swing", "firmness", "radius", "along",
    )  # fmt: skip

    path: Path
    kind: str
    name: str
    table: dict[str, Any]

    @property
    def key(self) -> str:
        """Where it stands in the file."""
        return f"{self.kind}.{self.name}"

    @property
    def parent(self) -> str | None:
        """Name of the joint that it hangs on."""
        return self.text("parent")

    def text(self, key: str) -> str | None:
        """A text, None if not given."""
        value = self.table.get(key)
        if value is not None and (not isinstance(value, str) or not value.strip()):
            raise fault(self.path, f"{self.key}.{key}", f"is {value!r}; give a name in quotes")
        return value

    def switch(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.table.get(key, default)
        if not isinstance(value, bool):
            raise fault(self.path, f"{self.key}.{key}", f"is {value!r}; give true or false")
        return value

    def number(self, key: str, least: float, most: float) -> float | None:
        """A number within limits, None if not given."""
        value = self.table.get(key)
        return None if value is None else self._checked(key, value, least, most)

    def numbers(self, key: str, count: int, least: float, most: float) -> tuple[float, ...] | None:
        """Some numbers within limits, None if not given."""
        value = self.table.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != count:
            raise fault(self.path, f"{self.key}.{key}", f"is {value!r}; give {count} numbers in brackets")
        return tuple(self._checked(key, each, least, most) for each in value)

    def place(self) -> tuple[float, ...] | None:
        """Its place at rest (m), None if not given."""
        return self.numbers("at", 3, -1e3, 1e3)

    def _checked(self, key: str, value: Any, least: float, most: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise fault(self.path, f"{self.key}.{key}", f"is {value!r}; give a number")
        if not least <= value <= most:
            raise fault(self.path, f"{self.key}.{key}", f"is {value:g}; give a number from {least:g} to {most:g}")
        return float(value)
