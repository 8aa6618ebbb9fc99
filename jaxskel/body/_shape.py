"""A subject's dimensions as unknowns: symmetric bone lengths and flesh, relative to a template."""

from types import ModuleType
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._capsule_body import BAG_BALLS, BALL_NAMES, BALL_SIDES, FREE_BALLS, HAIR_BALLS, HEM, LIKE_BALL, Body, make_body
from ._human import JOINT_NAMES, JOINT_PARENTS, TIP_NAMES, TIP_PARENTS
from ._population import Population, population_of
from ._skeleton import Skeleton, make_skeleton

LENGTH_NAMES = (
    "trunk", "neck", "shoulder", "upper_arm", "forearm", "hip", "thigh", "shank", "head_top", "fingertip", "toetip",
)  # fmt: skip
"""Names of the lengths of a symmetric skeleton, as in a subject's file; left and right are equal."""
_ENDS = (
    "neck", "head", "shoulder", "elbow", "hand", "hip", "knee", "foot", "head_top", "fingertip", "toetip",
)  # fmt: skip
_POINTS = JOINT_NAMES + TIP_NAMES
_PARENTS = np.array(JOINT_PARENTS + TIP_PARENTS, np.int32)
_LENGTH_OF_POINT = np.array([_ENDS.index(name.removeprefix("l_").removeprefix("r_")) for name in _POINTS[1:]], np.int32)
_FINGERTIPS = np.array([_POINTS.index("l_fingertip"), _POINTS.index("r_fingertip")], np.int32)
_THINNEST = 0.010  # smallest radius of a ball (m)
QUANTITIES = [*LENGTH_NAMES, "fingers front", "fingers out"] + [
    f"{BALL_NAMES[ball].removeprefix('l_')} {what}" for ball in FREE_BALLS for what in ("front", "out", "up", "radius")
]
"""Names of the unknowns in order: lengths, fingers, then shift and radius of each free ball."""
FLESH_FROM = len(LENGTH_NAMES) + 2

# Standard deviations that the tables of people lack: lengths (relative), joint centres, which depend on their
# definition (m), and flesh (fraction of the stature).
_SHARE, _CENTRE, _FLESH = 0.01, 0.002, 0.001
# The table covers hands only up to the palm, and fingers may be open or closed (m; relative; tangent of an angle).
_HAND_PLAYS = {"palm": 0.006, "finger": 0.015}
_FINGERTIP_PLAY, _FINGERS_PLAY = 0.15, 5.0
# Hands not held flat are half closed: fingers point inwards (tangent) and reach less far than flat ones (logarithm).
_CLOSED, _SHORTER = -3.0, -0.4
NO_PLAY = 1e-6
"""Standard deviation of what is fixed: the covariance stays invertible."""


class Shape(eqx.Module):
    """Difference of a subject's body from the average body around a template; zeros mean no difference.

    Attributes:
        lengths: Logarithm of each length, in the order of `LENGTH_NAMES`, relative to the template's.
        fingers: Tilt of the left fingers to the front and to the left (tangents); the right fingers mirror it.
        balls: Shift of each of `FREE_BALLS` (m, body frame), and increase of its radius (m).
    """

    lengths: Float[Array | np.ndarray, "lengths=11"]
    fingers: Float[Array | np.ndarray, "2"]
    balls: Float[Array | np.ndarray, "free=25 4"]

    @classmethod
    def of(cls, vector: Float[Array | np.ndarray, " unknowns"]) -> "Shape":
        """The shape with a vector of all unknowns, in the order of `QUANTITIES`."""
        return cls(vector[:11], vector[11:13], vector[13:].reshape(-1, 4))

    @property
    def vector(self) -> Float[np.ndarray, " unknowns"]:
        """Vector of all unknowns, in the order of `QUANTITIES`."""
        return np.concatenate([np.ravel(part) for part in (self.lengths, self.fingers, self.balls)])


