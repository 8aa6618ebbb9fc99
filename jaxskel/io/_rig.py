"""A chain of joints with constant offsets that stands where poses stand: inverse kinematics.

Body frame, at rest: x to the front, y to the left, z up; a T-pose, the palms down.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .._rotations import frame
from .._skeleton import JOINT_NAMES, TIP_NAMES, default_adult
from ._twist import hinge_across, hinged, swung, unit

# Each joint: its name, that of its parent, and the joint or tip of the poses that it is. The trunk turns apart from the
# pelvis in which the hips are, and each collar bone by itself, so that these begin where their parents do.
_TRUNK = (
    ("Hips", "", "pelvis"), ("Spine", "Hips", "pelvis"), ("Neck", "Spine", "neck"), ("Head", "Neck", "head"),
    ("HeadTop", "Head", "head_top"),
)  # fmt: skip
_ARM = (
    ("{}Shoulder", "Spine", "neck"), ("{}Arm", "{}Shoulder", "{}shoulder"), ("{}ForeArm", "{}Arm", "{}elbow"),
    ("{}Hand", "{}ForeArm", ""), ("{}Palm", "{}Hand", "{}hand"), ("{}Fingertip", "{}Palm", "{}fingertip"),
)  # fmt: skip
_LEG = (
    ("{}UpLeg", "Hips", "{}hip"), ("{}Leg", "{}UpLeg", "{}knee"), ("{}Foot", "{}Leg", ""),
    ("{}ToeBase", "{}Foot", "{}foot"), ("{}Toetip", "{}ToeBase", "{}toetip"),
)  # fmt: skip
_SIDES = (("Left", "l_", 1.0), ("Right", "r_", -1.0))
RIG = _TRUNK + tuple(
    (name.format(side), parent.format(side), point.format(letter))
    for limb in (_ARM, _LEG)
    for side, letter, _ in _SIDES
    for name, parent, point in limb
)
"""Name, parent, and the joint or tip of the poses (none for wrists and ankles), depth first."""
ENDS = tuple(name for name, _, _ in RIG if name not in {parent for _, parent, _ in RIG})

_FRONT, _LEFT, _UP = np.eye(3)
# The hips are in line with the pelvis where they are nearer to it than this (m), half the exactness of a file, or than
# ten times the spread of that distance: then the triangle does not show how the pelvis is turned about that line.
_IN_LINE, _SPREADS = 5e-5, 10.0


@dataclass(frozen=True)
class Rig:
    """Joints of `RIG` in the order there, and how they turn."""

    offsets: Float[np.ndarray, "joints 3"]
    """From the parent, at rest (m)."""
    root: Float[np.ndarray, "frames 3"]
    """The first joint in the world (m)."""
    rotations: Float[np.ndarray, "frames joints 3 3"]
    """From rest to the world; those of end points are those of their parents."""


def placed(rig: Rig) -> Float[np.ndarray, "frames joints 3"]:
    """Joints in the world (m)."""
    names = [name for name, _, _ in RIG]
    points = np.empty((*rig.rotations.shape[:2], 3))
    points[:, 0] = rig.root
    for j, (_, parent, _) in enumerate(RIG[1:], 1):
        p = names.index(parent)
        points[:, j] = points[:, p] + rig.rotations[:, p] @ rig.offsets[j]
    return points


def fit_rig(joints: Float[np.ndarray, "frames joints=15 3"], tips: Float[np.ndarray, "frames tips=5 3"]) -> Rig:
    """Constant offsets and true rotations that put the joints where those of poses are.

    Exactly, where the bones have constant lengths; wrists and ankles take up what hands and feet turn. Lengths that
    vary are replaced by their medians, and each bone then points to the end that it should reach.

    Args:
        joints: Joints in a world with z up (m), all finite.
        tips: Limb tips (m).
    """
    at = {name: joints[:, i] for i, name in enumerate(JOINT_NAMES)}
    at |= {name: tips[:, i] for i, name in enumerate(TIP_NAMES)}
    chain = _Chain(at["pelvis"])
    pelvis, hips = _pelvis(at)
    chain.turn("Hips", pelvis)
    chain.put("Spine", "Hips", np.zeros(3))
    spine = at["neck"] - at["pelvis"]
    chest = frame(spine, at["l_shoulder"] - at["r_shoulder"])
    chain.turn("Spine", chest)
    chain.put("Neck", "Spine", _length(spine) * _UP)
    chain.aim("Neck", "Head", _UP, _length(at["head"] - at["neck"]), at["head"], chest)
    chain.aim("Head", "HeadTop", _UP, _length(at["head_top"] - at["head"]), at["head_top"], chain.rotations["Neck"])
    for side, letter, sign in _SIDES:
        of = {name[2:]: points for name, points in at.items() if name.startswith(letter)}
        collar = of["shoulder"] - at["neck"]
        chain.put(side + "Shoulder", "Spine", chain.offsets["Neck"])
        # As it is held mostly, so that the rest pose has the shoulders of a person.
        held = unit(np.median(np.einsum("fji,fj->fi", chest, unit(collar)), axis=0))
        chain.aim(side + "Shoulder", side + "Arm", held, _length(collar), of["shoulder"], chest)
        arm = _Limb(sign * _LEFT, sign * _LEFT, sign * _LEFT, -sign * _UP, one_way=False)
        names = [side + name for name in ("Arm", "ForeArm", "Hand", "Palm", "Fingertip")]
        points = [of[name] for name in ("shoulder", "elbow", "hand", "fingertip")]
        _aim_limb(chain, names, arm, points, _SHARES["hand"], chest)
        chain.put(side + "UpLeg", "Hips", hips[letter])
        leg = _Limb(-_UP, unit(_FOOT), _FRONT, _LEFT, one_way=True)
        names = [side + name for name in ("UpLeg", "Leg", "Foot", "ToeBase", "Toetip")]
        points = [of[name] for name in ("hip", "knee", "foot", "toetip")]
        _aim_limb(chain, names, leg, points, _SHARES["foot"], pelvis)
    return chain.rig()


class _Chain:
    """What is known of a rig, from the root outwards."""

    def __init__(self, root: np.ndarray):
        self.offsets, self.rotations, self.points = {"Hips": np.zeros(3)}, {}, {"Hips": root}

    def turn(self, name: str, rotations: np.ndarray) -> None:
        self.rotations[name] = rotations

    def put(self, name: str, parent: str, offset: np.ndarray) -> None:
        self.offsets[name] = offset
        self.points[name] = self.points[parent] + self.rotations[parent] @ offset

    def aim(
        self, name: str, child: str, rest: np.ndarray, length: float, goal: np.ndarray, parents: np.ndarray
    ) -> None:
        """Turn a joint by the least angle from its parent so that its child is where it should be."""
        self.turn(name, swung(parents, rest, unit(goal - self.points[name])))
        self.put(child, name, length * rest)

    def rig(self) -> Rig:
        for name in ENDS:
            self.turn(name, self.rotations[next(parent for end, parent, _ in RIG if end == name)])
        names = [name for name, _, _ in RIG]
        return Rig(
            np.stack([self.offsets[name] for name in names]), self.points["Hips"],
            np.stack([self.rotations[name] for name in names], 1),
        )  # fmt: skip


@dataclass(frozen=True)
class _Limb:
    """Unit vectors at rest: along its two long bones, along its end, along its tip; and its hinge."""

    bone: np.ndarray
    end: np.ndarray
    tip: np.ndarray
    hinge: np.ndarray
    one_way: bool


def _aim_limb(
    chain: _Chain, names: list[str], limb: _Limb, points: list[np.ndarray], shares: tuple[float, float],
    parents: np.ndarray,
) -> None:  # fmt: skip
    """Turn upper and lower bone, end (from wrist or ankle) and tip of a limb.

    Args:
        chain: Where the first joint is placed already.
        names: Of its joints, first to last.
        limb: The limb at rest.
        points: Where its first, middle and last joint and its tip should be.
        shares: Lengths of lower bone and end, as shares of the distance of their far ends.
        parents: Rotations of what the limb hangs on.
    """
    first, middle, last, tip = points
    upper = _length(middle - first)
    direction = unit(middle - chain.points[names[0]])
    start = chain.points[names[0]] + upper * direction
    way = last - start
    lower, end = _two_lengths(last - middle, shares)
    # The pivot is where its distances say, in the plane of the limb's end, on the side away from the tip.
    line, toward = unit(way), unit(tip - last)
    side = hinge_across(line, np.cross(toward, line), parents, limb.bone, limb.hinge, one_way=False)
    distance = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
    along = np.minimum((distance**2 + lower**2 - end**2) / (2 * distance), lower)
    across = np.sqrt(np.maximum(lower**2 - along**2, 0.0))
    pivot = start + along[:, None] * line - across[:, None] * np.cross(line, side)
    second = unit(pivot - start)
    hinges = hinge_across(direction, np.cross(direction, second), parents, limb.bone, limb.hinge, limb.one_way)
    chain.turn(names[0], hinged(limb.bone, limb.hinge, direction, hinges))
    chain.put(names[1], names[0], upper * limb.bone)
    hinges = unit(hinges - second * (second * hinges).sum(-1, keepdims=True))
    chain.turn(names[1], hinged(limb.bone, limb.hinge, second, hinges))
    chain.put(names[2], names[1], lower * limb.bone)
    chain.aim(names[2], names[3], limb.end, end, last, chain.rotations[names[1]])
    chain.aim(names[3], names[4], limb.tip, _length(tip - last), tip, chain.rotations[names[2]])


def _two_lengths(bones: np.ndarray, shares: tuple[float, float]) -> tuple[float, float]:
    """Lengths of two bones that span every distance that occurs between their far ends: an average body's, or near."""
    distances = np.linalg.norm(bones, axis=-1)
    shortest, longest = float(distances.min()), float(distances.max())
    middle = float(np.median(distances))
    end = max(shares[1] * middle, (longest - shortest) / 2)
    return min(max(shares[0] * middle, longest - end), shortest + end), end


