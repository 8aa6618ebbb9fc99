"""Computes the pose of a camera from the corners of a board in one image."""

import cv2
import numpy as np
import scipy  # imports its parts when they are first used
from jaxtyping import Float

from ...cameras import make_cameras, project, rays_in_camera
from ._board import Board

# Reprojection error of a corner that the lens model cannot show (px): more than any real one.
_UNSEEN = 1e5


def camera_pose(
    corners: Float[np.ndarray, "corners 2"],
    board: Board,
    K: Float[np.ndarray, "3 3"],
    dist: Float[np.ndarray, " n"],
    fisheye: bool = False,
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"], float]:
    """Pose of a camera with known intrinsics in the frame of the board: ``x_cam = R x + t``.

    A plane looks nearly the same from two poses (Collins and Bartoli's IPPE). Both are refined by Levenberg-Marquardt
    with lens distortion, and the better fit is returned.

    Returns:
        R, t (m), and the root mean square distance between corners and their projections (px).

    Raises:
        ValueError: The lens is a fisheye that cannot show some of the corners.
    """
    if fisheye:
        return _fisheye_pose(corners, board, K, dist)
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


def _fisheye_pose(
    corners: np.ndarray, board: Board, K: np.ndarray, dist: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    lens = make_cameras(K[None], np.eye(3)[None], np.zeros((1, 3)), (1, 1), dist[None], fisheye=True)
    directions = rays_in_camera(lens, 0, corners)
    if np.isnan(directions).any():
        raise ValueError("corners of the board are where its fisheye lens shows nothing: are these its intrinsics?")
    points, tangents = board.points[:, None], (directions[:, :2] / directions[:, 2:])[:, None]

    def off(pose: np.ndarray) -> np.ndarray:
        moved = board.points @ cv2.Rodrigues(pose[:3])[0].T + pose[3:]
        u, v, _ = project(lens, moved)
        return np.nan_to_num(np.stack([u[0], v[0]], 1) - corners, nan=_UNSEEN).ravel()

    _, turns, shifts, _ = cv2.solvePnPGeneric(points, tangents, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    starts = [np.concatenate([turn, shift]).ravel() for turn, shift in zip(turns, shifts, strict=True)]
    best = min(
        (scipy.optimize.least_squares(off, start, method="lm") for start in starts), key=lambda found: found.cost
    )
    rms = float(np.sqrt(2 * best.cost / len(corners)))
    return cv2.Rodrigues(best.x[:3])[0], best.x[3:], rms
