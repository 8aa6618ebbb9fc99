"""A skeleton for animation: joints with constant offsets that turn. At rest x is to the front, y to the left, z up."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

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
_SIDES = (("Left", "l_"), ("Right", "r_"))
RIG = _TRUNK + tuple(
    (name.format(side), parent.format(side), point.format(letter))
    for limb in (_ARM, _LEG)
    for side, letter in _SIDES
    for name, parent, point in limb
)
"""Name, parent, and the joint or tip of the poses (none for wrists and ankles), depth first."""
ENDS = tuple(name for name, _, _ in RIG if name not in {parent for _, parent, _ in RIG})


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
