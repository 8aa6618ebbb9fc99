"""Statistics of adult bodies: bone lengths and the flesh around them, as means, common and individual deviations.

Silhouettes show flesh, not joints. A joint that hardly turns, such as the hip, can be located only because flesh and
bones vary together: broad hips come with wide-set hip joints. The table comes from bodies of MakeHuman (CC0 1.0), see
`benchmarks/adults.py`; joint centres are the joints of its skeleton.
"""

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

_TABLE = "adults.csv"


class Adults(NamedTuple):
    """Statistics of a population, one entry per named quantity."""

    names: tuple[str, ...]
    means: Float[np.ndarray, " quantities"]
    """Lengths: logarithms relative to `default_adult` of the same stature. Flesh: relative to `make_body`, as fractions
    of the stature."""
    axes: Float[np.ndarray, "quantities axes"]
    """Common deviations of the quantities: one standard deviation along each axis."""
    rest: Float[np.ndarray, " quantities"]
    """Standard deviation of the individual part of each quantity."""


@cache
def adults() -> Adults:
    """Read the table that `benchmarks/adults.py` writes."""
    lines = files("jaxskel.body").joinpath(_TABLE).read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    numbers = np.array([[float(cell) for cell in row[1:]] for row in rows])
    return Adults(tuple(row[0] for row in rows), numbers[:, 0], numbers[:, 2:], numbers[:, 1])
