"""Statistics of bodies: bone lengths and the flesh around them, as means, common and individual deviations.

Silhouettes show flesh, not joints. A joint that hardly turns, such as the hip, can be located only because flesh and
bones vary together: broad hips come with wide-set hip joints. The tables come from bodies of MakeHuman (CC0 1.0), see
`benchmarks/population.py`; joint centres are the joints of its skeleton.
"""

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

# The table's children are 0.88 to 1.62 m tall, its adults 1.45 to 2.02 m; this is about the middle of the overlap.
_GROWN = 1.5  # m


class Population(NamedTuple):
    """Statistics of a population, one entry per named quantity.

    Attributes:
        means: Lengths: logarithms relative to `default_adult` of the same stature. Flesh: relative to `make_body`, as
            fractions of the stature.
        axes: Common deviations of the quantities: one standard deviation along each axis.
        rest: Standard deviation of the individual part of each quantity.
    """

    names: tuple[str, ...]
    means: Float[np.ndarray, " quantities"]
    axes: Float[np.ndarray, "quantities axes"]
    rest: Float[np.ndarray, " quantities"]


def adults() -> Population:
    """People of 1.45 to 2.02 m and 25 to 84 years."""
    return _read("adults.csv")


def children() -> Population:
    """People of 0.88 to 1.62 m: larger heads, shorter legs."""
    return _read("children.csv")


def population_of(stature: float) -> Population:
    """Whose statistics hold for a stature (m): children's below 1.5 m."""
    return adults() if stature > _GROWN else children()


@cache
def _read(name: str) -> Population:
    lines = files("jaxskel.body").joinpath(name).read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    numbers = np.array([[float(cell) for cell in row[1:]] for row in rows])
    return Population(tuple(row[0] for row in rows), numbers[:, 0], numbers[:, 2:], numbers[:, 1])
