"""A body with volume: tapered capsules that move with a skeleton.

A tapered capsule is the convex hull of two balls. Each ball is fixed to one rigid segment of the skeleton, so a
capsule whose balls belong to different segments bridges the joint between them and stays closed when it bends.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.compile_cache import cached_jit
from .._runtime.kinds import check_kind
from ._human import HUMAN_15, JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, TIP_NAMES
from ._skeleton import (
    Pose,
    Skeleton,
    forward_kinematics,
    place_segments,
    rest_origins,
)
from ._template_body import balls_of_points

BALL_NAMES = (
    "l_seat", "r_seat", "l_waist", "r_waist", "l_chest", "r_chest", "l_girdle", "r_girdle", "nape", "face", "crown",
    "hair_top", "hair_low", "l_bag_top", "r_bag_top", "l_bag_low", "r_bag_low",
    "l_shoulder", "l_elbow", "l_forearm", "l_wrist", "l_palm", "l_finger",
    "r_shoulder", "r_elbow", "r_forearm", "r_wrist", "r_palm", "r_finger",
    "l_hip", "l_knee", "l_calf", "l_hem", "l_ankle", "l_heel", "l_ball", "l_toe",
    "r_hip", "r_knee", "r_calf", "r_hem", "r_ankle", "r_heel", "r_ball", "r_toe",
)  # fmt: skip
"""Balls of the body that [`make_body`][] makes."""
HAIR_BALLS, BAG_BALLS = ("hair_top", "hair_low"), ("bag_top", "bag_low")
"""Those of long hair and, on either side, of a bag: no flesh, and hidden in it unless the subject has such a part."""

_LIKE = [name.replace("r_", "l_", 1) if name.startswith("r_") else name for name in BALL_NAMES]
FREE_BALLS = tuple(ball for ball, name in enumerate(BALL_NAMES) if _LIKE[ball] == name)
"""Indices of the left and middle balls; right balls mirror the left ones."""
LIKE_BALL = np.array([FREE_BALLS.index(BALL_NAMES.index(name)) for name in _LIKE], np.int32)
"""For each ball, the index in `FREE_BALLS` of the ball that it equals or mirrors."""
BALL_SIDES = np.array([-1.0 if name.startswith("r_") else 1.0 for name in BALL_NAMES])
"""Sign of y of each ball relative to the ball that it equals or mirrors."""

HEM = 0.8
"""Share of the way from calf to ankle at which the ball ``hem`` lies, unless clothes make it thicker."""

# The average adult, ball by ball: the segment that carries it; its position as a fraction of the way from one point of
# the skeleton to another; its shift from there to the front, outwards and up; its radius. Shifts and radii are
# fractions of the stature. Names omit l_ and r_.
_Ball = tuple[str, tuple[str, float, str], tuple[float, float, float], float]
_MIDDLE_BALLS: dict[str, _Ball] = {
    "nape": ("chest", ("neck", 0.0, "neck"), (-0.002, 0.0, -0.019), 0.035),
    "face": ("head", ("neck", 0.5, "head_top"), (0.011, 0.0, -0.012), 0.045),
    "crown": ("head", ("head_top", 0.0, "head_top"), (-0.003, 0.0, -0.053), 0.052),
    # Long hair that falls from the head over the back, if there is any. Otherwise these balls are hidden in the head.
    "hair_top": ("head", ("neck", 0.5, "head_top"), (0.0, 0.0, 0.0), 0.006),
    "hair_low": ("chest", ("neck", 0.0, "neck"), (-0.002, 0.0, -0.019), 0.006),
}
_SIDED_BALLS: dict[str, _Ball] = {
    "seat": ("pelvis", ("pelvis", 0.0, "pelvis"), (0.002, 0.031, 0.002), 0.074),
    "waist": ("chest", ("pelvis", 0.30, "neck"), (0.014, 0.026, 0.001), 0.062),
    "chest": ("chest", ("pelvis", 0.66, "neck"), (0.009, 0.036, 0.008), 0.069),
    "girdle": ("clavicle", ("shoulder", 0.0, "shoulder"), (-0.001, -0.017, -0.009), 0.047),
    # A bag on the back or in front, if one is carried. Otherwise these balls are hidden in the chest.
    "bag_top": ("chest", ("pelvis", 0.66, "neck"), (0.0, 0.02, 0.0), 0.006),
    "bag_low": ("chest", ("pelvis", 0.60, "neck"), (0.0, 0.02, 0.0), 0.006),
    "shoulder": ("upper_arm", ("shoulder", 0.0, "shoulder"), (-0.003, -0.002, -0.005), 0.036),
    "elbow": ("forearm", ("elbow", 0.0, "elbow"), (0.0, 0.0, 0.0), 0.024),
    "forearm": ("forearm", ("elbow", 0.28, "wrist"), (0.0, 0.0, 0.0), 0.024),
    "wrist": ("hand", ("wrist", 0.0, "wrist"), (-0.003, -0.003, 0.0), 0.0165),
    "palm": ("hand", ("hand", 0.0, "hand"), (-0.002, -0.006, -0.002), 0.020),
    "finger": ("hand", ("hand", 0.75, "fingertip"), (0.0, 0.0, 0.0), 0.015),
    "hip": ("thigh", ("hip", 0.0, "hip"), (0.014, -0.006, -0.025), 0.064),
    "knee": ("shank", ("knee", 0.0, "knee"), (0.0, 0.0, 0.011), 0.0325),
    "calf": ("shank", ("knee", 0.30, "ankle"), (-0.017, 0.0, 0.003), 0.0355),
    # Where trousers end. Without them it lies on the way from calf to ankle, see `HEM`.
    "hem": ("shank", ("knee", 0.86, "ankle"), (-0.009, -0.004, 0.001), 0.0207),
    "ankle": ("foot", ("ankle", 0.0, "ankle"), (-0.007, -0.005, 0.0), 0.017),
    "heel": ("foot", ("ankle", 0.0, "ankle"), (-0.019, 0.0, -0.020), 0.019),
    "ball": ("foot", ("foot", 0.0, "foot"), (-0.004, -0.002, -0.003), 0.0165),
    "toe": ("foot", ("toetip", 0.0, "toetip"), (-0.010, 0.0, 0.0), 0.011),
}
_MIDDLE_LINKS = (
    ("l_seat", "r_seat"), ("l_waist", "r_waist"), ("l_chest", "r_chest"), ("nape", "face"), ("face", "crown"),
    ("hair_top", "hair_low"),
)  # fmt: skip
# Links of each side, from the trunk outwards.
_SIDED_LINKS = (
    ("seat", "waist"), ("waist", "chest"), ("chest", "girdle"), ("nape", "girdle"), ("chest", "nape"),
    ("bag_top", "bag_low"),
    ("shoulder", "elbow"), ("elbow", "forearm"), ("forearm", "wrist"), ("wrist", "palm"), ("palm", "finger"),
    ("hip", "knee"), ("knee", "calf"), ("calf", "hem"), ("hem", "ankle"), ("ankle", "heel"), ("heel", "ball"),
    ("ankle", "ball"), ("ball", "toe"),
)  # fmt: skip


_POINTS = JOINT_NAMES + TIP_NAMES + PIVOT_NAMES


class _Places(NamedTuple):
    """The average adult as arrays: one operation places all balls, which compiles faster than one per ball.

    Attributes:
        starts: Indices into `_POINTS`.
        shifts: Fractions of the stature.
        radii: Fractions of the stature.
    """

    carriers: Int[np.ndarray, " balls"]
    starts: Int[np.ndarray, " balls"]
    ends: Int[np.ndarray, " balls"]
    shares: Float[np.ndarray, "balls 1"]
    shifts: Float[np.ndarray, "balls 3"]
    radii: Float[np.ndarray, " balls"]


class Body(eqx.Module):
    """Balls fixed to the segments of a skeleton, and the capsules between them. See [`make_body`][].

    The topology is static, because indices that the compiler knows cost nothing.

    Attributes:
        offsets: Centre of each ball at rest, relative to the point that its segment turns about (m, body frame).
        radii: Radius of each ball (m).
    """

    skeleton: Skeleton
    offsets: Float[Array | np.ndarray, "balls 3"]
    radii: Float[Array | np.ndarray, " balls"]
    _segments: tuple[int, ...] = eqx.field(static=True)
    _links: tuple[tuple[int, int], ...] = eqx.field(static=True)

    def __init__(
        self,
        skeleton: Skeleton,
        segments: Int[np.ndarray, " balls"],
        offsets: Float[Array | np.ndarray, "balls 3"],
        radii: Float[Array | np.ndarray, " balls"],
        links: Int[np.ndarray, "capsules 2"],
    ):
        self.skeleton, self.offsets, self.radii = skeleton, offsets, radii
        self._segments = tuple(int(segment) for segment in segments)
        self._links = tuple((int(first), int(second)) for first, second in links)

    @property
    def segments(self) -> Int[np.ndarray, " balls"]:
        """Segment that carries each ball, an index into `SEGMENT_NAMES`."""
        return np.array(self._segments, np.int32)

    @property
    def links(self) -> Int[np.ndarray, "capsules 2"]:
        """Indices of the two balls of each capsule."""
        return np.array(self._links, np.int32).reshape(-1, 2)


def _places() -> _Places:
    rows = []
    for name, sign in zip(BALL_NAMES, BALL_SIDES, strict=True):
        side = "" if name in _MIDDLE_BALLS else name[:2]
        ball = (_SIDED_BALLS if side else _MIDDLE_BALLS)[name.removeprefix(side)]
        carrier, (start, share, end), (front, out, up), radius = ball
        first, last = (_POINTS.index(side + name if side + name in _POINTS else name) for name in (start, end))
        segment = SEGMENT_NAMES.index(side + carrier if side + carrier in SEGMENT_NAMES else carrier)
        rows.append((segment, first, last, [share], [front, sign * out, up], radius))
    carriers, starts, ends, shares, shifts, radii = map(np.array, zip(*rows, strict=True))
    indices = np.array([carriers, starts, ends], np.int32)
    return _Places(indices[0], indices[1], indices[2], shares, shifts, radii)


_PLACES = _places()


def make_body(skeleton: Skeleton) -> Body:
    """An average adult around a skeleton of any proportions, or the capsules of another template.

    [`calibrate_body`][jaxskel.pipeline.calibrate_body] fits it to a subject.

    Radii, and shifts of the flesh from the joint centres, are fractions of the stature: means over a man and a
    woman (two skinned meshes), fitted to their visual hulls at known joints.
    """
    check_kind("skeleton", skeleton, Skeleton, "a Skeleton, such as default_adult()")
    if skeleton.template != HUMAN_15:
        return Body(skeleton, *balls_of_points(skeleton))
    # NumPy arrays are computed in double precision. Traced arrays keep their type, so that derivatives pass through.
    xp = skeleton.rest_joints.__array_namespace__()
    points = xp.concatenate([skeleton.rest_joints, skeleton.rest_tips, skeleton.pivots])
    points = points.astype(np.float64) if xp is np else points
    start, size, at = points[_PLACES.starts], skeleton.height, _PLACES
    centres = start + at.shares * (points[at.ends] - start) + size * at.shifts
    return Body(skeleton, at.carriers, centres - rest_origins(skeleton)[at.carriers], size * at.radii, LINKS)


def _links() -> Int[np.ndarray, "capsules 2"]:
    pairs = [*_MIDDLE_LINKS]
    for side in ("l_", "r_"):
        sided = [tuple(name if name == "nape" else side + name for name in pair) for pair in _SIDED_LINKS]
        pairs += [(first, second) for first, second in sided]
    return np.array([[BALL_NAMES.index(name) for name in pair] for pair in pairs], np.int32)


LINKS = _links()
"""Indices of the two balls of each capsule of the body that [`make_body`][] makes."""


def limb_capsules(*limbs: str) -> Bool[np.ndarray, " capsules"]:
    """Mask of the capsules of [`make_body`][]'s body in any of ``l_arm``, ``r_arm``, ``l_leg`` and ``r_leg``."""
    first = {"arm": "shoulder", "leg": "hip"}
    last = {"arm": "finger", "leg": "toe"}
    mask = np.zeros(len(LINKS), bool)
    for limb in limbs:
        side, kind = limb[:2], limb[2:]
        low, high = BALL_NAMES.index(side + first[kind]), BALL_NAMES.index(side + last[kind])
        mask |= ((low <= LINKS) & (high >= LINKS)).all(1)
    return mask


