"""Points, bones and colours of a drawn skeleton, for every kind of picture: left red, right blue, the middle green."""

import numpy as np
from jaxtyping import Int, UInt8

from ..body import JOINT_NAMES, JOINT_PARENTS, TIP_NAMES, TIP_PARENTS

POINT_NAMES = JOINT_NAMES + TIP_NAMES
BONES: Int[np.ndarray, "bones=19 2"] = np.stack(
    [np.arange(1, len(POINT_NAMES)), np.array(JOINT_PARENTS[1:] + TIP_PARENTS)], axis=1
)
"""Points at the ends of each bone, its own point first. The first 14 bones are between joints, the others at tips."""
JOINT_BONES = BONES[: len(JOINT_NAMES) - 1]

# The same as in the style sheet of the report.
LEFT, RIGHT, MIDDLE = (0xD9, 0x34, 0x2B), (0x2B, 0x6C, 0xD9), (0x2E, 0x8B, 0x40)
COLOURS: UInt8[np.ndarray, "points=20 3"] = np.array(
    [{"l_": LEFT, "r_": RIGHT}.get(name[:2], MIDDLE) for name in POINT_NAMES], np.uint8
)
"""Colour of each point and of the bone that ends there, red, green, blue."""
