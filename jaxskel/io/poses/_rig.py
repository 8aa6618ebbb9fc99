"""An animation skeleton: rotating joints with constant offsets. At rest x is to the front, y to the left, z up."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# Each joint: its name, its parent's name, and its joint or tip in the poses. The trunk rotates apart from the pelvis,
# which holds the hips, and each collar bone by itself, so these joints coincide with their parents.
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
    """Offsets and rotations of the joints, in the order of `RIG`."""

    offsets: Float[np.ndarray, "joints 3"]
    """Offset from the parent, at rest (m)."""
    root: Float[np.ndarray, "frames 3"]
    """Position of the first joint in the world (m)."""
    rotations: Float[np.ndarray, "frames joints 3 3"]
    """Rotation from rest to the world; end points have those of their parents."""


def placed(rig: Rig) -> Float[np.ndarray, "frames joints 3"]:
    """Positions of the joints in the world (m)."""
    names = [name for name, _, _ in RIG]
    points = np.empty((*rig.rotations.shape[:2], 3))
    points[:, 0] = rig.root
    for j, (_, parent, _) in enumerate(RIG[1:], 1):
        p = names.index(parent)
        points[:, j] = points[:, p] + rig.rotations[:, p] @ rig.offsets[j]
    return points