def ball_centres(
    body: Body,
    origins: Float[Array | np.ndarray, "*frames segments 3"],
    rotations: Float[Array | np.ndarray, "*frames segments 3 3"],
) -> Float[Array | np.ndarray, "*frames balls 3"]:
    """Centres of the balls in the world (m), for NumPy or JAX arrays."""
    # Column by column, because XLA is slow at products of such small matrices.
    turned = rotations[..., body.segments, :, :]
    offsets = body.offsets.reshape(*(1,) * (turned.ndim - 3), -1, 1, 3)
    return origins[..., body.segments, :] + sum(turned[..., axis] * offsets[..., axis] for axis in range(3))


def capsule_ends(
    body: Body,
    origins: Float[Array | np.ndarray, "*frames segments 3"],
    rotations: Float[Array | np.ndarray, "*frames segments 3 3"],
) -> Float[Array | np.ndarray, "*frames capsules 2 3"]:
    """Centres of the balls at both ends of each capsule in the world (m), for NumPy or JAX arrays."""
    return ball_centres(body, origins, rotations)[..., body.links, :]


def place_body(
    body: Body, pose: Pose
) -> tuple[Float[np.ndarray, "frames capsules 2 3"], Float[np.ndarray, "capsules 2"]]:
    """Place the capsules of every frame.

    Args:
        body: The body.
        pose: A stack of poses, with the axis ``frames``.

    Returns:
        The centres of the balls at both ends of each capsule in the world (m) and their radii (m).
    """
    single = Pose(jnp.asarray(pose.root, jnp.float32), jnp.asarray(pose.rotations, jnp.float32))
    origins = np.asarray(_origins(body.skeleton, single), np.float64)
    ends = capsule_ends(body, origins, np.asarray(pose.rotations))
    return np.asarray(ends), np.asarray(body.radii)[body.links]


@cached_jit
def place_joints(
    skeleton: Skeleton, pose: Pose
) -> tuple[Float[Array, "frames joints 3"], Float[Array, "frames tips 3"]]:
    """Forward kinematics of a stack of poses: joints and tips in the world (m)."""
    return jax.vmap(forward_kinematics, in_axes=(None, 0))(skeleton, pose)


@cached_jit
def _origins(skeleton: Skeleton, pose: Pose) -> Float[Array, "frames segments 3"]:
    return jax.vmap(lambda one: place_segments(skeleton, one)[2])(pose)
