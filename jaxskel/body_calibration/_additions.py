"""Additions: bags and long hair, which average bodies lack, as parts of their own.

The balls of an addition are hidden in chest and head until it is found that the silhouettes show one.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..body import BAG_BALLS, BALL_NAMES, FREE_BALLS, HAIR_BALLS, QUANTITIES, Body, Prior, Shape, Skeleton

# Standard deviation of where it is and how thick it is (m), before the adjustment.
_ROUGHLY = 0.03
# Of a person of this stature (m): a backpack of 25 l (ends of the left half), and hair that falls over the back; the
# balls of the latter are relative to where the head turns, and the chest.
_STATURE = 1.7
_BACKPACK, _BAG_RADIUS = ((-0.18, 0.07, 0.38), (-0.18, 0.07, 0.12)), 0.11
_HAIR, _HAIR_RADIUS = ((-0.08, 0.0, 0.13), (-0.13, 0.0, 0.42)), 0.08

_LEFT_BAG = f"l_{BAG_BALLS[0]}", f"l_{BAG_BALLS[1]}"
# Backpacks cost 0.16 to 0.79 of what the same people cost without one, people in skirts and coats but without luggage
# 0.99 to 1.5 times as much with a backpack (crowd p00 to p07, seed 4 of the clothes), and a real person without luggage
# 0.98 times as much with what the hull holds behind the back.
_WITH_BAG = 0.82
# Long hair under or over a coat cost 0.74 to 0.93 of what the same people cost without a part for it, coats without
# hair 0.95 (crowd p00 to p07, seeds 4 and 5 of the clothes).
_WITH_HAIR = 0.9


class Addition(NamedTuple):
    """A capsule that a body gets. That of a bag has its mirror image beside it.

    Attributes:
        balls: Names of the balls at the top and at the bottom.
        ends: Their centres, relative to the points that their segments turn about (m).
        radius: (m)
        worth: A body with it must cost less than this share of what it costs without.
    """

    balls: tuple[str, str]
    ends: Float[np.ndarray, "ends=2 3"]
    radius: float
    worth: float

    @property
    def is_hair(self) -> bool:
        """Whether it is hair, and no bag."""
        return self.balls == HAIR_BALLS


def luggage(ends: Float[np.ndarray, "ends=2 3"], radius: float) -> Addition:
    """A bag as two upright capsules side by side, of which this is the left one (m, relative to the chest)."""
    return Addition(_LEFT_BAG, ends, radius, _WITH_BAG)


def usual_backpack(skeleton: Skeleton) -> Addition:
    """A backpack as large as usual for a person of this size, to start from where none was found."""
    size = skeleton.stature / _STATURE
    return luggage(size * np.array(_BACKPACK), size * _BAG_RADIUS)


def usual_hair(skeleton: Skeleton) -> Addition:
    """Long hair of a person of this size, to start from."""
    size = skeleton.stature / _STATURE
    return Addition(HAIR_BALLS, size * np.array(_HAIR), size * _HAIR_RADIUS, _WITH_HAIR)


def with_addition(shape: Shape, body: Body, addition: Addition) -> Shape:
    """The shape of a body, with an addition."""
    balls = np.array(shape.balls)
    for name, end in zip(addition.balls, addition.ends, strict=True):
        at = BALL_NAMES.index(name)
        ball = FREE_BALLS.index(at)
        balls[ball, :3] += end - np.asarray(body.offsets)[at]
        balls[ball, 3] += addition.radius - np.asarray(body.radii)[at]
    return Shape(shape.lengths, shape.fingers, balls)


def prior_with_addition(prior: Prior, shape: Shape, addition: Addition) -> Prior:
    """A prior that expects an addition where a shape has it."""
    own = [QUANTITIES.index(f"{name.removeprefix('l_')} front") + part for name in addition.balls for part in range(4)]
    mean, precision = prior.mean.vector, prior.precision.copy()
    mean[own] = shape.vector[own]
    precision[own, own] = _ROUGHLY**-2
    return Prior(Shape.of(mean), precision)
