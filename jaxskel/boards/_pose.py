"""From the corners of a board in one image to where the camera is."""

import cv2
import numpy as np
from jaxtyping import Float

from ._board import Board


def camera_pose(
    corners: Float[np.ndarray, "corners 2"], board: Board, K: Float[np.ndarray, "3 3"], dist: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"], float]:
    """Pose of a camera of known lens in the frame of the board: ``x_cam = R x + t``.

    Both poses from which a plane looks much the same (Collins and Bartoli's IPPE) are refined by Levenberg-Marquardt
    through the lens distortion, and the one that fits better is taken.

    Returns:
        R, t (m), and the root mean square distance of corners and their projections (px).
    """
    points, seen = board.points[:, None], corners[:, None]
    _, turns, shifts, _ = cv2.solvePnPGeneric(points, seen, K, dist, flags=cv2.SOLVEPNP_IPPE)
    best = None
    for turn, shift in zip(turns, shifts, strict=True):
        turn, shift = cv2.solvePnPRefineLM(points, seen, K, dist, turn, shift)
        projected, _ = cv2.projectPoints(points, turn, shift, K, dist)
        rms = float(np.sqrt(np.mean(np.sum((projected - seen) ** 2, axis=-1))))
        if best is None or rms < best[2]:
            best = cv2.Rodrigues(turn)[0], shift.reshape(3), rms
    assert best is not None
    return best
