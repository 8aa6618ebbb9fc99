"""How adults differ: bone lengths and the flesh around them, as means, common deviations and what is left.

Silhouettes show flesh. Where a joint is that hardly turns, a hip above all, is known only because both differ together
from person to person: broad hips and wide-set hip joints, say. The table comes from bodies of MakeHuman (CC0 1.0), see
`benchmarks/adults.py`; joint centres are where the joints of its skeleton are.
"""

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

_TABLE = "adults.csv"


class Adults(NamedTuple):
    """Statistics of a population, by the names of the quantities."""

    names: tuple[str, ...]
    means: Float[np.ndarray, " quantities"]
    """Lengths: logarithms relative to `default_adult` of the same stature. Flesh: relative to `make_body`, shares of
    the stature."""
    axes: Float[np.ndarray, "quantities axes"]
    """What the quantities deviate by together, one standard deviation along each axis."""
    rest: Float[np.ndarray, " quantities"]
    """Standard deviation of what each quantity deviates by on its own."""


@cache
def adults() -> Adults:
    """Read the table that `benchmarks/adults.py` makes."""
    lines = files("jaxskel.body").joinpath(_TABLE).read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    numbers = np.array([[float(cell) for cell in row[1:]] for row in rows])
    return Adults(tuple(row[0] for row in rows), numbers[:, 0], numbers[:, 2:], numbers[:, 1])
