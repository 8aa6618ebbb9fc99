"""Fits an animation skeleton to the joints and tips of poses.

At rest it is in a T-pose, palms down: x to the front, y to the left, z up.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..._math.rotations import frame
from ..._math.vectors import unit
from ...body import JOINT_NAMES, TIP_NAMES, default_adult
from ._rig import RIG, Rig
from ._twist import hinge_across, hinged, swung

_FRONT, _LEFT, _UP = np.eye(3)
# The hips count as in line with the pelvis if they are nearer to that line than this (m), half the precision of a file,
# or than ten times the spread of that distance: then their triangle does not show the rotation about the line.
_IN_LINE, _SPREADS = 5e-5, 10.0


@dataclass(frozen=True)
class _Joint:
    offset: Float[np.ndarray, "3"]
    """Offset from the parent, at rest (m)."""
    points: Float[np.ndarray, "frames 3"]
    """Position in the world (m)."""
    rotations: Float[np.ndarray, "frames 3 3"]
    """Rotation from rest to the world."""


@dataclass(frozen=True)
class _Limb:
    """Unit vectors of a limb at rest, and the proportions of its bones."""

    bone: Float[np.ndarray, "3"]
    """Direction of its two long bones."""
    end: Float[np.ndarray, "3"]
    """Direction from wrist to palm, or from ankle to ball of the foot."""
    tip: Float[np.ndarray, "3"]
    hinge: Float[np.ndarray, "3"]
    one_way: bool
    """Whether its hinge only bends to one side."""
    shares: tuple[float, float]
    """Lengths before and beyond wrist or ankle, as shares of the distance from elbow to palm, or knee to ball."""


def fit_rig(joints: Float[np.ndarray, "frames joints=15 3"], tips: Float[np.ndarray, "frames tips=5 3"]) -> Rig:
    """Constant offsets and proper rotations that place the joints where the poses have them.

    The fit is exact if the bones have constant lengths; wrists and ankles absorb the rotation of hands and feet.
    Varying lengths are replaced by their medians, and each bone then points to its target end.

    Args:
        joints: Joints in a world with z up (m), all finite.
        tips: Limb tips in the same world (m).
    """
    at = {name: joints[:, i] for i, name in enumerate(JOINT_NAMES)}
    at |= {name: tips[:, i] for i, name in enumerate(TIP_NAMES)}
    pelvis, hips = _pelvis(at)
    found = {"Hips": _Joint(np.zeros(3), at["pelvis"], pelvis)}
    chest = frame(at["neck"] - at["pelvis"], at["l_shoulder"] - at["r_shoulder"])
    found["Spine"] = _below(found["Hips"], np.zeros(3), chest)
    to_neck = _length(at["neck"] - at["pelvis"]) * _UP
    found["Neck"] = _aimed(found["Spine"], to_neck, _UP, at["head"])
    found["Head"] = _aimed(found["Neck"], _length(at["head"] - at["neck"]) * _UP, _UP, at["head_top"])
    found["HeadTop"] = _end(found["Head"], _length(at["head_top"] - at["head"]) * _UP)
    for side, letter, sign in (("Left", "l_", 1.0), ("Right", "r_", -1.0)):
        of = {name[2:]: points for name, points in at.items() if name.startswith(letter)}
        collar = of["shoulder"] - at["neck"]
        # Median direction, so that the rest pose has the shoulders of a person.
        held = unit(np.median(np.einsum("fji,fj->fi", chest, unit(collar)), axis=0))
        found[side + "Shoulder"] = _aimed(found["Spine"], to_neck, held, of["shoulder"])
        out = sign * _LEFT
        arm = _Limb(out, out, out, -sign * _UP, one_way=False, shares=_HAND)
        points = [of[name] for name in ("shoulder", "elbow", "hand", "fingertip")]
        chain = _limb(found[side + "Shoulder"], _length(collar) * held, arm, chest, *points)
        names = ("Arm", "ForeArm", "Hand", "Palm", "Fingertip")
        found |= {side + name: joint for name, joint in zip(names, chain, strict=True)}
        leg = _Limb(-_UP, _FOOT_AT_REST, _FRONT, _LEFT, one_way=True, shares=_FOOT)
        points = [of[name] for name in ("hip", "knee", "foot", "toetip")]
        chain = _limb(found["Hips"], hips[letter], leg, pelvis, *points)
        names = ("UpLeg", "Leg", "Foot", "ToeBase", "Toetip")
        found |= {side + name: joint for name, joint in zip(names, chain, strict=True)}
    ordered = [found[name] for name, _, _ in RIG]
    return Rig(
        np.stack([joint.offset for joint in ordered]), at["pelvis"], np.stack([joint.rotations for joint in ordered], 1)
    )


def _below(parent: _Joint, offset: np.ndarray, rotations: np.ndarray) -> _Joint:
    return _Joint(offset, parent.points + parent.rotations @ offset, rotations)


def _aimed(parent: _Joint, offset: np.ndarray, rest: np.ndarray, goal: np.ndarray) -> _Joint:
    """A joint rotated from its parent by the least angle that makes `rest` point to a goal."""
    placed = _end(parent, offset)
    return _Joint(offset, placed.points, swung(parent.rotations, rest, unit(goal - placed.points)))


def _end(parent: _Joint, offset: np.ndarray) -> _Joint:
    return _below(parent, offset, parent.rotations)


def _limb(
    parent: _Joint, offset: np.ndarray, limb: _Limb, trunk: np.ndarray, begin: np.ndarray, middle: np.ndarray,
    last: np.ndarray, tip: np.ndarray,
) -> tuple[_Joint, ...]:  # fmt: skip
    """The joints of a limb.

    Args:
        parent: Joint to which the limb is attached.
        offset: Offset from there to the limb's first joint, at rest (m).
        limb: The limb at rest.
        trunk: Rotations of the trunk at the limb, which the limb's twist follows.
        begin: Target position of shoulder or hip (world, m).
        middle: Target position of elbow or knee.
        last: Target position of palm or ball of the foot.
        tip: Target position of the tip.
    """
    start = _end(parent, offset)
    upper = _length(middle - begin)
    lower, end = _two_lengths(last - middle, limb.shares)
    first = unit(middle - start.points)
    bent = start.points + upper * first
    # The distances determine wrist or ankle, in the plane of hand or foot, on the side away from the tip.
    way, toward = last - bent, unit(tip - last)
    line, distance = unit(way), np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
    side = hinge_across(line, np.cross(toward, line), trunk, limb.bone, limb.hinge, one_way=False)
    along = np.minimum((distance**2 + lower**2 - end**2) / (2 * distance), lower)
    across = np.sqrt(np.maximum(lower**2 - along**2, 0.0))
    second = unit(along[:, None] * line - across[:, None] * np.cross(line, side))
    # Both bones share one hinge.
    hinges = hinge_across(first, np.cross(first, second), trunk, limb.bone, limb.hinge, limb.one_way)
    one = _below(parent, offset, hinged(limb.bone, limb.hinge, first, hinges))
    hinges = unit(hinges - second * (second * hinges).sum(-1, keepdims=True))
    two = _below(one, upper * limb.bone, hinged(limb.bone, limb.hinge, second, hinges))
    three = _aimed(two, lower * limb.bone, limb.end, last)
    four = _aimed(three, end * limb.end, limb.tip, tip)
    return one, two, three, four, _end(four, _length(tip - last) * limb.tip)


def _two_lengths(bones: Float[np.ndarray, "frames 3"], shares: tuple[float, float]) -> tuple[float, float]:
    """Lengths of two bones that can span all distances between their far ends, close to an average body's."""
    distances = np.linalg.norm(bones, axis=-1)
    shortest, longest = float(distances.min()), float(distances.max())
    middle = float(np.median(distances))
    end = max(shares[1] * middle, (longest - shortest) / 2)
    return min(max(shares[0] * middle, longest - end), shortest + end), end


