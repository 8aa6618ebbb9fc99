"""Fisheye lenses that the tests share, and OpenCV's own answers about them."""

import cv2
import numpy as np

from jaxskel import Cameras, make_cameras
from support.phantoms import ring

FISHEYES = {
    "equidistant": [0.0, 0.0, 0.0, 0.0],
    "mild": [-0.02, 0.004, -0.001, 0.0002],
    # Outwards at first, inwards further out: of 180 degrees and more.
    "strong": [0.08, -0.05, 0.02, -0.004],
    # The image of a sphere seen from its own surface, but for what is cut off: nearly stands still at the rim.
    "orthographic": [-1 / 6, 1 / 120, -1 / 5040, 1 / 362880],
}
FOLDS = [-0.25, 0.0, 0.0, 0.0]
"""Folds back where 3 * 0.25 a^2 = 1: at an angle of 1.1547, 66 degrees, where the image is 0.7698 away."""
BARREL = [-0.25, 0.08, 0.002, -0.003, 0.01, 0.0, 0.0, 0.0]


def fisheye_camera(lens, skew: float = 0.0, size=(660, 480)) -> Cameras:
    """One camera in the origin that looks along z."""
    K = np.array([[300.0, skew, 331.3], [0.0, 290.0, 238.1], [0.0, 0.0, 1.0]])
    return make_cameras(K[None], np.eye(3)[None], np.zeros((1, 3)), size, [lens], ["wide"], fisheye=True)


def mixed_ring(count: int = 6, size=(160, 120), focal: float = 60.0) -> Cameras:
    """Cameras 2 m around the z axis: every second a fisheye, the others with lenses that bend, too."""
    rig = ring(count, size, focal, radius=2.0)
    lenses = np.zeros((count, 8))
    lenses[::2, :4] = np.resize(np.array(list(FISHEYES.values())), (len(lenses[::2]), 4))
    lenses[1::2] = BARREL
    K = np.array(rig.K)
    K[::2, 0, 1] = 1.5
    return make_cameras(K, rig.R, rig.t, size, lenses, fisheye=np.arange(count) % 2 == 0)


def by_opencv(cameras: Cameras, index: int, points: np.ndarray) -> np.ndarray:
    """Where cv2.fisheye sees points of the world (px)."""
    K = np.asarray(cameras.K[index])
    turn, shift = cv2.Rodrigues(np.asarray(cameras.R[index]))[0], np.asarray(cameras.t[index])
    lens = np.asarray(cameras.dist[index, :4])
    return cv2.fisheye.projectPoints(points[:, None], turn, shift, K, lens, alpha=K[0, 1] / K[0, 0])[0][:, 0]


def cone(count: int, widest: float, seed: int = 0) -> np.ndarray:
    """Points before a camera in the origin, up to some angle to its axis (rad), and one on it."""
    rng = np.random.default_rng(seed)
    angle, around = widest * rng.random(count), 2 * np.pi * rng.random(count)
    ways = np.stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)], 1)
    ways[0] = 0.0, 0.0, 1.0
    return ways * rng.uniform(0.5, 5.0, (count, 1))
