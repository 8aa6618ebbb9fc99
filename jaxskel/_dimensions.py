"""A subject's dimensions as unknowns: symmetric bone lengths, and the flesh around them, relative to a template."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._body import BALL_NAMES, BALL_SIDES, FREE_BALLS, LIKE_BALL, Body, make_body
from ._skeleton import JOINT_NAMES, JOINT_PARENTS, TIP_NAMES, TIP_PARENTS, Skeleton

LENGTH_NAMES = (
    "trunk", "neck", "shoulder", "upper_arm", "forearm", "hip", "thigh", "shank", "head_top", "fingertip", "toetip",
)  # fmt: skip
"""Lengths of a symmetric skeleton, in the words of a subject's file; left and right are alike."""
_ENDS = (
    "neck", "head", "shoulder", "elbow", "hand", "hip", "knee", "foot", "head_top", "fingertip", "toetip",
)  # fmt: skip
_POINTS = JOINT_NAMES + TIP_NAMES
_PARENTS = np.array(JOINT_PARENTS + TIP_PARENTS, np.int32)
_LENGTH_OF_POINT = np.array([_ENDS.index(name.removeprefix("l_").removeprefix("r_")) for name in _POINTS[1:]], np.int32)
_FINGERTIPS = np.array([_POINTS.index("l_fingertip"), _POINTS.index("r_fingertip")], np.int32)
_THINNEST = 0.010  # m, of a ball

# How far lengths may be from those of an average adult. People of one stature differ in proportions by a few per cent.
# Where exactly a joint centre lies is a matter of definition to within a few centimetres, which matters to short bones
# more. What is seen of a bone that turns outweighs both. The height of the head varies little.
_SHARE, _CENTRE = 0.05, 0.03
# Likewise for the places of balls relative to the joints (m; to the front, to the left, up, where they differ), and for
# radii (share). Hips and seat turn with different segments: between them they tell where the hip joint is, so neither
# may slide far, except along the thigh, which is alike all the way. Fingers may be open or closed.
_LIMB_PLAY, _END_PLAY, _TRUNK_PLAY, _RADIUS_PLAY = 0.002, 0.005, 0.012, 0.2
_PLAYS: dict[str, float | tuple[float, float, float]] = {
    "hip": (0.005, 0.005, 0.025), "seat": 0.006, "palm": 0.006, "finger": 0.015,
    **dict.fromkeys(("shoulder", "elbow", "forearm", "wrist", "knee", "calf", "ankle"), _LIMB_PLAY),
    **dict.fromkeys(("heel", "ball", "toe"), _END_PLAY),
}  # fmt: skip
# The tip of the head is the top of its flesh, which every silhouette shows (m).
_TOP_PLAY = 0.003
# Balls of the middle stay there.
_NO_PLAY = 1e-6
# The direction of the fingers is free (tangent of the angle from that of the template).
_FINGERS_PLAY = 5.0
# Hands that hold nothing flat are half closed: fingers point inwards (tangent), and palm and fingers together then
# reach less far, so that the palm is farther out and the way to the fingertip shorter than in a flat hand.
_CLOSED, _FARTHER, _SHORTER = -3.0, 0.15, -0.4


class Shape(eqx.Module):
    """What makes a subject's body differ from the average body around a template; zeros are no difference."""

    lengths: Float[Array | np.ndarray, "lengths=11"]
    """Logarithm of each length, in the order of `LENGTH_NAMES`, relative to the template's."""
    fingers: Float[Array | np.ndarray, "2"]
    """Tilt of the left fingers to the front and to the left, in tangents."""
    balls: Float[Array | np.ndarray, "free=20 4"]
    """Shift of each of `FREE_BALLS` (m), and what its radius is larger by (m)."""

    @classmethod
    def of(cls, vector: Float[Array | np.ndarray, " unknowns"]) -> "Shape":
        """All unknowns in a row."""
        return cls(vector[:11], vector[11:13], vector[13:].reshape(-1, 4))

    @property
    def vector(self) -> Float[np.ndarray, " unknowns"]:
        """All unknowns in a row."""
        return np.concatenate([np.ravel(part) for part in (self.lengths, self.fingers, self.balls)])


