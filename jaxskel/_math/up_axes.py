"""The axis of a world that points up."""

import numpy as np
from jaxtyping import Float

UP_AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")


def rotation_to_z_up(up: str) -> Float[np.ndarray, "3 3"]:
    """Rotation from a world whose up axis is `up` to one with z up.

    A cyclic permutation of the axes, with two signs flipped for a negative axis: exact in floating point.

    Raises:
        ValueError: `up` is none of `UP_AXES`.
    """
    if up not in UP_AXES:
        raise ValueError(f"up axis {up!r}: give one of {', '.join(UP_AXES)}")
    rotation = np.roll(np.eye(3), "ZXY".index(up[1]), axis=1)
    return rotation if up[0] == "+" else np.diag([1.0, -1.0, -1.0]) @ rotation
