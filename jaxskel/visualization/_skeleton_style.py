"""Bones and colours of a drawn skeleton, for every kind of picture: left red, right blue, the middle green."""

import numpy as np
from jaxtyping import Float, Int, UInt8

from ..body import SkeletonTemplate

# The same as in the style sheet of the report.
LEFT, RIGHT, MIDDLE = (0xD9, 0x34, 0x2B), (0x2B, 0x6C, 0xD9), (0x2E, 0x8B, 0x40)
PEOPLE = (
    (0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00), (0x00, 0x9E, 0x73), (0xCC, 0x79, 0xA7),
    (0x56, 0xB4, 0xE9), (0xD5, 0x5E, 0x00), (0xF0, 0xE4, 0x42), (0x80, 0x80, 0x80),
)  # fmt: skip
"""A colour for each person that the colour-blind tell apart, too (Okabe and Ito, 2008), grey for black."""

# Median length of a human's bones (m).
_HUMAN_BONE = 0.2


def drawn_bones(template: SkeletonTemplate) -> Int[np.ndarray, "bones 2"]:
    """Points at the ends of each bone, its own point first: those between joints, then those at tips."""
    ends = np.arange(1, len(template.point_names))
    return np.stack([ends, template.point_parents[1:]], axis=1).astype(np.int64)


def drawn_joint_bones(template: SkeletonTemplate) -> Int[np.ndarray, "bones 2"]:
    """The bones between joints."""
    return drawn_bones(template)[: len(template.joint_names) - 1]


def colours_of(template: SkeletonTemplate) -> UInt8[np.ndarray, "points 3"]:
    """Colour of each joint, then each tip, and of the bone that ends there: red, green, blue."""
    return np.array([{"l_": LEFT, "r_": RIGHT}.get(name[:2], MIDDLE) for name in template.point_names], np.uint8)


def node_labels(template: SkeletonTemplate) -> tuple[str, ...]:
    """What the end nodes, then the inner nodes of a labelled graph are called.

    An end node has the name of the joint that its tip hangs on; its own where that is an inner node, or several tips
    hang there.
    """
    ends = [
        template.joint_names[joint] if joint not in template.inner and template.tip_parents.count(joint) == 1 else tip
        for tip, joint in zip(template.tip_names, template.tip_parents, strict=True)
    ]
    return tuple(_spoken(name) for name in (*ends, *(template.joint_names[joint] for joint in template.inner)))


def _spoken(name: str) -> str:
    side = {"l_": "left ", "r_": "right "}.get(name[:2], name[:2])
    return side + name[2:]


def thickness(template: SkeletonTemplate, points: Float[np.ndarray, "frames points 3"]) -> float:
    """How thick to draw what has the thickness 1 on a human: as its bones are long.

    Args:
        template: What the points are.
        points: Joints, then tips (m); NaN in frames without a pose.
    """
    ends, starts = drawn_bones(template).T
    lengths = np.linalg.norm(points[:, ends] - points[:, starts], axis=-1)
    known = lengths[np.isfinite(lengths)]
    return 1.0 if template.is_human or not known.size else float(np.median(known)) / _HUMAN_BONE
