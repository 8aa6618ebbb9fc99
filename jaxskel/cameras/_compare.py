"""How far two calibrations of the same cameras are apart, whatever worlds they are in."""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ._cameras import Cameras


class RigDifference(eqx.Module):
    """Of two rigs, the first brought upon the second by the best similarity."""

    angles: Float[np.ndarray, " cams"]
    """Between the rotations of each camera (rad)."""
    distances: Float[np.ndarray, " cams"]
    """Between its optical centres, in the second rig's world (m)."""
    scale: float
    """Of the second world by the first."""


def compare_rigs(cameras: Cameras, reference: Cameras) -> RigDifference:
    """Compare extrinsics up to a rigid motion and a scale of the whole rig, which silhouettes cannot tell.

    The turn of the world is the mean of those that the cameras ask for (chordal mean), scale and shift are the least
    squares of the optical centres.

    Args:
        cameras: A rig of two cameras or more that do not all stand in one place.
        reference: The same cameras in the same order.

    Raises:
        ValueError: The rigs do not have the same number of cameras.
    """
    if len(cameras) != len(reference):
        raise ValueError(f"{len(cameras)} and {len(reference)} cameras cannot be compared: give the same ones")
    one, other = np.asarray(cameras.R, np.float64), np.asarray(reference.R, np.float64)
    left, _, right = np.linalg.svd(np.einsum("cji,cjk->ik", other, one))
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    apart = np.linalg.norm(one @ turn.T - other, axis=(1, 2))
    start, end = cameras.centres @ turn.T, reference.centres
    start, end = start - start.mean(0), end - end.mean(0)
    scale = float((start * end).sum() / (start**2).sum())
    # The Frobenius norm of a difference of rotations is sqrt(8) times the sine of half the angle.
    angles = 2 * np.arcsin(np.minimum(apart / np.sqrt(8.0), 1.0))
    return RigDifference(angles, np.linalg.norm(scale * start - end, axis=1), scale)