def lengths_of(skeleton: Skeleton) -> Float[np.ndarray, "lengths=11"]:
    """The lengths of a skeleton in the order of `LENGTH_NAMES` (m): means of left and right."""
    every = np.concatenate([skeleton.bone_lengths, skeleton.tip_lengths])
    return np.array([every[_LENGTH_OF_POINT == length].mean() for length in range(len(LENGTH_NAMES))])


def shaped_skeleton(template: Skeleton, shape: Shape) -> Skeleton:
    """The template with other lengths; at rest, only the fingers change their direction.

    NumPy arrays are computed in double precision; with JAX arrays it is differentiable.
    """
    xp = _namespace(template, shape)
    points = xp.concatenate([template.rest_joints, template.rest_tips])
    bones = points[1:] - points[_PARENTS[1:]]
    fingers = bones[_FINGERS_TO]
    size = xp.linalg.norm(fingers, axis=-1, keepdims=True)
    tilt = shape.fingers @ _TILTS
    along = fingers / size
    tilted = along + tilt - (tilt * along).sum(-1, keepdims=True) * along
    tilted = size * tilted / xp.linalg.norm(tilted, axis=-1, keepdims=True)
    bones = _OTHERS[:, None] * bones + _OF_FINGERS @ tilted
    bones = bones * xp.exp(shape.lengths)[_LENGTH_OF_POINT][:, None]
    built = points[:1] + _BONES_TO @ bones
    return Skeleton(built[: len(JOINT_NAMES)], built[len(JOINT_NAMES) :])


def shaped_body(template: Skeleton, shape: Shape) -> Body:
    """The body (m, body frame) that the unknowns describe, computed as by `shaped_skeleton`."""
    body = make_body(shaped_skeleton(template, shape))
    own = shape.balls[LIKE_BALL]
    sides = np.stack([np.ones_like(BALL_SIDES), BALL_SIDES, np.ones_like(BALL_SIDES)], -1).astype(np.float32)
    radii = _namespace(template, shape).maximum(body.radii + own[:, 3], _THINNEST)
    return Body(body.skeleton, body.segments, body.offsets + own[:, :3] * sides, radii, body.links)


def measured_body(template: Skeleton, shape: Shape) -> Body:
    """As `shaped_body`, but as NumPy arrays in double precision, with a checked skeleton."""
    body = shaped_body(*jax.tree.map(lambda part: np.asarray(part, np.float64), (template, shape)))
    skeleton = make_skeleton(body.skeleton.rest_joints, body.skeleton.rest_tips)
    return Body(skeleton, body.segments, body.offsets, body.radii, body.links)


def _namespace(template: Skeleton, shape: Shape) -> ModuleType:
    """NumPy where all arrays are NumPy's: compiling what runs but a few times would take longest before a pose."""
    return np if all(isinstance(part, np.ndarray) for part in jax.tree.leaves((template, shape))) else jnp


class Prior(NamedTuple):
    """Prior knowledge of a subject's dimensions.

    Attributes:
        precision: Inverse covariance of the vector of unknowns; the common scale of all lengths is unconstrained.
    """

    mean: Shape
    precision: Float[np.ndarray, "unknowns unknowns"]


