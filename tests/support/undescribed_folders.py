"""Folders that nobody has described yet, of a person whom five cameras see, with images that were changed."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from jaxskel import Cameras, make_cameras, unpack_silhouettes
from jaxskel.io.calibrations import write_pose2sim_calibration
from support.perturbed_rigs import body
from support.phantoms import film, ring

VIEWS, FRAMES = 5, 3
SIZE = (256, 192)
Change = Callable[[np.ndarray], np.ndarray]


@cache
def rig(size: tuple[int, int] = SIZE) -> Cameras:
    """Cameras that look level or a little down, with names."""
    found = ring(VIEWS, size, 200.0)
    return make_cameras(found.K, found.R, found.t, found.size, names=[f"cam{number}" for number in range(1, 1 + VIEWS)])


@cache
def masks(size: tuple[int, int] = SIZE) -> np.ndarray:
    """Their images, frames x views x rows x columns, 0 or 255."""
    packed = film(rig(size), [body(seed) for seed in range(FRAMES)])
    return unpack_silhouettes(packed, size[0]).astype(np.uint8) * np.uint8(255)


def shrunk(image: np.ndarray) -> np.ndarray:
    """Half as wide and high."""
    halves = cv2.resize(image, (image.shape[1] // 2, image.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return np.where(halves >= 128, np.uint8(255), np.uint8(0))


def same(image: np.ndarray) -> np.ndarray:
    return image


def undescribed(
    folder: Path,
    changes: Change | list[Change] = same,
    place: Callable[[str, int], str] = lambda camera, frame: f"masks/{camera}/{frame:06d}.png",
    size: tuple[int, int] = SIZE,
    calibration: Cameras | None = None,
) -> Path:
    """Write a calibration and images.

    Args:
        folder: Folder to write to.
        changes: Changes of the images, for all views or for each.
        place: The path of an image, by the camera's name and the frame.
        size: Of the calibrated images (px).
        calibration: The rig in the calibration file, if it differs.
    """
    cameras = rig(size)
    write_pose2sim_calibration(folder / "Calib_scene.toml", calibration or cameras)
    for view, name in enumerate(cameras.names):
        change = changes[view] if isinstance(changes, list) else changes
        for frame in range(FRAMES):
            path = folder / place(name, frame)
            path.parent.mkdir(parents=True, exist_ok=True)
            assert cv2.imwrite(str(path), np.ascontiguousarray(change(masks(size)[frame, view])))
    return folder
