"""Difference between two calibrations of the same cameras, independent of their worlds."""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from .._math.rotations import nearest_rotation
from ._cameras import Cameras


class RigDifference(eqx.Module):
    """Difference of two rigs after the best similarity has aligned the first with the second.

    Attributes:
        angles: Angle between the two rotations of each camera (rad).
        distances: Distance between the two optical centres of each camera, in the second rig's world (m).
        scale: Scale of the second world relative to the first.
    """

    angles: Float[np.ndarray, " cams"]
    distances: Float[np.ndarray, " cams"]
    scale: float


def compare_rigs(cameras: Cameras, reference: Cameras) -> RigDifference:
    """Compare extrinsics up to a rigid motion and a scale of the whole rig, which silhouettes cannot determine.

    The rotation between the worlds is the chordal mean over the cameras; scale and translation are the least-squares
    fit of the optical centres.

    Args:
        cameras: A rig of two cameras or more that are not all in one place.
        reference: The same cameras in the same order.

    Raises:
        ValueError: The rigs do not have the same number of cameras.
    """
    if len(cameras) != len(reference):
        raise ValueError(f"{len(cameras)} and {len(reference)} cameras cannot be compared: give the same ones")
    one, other = np.asarray(cameras.R, np.float64), np.asarray(reference.R, np.float64)
    turn = nearest_rotation(np.einsum("cji,cjk->ik", other, one))
    apart = np.linalg.norm(one @ turn.T - other, axis=(1, 2))
    start, end = cameras.centres @ turn.T, reference.centres
    start, end = start - start.mean(0), end - end.mean(0)
    scale = float((start * end).sum() / (start**2).sum())
    # The Frobenius norm of a difference of rotations is sqrt(8) times the sine of half the angle.
    angles = 2 * np.arcsin(np.minimum(apart / np.sqrt(8.0), 1.0))
    return RigDifference(angles, np.linalg.norm(scale * start - end, axis=1), scale)
