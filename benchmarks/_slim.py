"""Slim bodies for recordings whose joints are known: capsules thinner than flesh instead of the silhouettes.

The paper measured with an articulated polygon model whose limbs are thin. On such a body a hand seldom touches the
trunk, so that its Table 1 can only be compared with ours on bodies alike.
"""

import equinox as eqx
import numpy as np

from jaxskel import JOINT_NAMES, Recording, make_body
from jaxskel.body import BALL_NAMES, TIP_NAMES
from jaxskel.synthetic import render

# Ends of the capsules, and the balls of the average body whose radii are theirs. Names of limbs are of the left.
_MIDDLE = ((("pelvis", "l_waist"), ("neck", "l_chest")), (("neck", "nape"), ("head", "face")),
           (("head", "face"), ("head_top", "crown")))  # fmt: skip
_SIDED = (
    (("neck", "nape"), ("l_shoulder", "l_shoulder")), (("l_shoulder", "l_shoulder"), ("l_elbow", "l_elbow")),
    (("l_elbow", "l_elbow"), ("l_hand", "l_palm")), (("l_hand", "l_palm"), ("l_fingertip", "l_finger")),
    (("pelvis", "l_seat"), ("l_hip", "l_hip")), (("l_hip", "l_hip"), ("l_knee", "l_knee")),
    (("l_knee", "l_knee"), ("l_foot", "l_ball")), (("l_foot", "l_ball"), ("l_toetip", "l_toe")),
)  # fmt: skip


def with_slim_body(recording: Recording, share: float) -> Recording:
    """The recording with silhouettes of capsules that have this share of the average body's radii.

    Raises:
        ValueError: Joints, tips or dimensions are not known.
    """
    truth = recording.truth
    if truth is None or truth.tips is None or recording.skeleton is None:
        raise ValueError(f"{recording.name}: keys 'joints', 'tips', 'rest_joints': a slim body needs known ones")
    points = dict(zip(JOINT_NAMES, np.moveaxis(truth.joints.astype(np.float64), 1, 0), strict=True))
    points |= dict(zip(TIP_NAMES, np.moveaxis(truth.tips.astype(np.float64), 1, 0), strict=True))
    radii = dict(zip(BALL_NAMES, share * np.asarray(make_body(recording.skeleton).radii), strict=True))
    capsules = [*_MIDDLE, *_SIDED, *(tuple(_mirrored(end) for end in capsule) for capsule in _SIDED)]
    ends = np.stack([np.stack([points[point] for point, _ in capsule], 1) for capsule in capsules], 1)
    sizes = np.array([[radii[ball] for _, ball in capsule] for capsule in capsules])
    slim = render(recording.cameras, ends, sizes)
    return eqx.tree_at(lambda r: r.silhouettes, recording, slim)


def _mirrored(end: tuple[str, str]) -> tuple[str, str]:
    point, ball = (name.replace("l_", "r_", 1) if name.startswith("l_") else name for name in end)
    return point, ball