def relaxed_shape() -> Shape:
    """The template's lengths, but the hands half closed."""
    lengths = np.zeros(len(LENGTH_NAMES))
    lengths[LENGTH_NAMES.index("forearm")], lengths[LENGTH_NAMES.index("fingertip")] = _FARTHER, _SHORTER
    return Shape(lengths, np.array([0.0, _CLOSED]), np.zeros((len(FREE_BALLS), 4)))


def lengths_of(skeleton: Skeleton) -> Float[np.ndarray, "lengths=11"]:
    """The lengths of a skeleton in the order of `LENGTH_NAMES` (m): means of left and right."""
    every = np.concatenate([skeleton.bone_lengths, skeleton.tip_lengths])
    return np.array([every[_LENGTH_OF_POINT == length].mean() for length in range(len(LENGTH_NAMES))])


def shaped_skeleton(template: Skeleton, shape: Shape) -> Skeleton:
    """The template with other lengths; only the fingers at rest point another way. It can be differentiated."""
    points = jnp.concatenate([jnp.asarray(template.rest_joints), jnp.asarray(template.rest_tips)])
    bones = points[1:] - points[_PARENTS[1:]]
    fingers = bones[_FINGERS_TO]
    size = jnp.linalg.norm(fingers, axis=-1, keepdims=True)
    tilt = jnp.stack([jnp.append(jnp.asarray(shape.fingers) * jnp.array([1.0, side]), 0.0) for side in (1.0, -1.0)])
    along = fingers / size
    tilted = along + tilt - (tilt * along).sum(-1, keepdims=True) * along
    bones = bones.at[_FINGERS_TO].set(size * tilted / jnp.linalg.norm(tilted, axis=-1, keepdims=True))
    bones = bones * jnp.exp(jnp.asarray(shape.lengths))[_LENGTH_OF_POINT][:, None]
    built = points[:1] + _BONES_TO @ bones
    return Skeleton(built[: len(JOINT_NAMES)], built[len(JOINT_NAMES) :])


def shaped_body(template: Skeleton, shape: Shape) -> Body:
    """The body that the unknowns stand for. It can be differentiated."""
    body = make_body(shaped_skeleton(template, shape))
    own = jnp.asarray(shape.balls)[LIKE_BALL]
    sides = np.stack([np.ones_like(BALL_SIDES), BALL_SIDES, np.ones_like(BALL_SIDES)], -1).astype(np.float32)
    radii = jnp.maximum(body.radii + own[:, 3], _THINNEST)
    return Body(body.skeleton, body.segments, body.offsets + own[:, :3] * sides, radii, body.links)


def prior_precision(template: Skeleton) -> Float[np.ndarray, "unknowns unknowns"]:
    """Precision (inverse covariance) of the unknowns, a weak one; the common scale of all lengths is free."""
    deviation = np.sqrt(_SHARE**2 + (_CENTRE / lengths_of(template)) ** 2)
    deviation[LENGTH_NAMES.index("head_top")] = _SHARE
    weights = deviation**-2
    precision = np.diag(np.concatenate([weights, np.full(2, _FINGERS_PLAY**-2), _balls_precision(template)]))
    precision[:11, :11] -= np.outer(weights, weights) / weights.sum()
    precision[np.ix_(_TOP, _TOP)] += _TOP_PLAY**-2
    return precision


def _balls_precision(template: Skeleton) -> Float[np.ndarray, " unknowns"]:
    radii, rows = np.asarray(make_body(template).radii), []
    for ball in FREE_BALLS:
        name = BALL_NAMES[ball]
        front, out, up = np.broadcast_to(_PLAYS.get(name.removeprefix("l_"), _TRUNK_PLAY), 3)
        rows.append([front, out if name.startswith("l_") else _NO_PLAY, up, _RADIUS_PLAY * radii[ball]])
    return np.ravel(rows) ** -2.0


def _bones_to() -> Float[np.ndarray, "points=20 bones=19"]:
    """Which bones lie on the way from the pelvis to each joint and tip."""
    ways = np.zeros((len(_POINTS), len(_POINTS) - 1), np.float32)
    for point in range(1, len(_POINTS)):
        ways[point] = ways[_PARENTS[point]]
        ways[point, point - 1] = 1
    return ways


_BONES_TO = _bones_to()
# Where the crown is higher and what it is thicker by: together, how far its top is above the tip of the head.
_TOP = 13 + 4 * FREE_BALLS.index(BALL_NAMES.index("crown")) + np.array([2, 3])
_FINGERS_TO = _FINGERTIPS - 1