def population_prior(table: Population, template: Skeleton) -> Prior:
    """Prior of a population relative to a template of about the same stature; hands are half closed."""
    height, count = float(template.height), len(QUANTITIES)
    size = np.where(np.arange(count) < FLESH_FROM, 1.0, height)[:, None]
    mean, rest, axes = np.zeros((count, 1)), np.zeros((count, 1)), np.zeros((count, table.axes.shape[1]))
    known = [QUANTITIES.index(name) for name in table.names]
    mean[known, 0], rest[known, 0], axes[known] = table.means, table.rest, table.axes
    mean, rest, axes = (size * mean)[:, 0], np.hypot(size * rest, _unlike(template)[:, None])[:, 0], size * axes
    mean[QUANTITIES.index("fingers out")], mean[QUANTITIES.index("fingertip")] = _CLOSED, _SHORTER
    covariance = axes @ axes.T + np.diag(rest**2)
    # The tables have no hem: its flesh lies between those of calf and ankle, but for a deviation of its own.
    covariance = _BETWEEN @ covariance @ _BETWEEN.T
    covariance[_HEM, _HEM] += (_FLESH * height) ** 2
    mean, precision = _BETWEEN @ mean, np.linalg.inv(covariance)
    scale = precision[:, : len(LENGTH_NAMES)].sum(1)
    precision -= np.outer(scale, scale) / scale[: len(LENGTH_NAMES)].sum()
    return Prior(Shape.of(mean), precision)


def people_prior(template: Skeleton, stature: float) -> Prior:
    """Prior of people of about this stature (m), children or adults, relative to a template of any size."""
    size = stature / template.stature
    prior = population_prior(population_of(stature), template.scaled(size))
    mean = prior.mean.vector
    mean[: len(LENGTH_NAMES)] += np.log(size)
    return Prior(Shape.of(mean), prior.precision)


def _unlike(template: Skeleton) -> Float[np.ndarray, " unknowns"]:
    """Standard deviation of each unknown that the tables of people do not contain."""
    lengths = np.sqrt(_SHARE**2 + (_CENTRE / lengths_of(template)) ** 2)
    lengths[LENGTH_NAMES.index("fingertip")] = _FINGERTIP_PLAY
    flesh = np.full(len(QUANTITIES) - FLESH_FROM, _FLESH * float(template.height))
    for place, quantity in enumerate(QUANTITIES[FLESH_FROM:]):
        ball, what = quantity.split()
        flesh[place] = _HAND_PLAYS.get(ball, flesh[place])
        # Middle balls stay in the middle, and bags in the chest and hair in the head unless some is found.
        if (what == "out" and ball in BALL_NAMES) or ball in BAG_BALLS + HAIR_BALLS:
            flesh[place] = NO_PLAY
    return np.concatenate([lengths, [_FINGERS_PLAY, _FINGERS_PLAY], flesh])


def _bones_to() -> Float[np.ndarray, "points=20 bones=19"]:
    """Indicator matrix of the bones on the path from the pelvis to each joint and tip."""
    ways = np.zeros((len(_POINTS), len(_POINTS) - 1), np.float32)
    for point in range(1, len(_POINTS)):
        ways[point] = ways[_PARENTS[point]]
        ways[point, point - 1] = 1
    return ways


def _between() -> Float[np.ndarray, "unknowns unknowns"]:
    """Indicator matrix that replaces the flesh of the hem by a weighted mean of those of calf and ankle."""
    matrix = np.eye(len(QUANTITIES))
    for what in ("front", "out", "up", "radius"):
        calf, hem, ankle = (QUANTITIES.index(f"{ball} {what}") for ball in ("calf", "hem", "ankle"))
        matrix[hem, [calf, hem, ankle]] = 1 - HEM, 0.0, HEM
    return matrix


_BONES_TO = _bones_to()
_BETWEEN = _between()
_HEM = np.flatnonzero(np.diagonal(_BETWEEN) == 0)
_FINGERS_TO = _FINGERTIPS - 1
# Bones other than the fingers' (1 or 0), and where the two of the fingers are among all.
_OTHERS = np.where(np.isin(np.arange(len(_POINTS) - 1), _FINGERS_TO), 0.0, 1.0).astype(np.float32)
_OF_FINGERS = (np.arange(len(_POINTS) - 1)[:, None] == _FINGERS_TO).astype(np.float32)
# From the two tilts of the left fingers to vectors that tilt the left and the right ones (hand, tilt, axis).
_TILTS = np.array([[[1.0, 0.0, 0.0], [0.0, side, 0.0]] for side in (1.0, -1.0)], np.float32)
