"""Takes the lens distortion out of image points, once, so that a term projects by a pinhole."""

import numpy as np
from jaxtyping import Float

from ...cameras import Cameras, rays_in_camera


def undistort_keypoints(
    keypoints: Float[np.ndarray, "frames cams keypoints 3"], cameras: Cameras
) -> Float[np.ndarray, "frames cams keypoints 3"]:
    """Image points as a pinhole with the same intrinsics images them.

    Args:
        keypoints: x and y in the images (px), and confidence; NaN where missing.
        cameras: Cameras of the images, in the same order.

    Returns:
        The same with x and y (px) without distortion; NaN also where a point is outside of what the lens images.

    Raises:
        ValueError: The array is not one row of keypoints for each frame and camera.
    """
    given = np.asarray(keypoints, np.float64)
    if given.ndim != 4 or given.shape[1] != len(cameras) or given.shape[3] != 3:
        raise ValueError(
            f"keypoints: have shape {given.shape}; give (frames, {len(cameras)}, keypoints, 3): x, y (px), confidence"
        )
    found = given.copy()
    for camera in np.flatnonzero(cameras.bent):
        points = given[:, camera].reshape(-1, 3)
        known = np.isfinite(points).all(1)
        rays = rays_in_camera(cameras, int(camera), points[known, :2])
        straight = rays / rays[:, 2:] @ np.asarray(cameras.K)[camera].T
        points[known, :2] = straight[:, :2]
        found[:, camera] = np.where(np.isfinite(points).all(1, keepdims=True), points, np.nan).reshape(
            given[:, camera].shape
        )
    return found