def _pelvis(at: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Rotations of the pelvis, and the hips in it at rest."""
    to_hips = {letter: at[letter + "hip"] - at["pelvis"] for letter in ("l_", "r_")}
    across, middle = to_hips["l_"] - to_hips["r_"], (to_hips["l_"] + to_hips["r_"]) / 2
    left, spine = unit(across), unit(at["neck"] - at["pelvis"])
    down = middle - left * (left * middle).sum(-1, keepdims=True)
    height = np.linalg.norm(down, axis=-1)
    front = unit(np.cross(left, spine))
    if height.min() > max(_IN_LINE, _SPREADS * float(height.std())):
        triangle = np.stack([unit(down), left, np.cross(unit(down), left)], -1)
        # Where the spine is upright on average, so that the rest pose stands upright.
        to_front = np.median(triangle.swapaxes(-1, -2) @ front[..., None], axis=0)[:, 0]
        to_front = unit(to_front * [1.0, 0.0, 1.0])
        rotations = triangle @ np.stack([to_front, _LEFT, np.cross(to_front, _LEFT)], -1)
    else:
        rotations = np.stack([front, left, np.cross(front, left)], -1)
    hips = {letter: np.median(np.einsum("fji,fj->fi", rotations, way), axis=0) for letter, way in to_hips.items()}
    return rotations, hips


def _length(bones: np.ndarray) -> float:
    return float(np.median(np.linalg.norm(bones, axis=-1)))


def _template() -> tuple[dict[str, tuple[float, float]], np.ndarray]:
    """Of an average adult: lengths before and beyond wrist and ankle by those across them; the foot at rest."""
    skeleton = default_adult()
    joints, pivots = np.asarray(skeleton.rest_joints), np.asarray(skeleton.pivots)
    shares = {}
    for name, pivot in (("hand", 0), ("foot", 2)):
        near, far = joints[JOINT_NAMES.index("l_" + ("elbow" if name == "hand" else "knee"))], joints[
            JOINT_NAMES.index("l_" + name)
        ]  # fmt: skip
        whole = np.linalg.norm(far - near)
        shares[name] = (
            float(np.linalg.norm(pivots[pivot] - near) / whole),
            float(np.linalg.norm(far - pivots[pivot]) / whole),
        )
    foot = joints[JOINT_NAMES.index("l_foot")] - pivots[2]
    return shares, foot * [1.0, 0.0, 1.0]


_SHARES, _FOOT = _template()