def _pelvis(at: dict[str, np.ndarray]) -> tuple[Float[np.ndarray, "frames 3 3"], dict[str, np.ndarray]]:
    """Rotations of the pelvis, and the hips in its frame at rest (m)."""
    to_hips = {letter: at[letter + "hip"] - at["pelvis"] for letter in ("l_", "r_")}
    across, middle = to_hips["l_"] - to_hips["r_"], (to_hips["l_"] + to_hips["r_"]) / 2
    left = unit(across)
    down = middle - left * (left * middle).sum(-1, keepdims=True)
    height = np.linalg.norm(down, axis=-1)
    front = unit(np.cross(left, at["neck"] - at["pelvis"]))
    rotations = np.stack([front, left, np.cross(front, left)], -1)
    if height.min() > max(_IN_LINE, _SPREADS * float(height.std())):
        triangle = np.stack([unit(down), left, np.cross(unit(down), left)], -1)
        # Rotate so that the spine is upright in the median, and so in the rest pose.
        ahead = unit(np.median(np.einsum("fji,fj->fi", triangle, front), axis=0) * [1.0, 0.0, 1.0])
        rotations = triangle @ np.stack([ahead, _LEFT, np.cross(ahead, _LEFT)], -1)
    hips = {letter: np.median(np.einsum("fji,fj->fi", rotations, way), axis=0) for letter, way in to_hips.items()}
    return rotations, hips


def _length(bones: Float[np.ndarray, "frames 3"]) -> float:
    return float(np.median(np.linalg.norm(bones, axis=-1)))


def _average(near: str, far: str, pivot: int) -> tuple[tuple[float, float], Float[np.ndarray, "3"]]:
    """For an average adult: relative lengths before and beyond wrist or ankle, and the direction beyond."""
    skeleton = default_adult()
    ends = [np.asarray(skeleton.rest_joints)[JOINT_NAMES.index(name)] for name in (near, far)]
    middle = np.asarray(skeleton.pivots)[pivot]
    whole, before, beyond = (
        float(np.linalg.norm(bone)) for bone in (ends[1] - ends[0], middle - ends[0], ends[1] - middle)
    )
    # Toes point straight ahead.
    return (before / whole, beyond / whole), unit((ends[1] - middle) * [1.0, 0.0, 1.0])


_HAND, _ = _average("l_elbow", "l_hand", 0)
_FOOT, _FOOT_AT_REST = _average("l_knee", "l_foot", 2)
