"""A correct recording, and faults to add to it."""

from dataclasses import replace

import cv2
import equinox as eqx
import numpy as np

from jaxskel import Recording, pack_silhouettes, unpack_silhouettes
from jaxskel.synthetic import camera_ring, make_scene

FPS = 30.0


def good(cameras: int = 6, frames: int = 40) -> Recording:
    """A person who moves, at a video's rate."""
    return make_scene(frames, FPS, camera_ring(cameras, size=(320, 240)))


def masks_of(recording: Recording) -> np.ndarray:
    """All silhouettes, unpacked."""
    return np.array(unpack_silhouettes(np.asarray(recording.silhouettes), 8 * recording.silhouettes.shape[3]))


def with_masks(recording: Recording, masks: np.ndarray) -> Recording:
    """The same recording with other silhouettes."""
    return eqx.tree_at(lambda r: r.silhouettes, recording, pack_silhouettes(masks))


def with_view(recording: Recording, view: int, change) -> Recording:
    """The same recording with the images of one view changed."""
    masks = masks_of(recording)
    masks[:, view] = change(masks[:, view])
    return with_masks(recording, masks)


def with_cameras(recording: Recording, **changed: np.ndarray) -> Recording:
    """The same recording with other extrinsics or intrinsics."""
    return replace(recording, cameras=replace(recording.cameras, **changed))


def late(recording: Recording, view: int, frames: int) -> Recording:
    """One view shows what the others showed some frames before."""
    masks = masks_of(recording)
    masks[frames:, view] = masks[:-frames, view].copy()
    return with_masks(recording, masks)


def exchanged(recording: Recording, one: int, other: int) -> Recording:
    """Two views with each other's images."""
    masks = masks_of(recording)
    masks[:, [one, other]] = masks[:, [other, one]]
    return with_masks(recording, masks)


def moved_image(masks: np.ndarray, right: int, down: int, scale: float = 1.0) -> np.ndarray:
    """Images whose first pixel lay elsewhere, or that were resized and padded."""
    matrix = np.array([[scale, 0, right], [0, scale, down]], float)
    size = masks.shape[2], masks.shape[1]
    return np.stack([cv2.warpAffine(mask.astype(np.uint8), matrix, size) > 0 for mask in masks])


def bumped(recording: Recording, view: int, degrees: tuple[float, float, float]) -> Recording:
    """One camera turned about its own axes after the calibration."""
    R, t = np.array(recording.cameras.R), np.array(recording.cameras.t)
    turn = cv2.Rodrigues(np.radians(degrees))[0]
    R[view], t[view] = turn @ R[view], turn @ t[view]
    return with_cameras(recording, R=R, t=t)


def inverted_extrinsics(recording: Recording) -> Recording:
    """Camera to world where world to camera is wanted."""
    R = np.swapaxes(np.asarray(recording.cameras.R), 1, 2)
    return with_cameras(recording, R=R, t=-np.einsum("cij,cj->ci", R, np.asarray(recording.cameras.t)))
