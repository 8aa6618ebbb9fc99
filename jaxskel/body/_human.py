"""The paper's template (Fig. 2a): 15 joints and 5 limb tips of a human.

Wrists and ankles are not joints but pivots inside the bones that end in palm and ball of the foot: these two bones are
rigid as long as hand and foot turn with forearm and shank.
"""

import numpy as np

from ._template import ACROSS, FREE, HINGE, Attraction, Hinge, Pivot, SkeletonTemplate

JOINT_NAMES = (
    "pelvis", "neck", "head",
    "l_shoulder", "l_elbow", "l_hand", "r_shoulder", "r_elbow", "r_hand",
    "l_hip", "l_knee", "l_foot", "r_hip", "r_knee", "r_foot",
)  # fmt: skip
JOINT_PARENTS = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 0, 12, 13)
TIP_NAMES = ("head_top", "l_fingertip", "r_fingertip", "l_toetip", "r_toetip")
TIP_PARENTS = (2, 5, 8, 11, 14)

SEGMENT_NAMES = (
    "pelvis", "chest", "head", "l_clavicle", "l_upper_arm", "l_forearm", "r_clavicle", "r_upper_arm", "r_forearm",
    "l_thigh", "l_shank", "r_thigh", "r_shank", "l_hand", "r_hand", "l_foot", "r_foot",
)  # fmt: skip
SEGMENT_PARENTS = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 0, 11, 5, 8, 10, 12)
# The segment that carries the bone ending in each joint: the hips turn with the pelvis.
SEGMENT_OF_JOINT = (0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 9, 10, 0, 11, 12)
SEGMENT_OF_TIP = (2, 13, 14, 15, 16)
# Shoulder blades and hands do not twist; elbows and knees are hinges; all other segments turn freely.
_FREEDOMS = {"clavicle": ACROSS, "hand": ACROSS, "forearm": HINGE, "shank": HINGE}
# For fits to the graph: shoulder blades move little, limbs swing freely.
_FIRMNESS = {
    "chest": 1.0, "head": 0.5, "clavicle": 3.0, "thigh": 0.2, "shank": 0.2, "upper_arm": 0.05, "forearm": 0.1
}  # fmt: skip

# The wrist is 0.29 of the way from the palm, the middle of the hand, to the elbow (de Leva 1996). The ankle is behind
# and above the ball of the foot, by 0.071 and 0.027 of the stature (Winter).
_WRIST = (0.29, 0.29, 0.29), (0.0, 0.0, 0.0)
_ANKLE = (0.0, 0.25, 0.0), (-0.071, 0.0, 0.027)
_PIVOTS = (
    Pivot("l_wrist", 5, *_WRIST), Pivot("r_wrist", 8, *_WRIST), Pivot("l_ankle", 11, *_ANKLE),
    Pivot("r_ankle", 14, *_ANKLE),
)  # fmt: skip
PIVOT_NAMES = tuple(pivot.name for pivot in _PIVOTS)
# The joint beyond each pivot and the segment that carries it there.
JOINT_OF_PIVOT = tuple(pivot.joint for pivot in _PIVOTS)
SEGMENT_OF_PIVOT = (13, 14, 15, 16)

_FRONT, _BACK = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
_L_HAND, _R_HAND, _L_FOOT, _R_FOOT = 1, 2, 3, 4
# Hips and shoulders lie beside the centre-line. Head and trunk use a path to a foot, because paths to a hand may leave
# the trunk early. The bone from knee to ball of foot leaves the centre-line, which bends at the ankle.
_ATTRACTED = {
    "neck": _L_FOOT, "head": _L_FOOT, "l_elbow": _L_HAND, "l_hand": _L_HAND, "r_elbow": _R_HAND, "r_hand": _R_HAND,
    "l_knee": _L_FOOT, "l_foot": _L_FOOT, "r_knee": _R_FOOT, "r_foot": _R_FOOT,
}  # fmt: skip


def without_side(name: str) -> str:
    """A name without its ``l_`` or ``r_``."""
    return name.removeprefix("l_").removeprefix("r_")


HUMAN_15 = SkeletonTemplate(
    name="human-15",
    joint_names=JOINT_NAMES,
    joint_parents=JOINT_PARENTS,
    tip_names=TIP_NAMES,
    tip_parents=TIP_PARENTS,
    segment_names=SEGMENT_NAMES,
    segment_parents=SEGMENT_PARENTS,
    segment_of_joint=SEGMENT_OF_JOINT,
    segment_of_tip=SEGMENT_OF_TIP,
    freedoms=tuple(_FREEDOMS.get(without_side(name), FREE) if "_" in name else FREE for name in SEGMENT_NAMES),
    inner=(0, 1),
    described_by=(0, _L_FOOT, _R_FOOT),
    attracted=tuple(
        Attraction(JOINT_NAMES.index(name), tip, *((0.0, 0.4) if name.endswith("foot") else (0.2, 1.0)))
        for name, tip in _ATTRACTED.items()
    ),
    firmness=tuple(_FIRMNESS.get(without_side(name), 0.0) for name in SEGMENT_NAMES[1:]),
    pivots=_PIVOTS,
    segment_of_pivot=SEGMENT_OF_PIVOT,
    hinges=(
        Hinge(4, 5, 20, _FRONT, 0.05, 2.5), Hinge(7, 8, 21, _FRONT, 0.05, 2.5), Hinge(10, 10, 22, _BACK, 0.05, 2.5),
        Hinge(13, 12, 23, _BACK, 0.05, 2.5),
    ),
    meanings=tuple(((name, 1.0),) for name in JOINT_NAMES + TIP_NAMES),
)  # fmt: skip
"""The paper's template."""

# Permutations that exchange left and right.
MIRROR_JOINTS = tuple(np.asarray(HUMAN_15.mirror_joints).tolist())
MIRROR_TIPS = tuple(np.asarray(HUMAN_15.mirror_tips).tolist())
