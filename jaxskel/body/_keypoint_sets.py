"""Sets of keypoints that detectors find in images, and which point of the skeleton each of them means."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ._human import JOINT_NAMES, PIVOT_NAMES, TIP_NAMES

POINT_NAMES = JOINT_NAMES + TIP_NAMES + PIVOT_NAMES
"""Points of a skeleton that a keypoint may be a weighted mean of: joints, tips, wrists and ankles."""

# What the names of body parts mean. Detectors mean the wrist, where our hand is the palm, and the ankle, where our foot
# is the ball of the foot. The neck of those who annotate it is below ours, the seventh vertebra, and above the middle
# of the shoulders. The big toe is the base of its nail.
_MIDDLE = {
    "pelvis": {"pelvis": 1.0},
    "spine": {"pelvis": 0.5, "neck": 0.5},
    "shoulders": {"l_shoulder": 0.5, "r_shoulder": 0.5},
    "neck": {"neck": 0.6, "l_shoulder": 0.2, "r_shoulder": 0.2},
    "head top": {"head_top": 1.0},
}
_OF_A_SIDE = {
    "shoulder": {"shoulder": 1.0},
    "elbow": {"elbow": 1.0},
    "wrist": {"wrist": 1.0},
    "hip": {"hip": 1.0},
    "knee": {"knee": 1.0},
    "ankle": {"ankle": 1.0},
    "big toe": {"foot": 0.4, "toetip": 0.6},
}
MEANINGS = _MIDDLE | {
    f"{side} {part}": {f"{side}_{name}": share for name, share in mean.items()}
    for side in "lr"
    for part, mean in _OF_A_SIDE.items()
}


@dataclass(frozen=True)
class KeypointSet:
    """The keypoints of a detector, in its order.

    Attributes:
        points: Of each keypoint: shares of points of the skeleton, which sum up to one; empty if the skeleton has no
            such point, as of eyes and ears.

    Raises:
        ValueError: One line, if the points are not weighted means of `POINT_NAMES`.
    """

    name: str
    names: tuple[str, ...]
    points: tuple[Mapping[str, float], ...]

    def __post_init__(self):
        """Reject what is no set of weighted means."""
        if len(self.points) != len(self.names):
            raise ValueError(f"points: {len(self.points)} for {len(self.names)} names; give one for each keypoint")
        for keypoint, shares in zip(self.names, self.points, strict=True):
            for point in shares:
                if point not in POINT_NAMES:
                    raise ValueError(f"points: {keypoint} has {point!r}; give some of {', '.join(POINT_NAMES)}")
            if shares and abs(sum(shares.values()) - 1) > 1e-6:
                raise ValueError(f"points: shares of {keypoint} sum up to {sum(shares.values()):g}; let them be one")

    def __len__(self) -> int:
        return len(self.names)

    @property
    def shares(self) -> Float[np.ndarray, "keypoints points=24"]:
        """Shares of each of `POINT_NAMES` in each keypoint; zeros where the skeleton has no such point."""
        return np.array([[shares.get(point, 0.0) for point in POINT_NAMES] for shares in self.points])


def keypoint_set(name: str, names: str | Sequence[str], **others: str) -> KeypointSet:
    """A set of keypoints whose meaning follows from their names.

    Args:
        name: Of the set.
        names: Of the keypoints, in their order: for example ``LShoulder``, ``l_shoulder`` or ``left_shoulder``.
        **others: What other names mean: one of `MEANINGS`, for example ``MidHip="pelvis"``. Names without a meaning
            have no point.

    Raises:
        ValueError: A meaning is none of `MEANINGS`.
    """
    found = tuple(names.split() if isinstance(names, str) else names)
    for key, meaning in others.items():
        if meaning not in MEANINGS:
            raise ValueError(f"{key}: is {meaning!r}; give one of {', '.join(MEANINGS)}")
    return KeypointSet(name, found, tuple(MEANINGS.get(others.get(each, _part_of(each)), {}) for each in found))


def _part_of(name: str) -> str:
    """The part of the body in a name: `l knee` of LKnee, l_knee and left_knee; of BigToe it is two words."""
    words = "".join(f" {letter}" if letter.isupper() else letter for letter in name).replace("_", " ").lower().split()
    return " ".join({"left": "l", "right": "r"}.get(word, word) for word in words)


_FACE = "Nose LEye REye LEar REar"
_LIMBS = "LShoulder RShoulder LElbow RElbow LWrist RWrist LHip RHip LKnee RKnee LAnkle RAnkle"

COCO_17 = keypoint_set("COCO_17", f"{_FACE} {_LIMBS}")
"""The 17 keypoints of COCO, as of YOLO, HRNet, ViTPose and RTMPose."""
BODY_25 = keypoint_set(
    "BODY_25",
    "Nose Neck RShoulder RElbow RWrist LShoulder LElbow LWrist MidHip RHip RKnee RAnkle LHip LKnee LAnkle REye LEye "
    "REar LEar LBigToe LSmallToe LHeel RBigToe RSmallToe RHeel",
    Neck="shoulders",  # the middle of the shoulders, by definition
    MidHip="pelvis",
)
"""The 25 keypoints of OpenPose's default model."""
BODY_25B = keypoint_set(
    "BODY_25B",
    f"{_FACE} {_LIMBS} UpperNeck HeadTop LBigToe LSmallToe LHeel RBigToe RSmallToe RHeel",
    UpperNeck="neck",
)
"""The 25 keypoints of OpenPose's experimental model, which Pose2Sim recommended."""
HALPE_26 = keypoint_set(
    "HALPE_26",
    f"{_FACE} {_LIMBS} Head Neck Hip LBigToe RBigToe LSmallToe RSmallToe LHeel RHeel",
    Head="head top",
    Hip="pelvis",
)
"""The 26 keypoints of Halpe, as of AlphaPose and RTMPose's body with feet."""
H36M_17 = keypoint_set(
    "H36M_17",
    "Pelvis RHip RKnee RAnkle LHip LKnee LAnkle Spine Thorax Nose HeadTop LShoulder LElbow LWrist RShoulder RElbow "
    "RWrist",
    Thorax="neck",
)
"""The 17 joints of Human3.6M, as lifting networks order them."""
