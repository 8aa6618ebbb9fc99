"""Reads the pose of a camera in hand-written JSON, under keys with an unambiguous meaning."""

from pathlib import Path
from typing import Any

import numpy as np

from ._calibration import camera_fault
from ._json_lens import one_of, plain
from ._text import from_vector

_ROTATIONS = (
    "R", "rot", "rotation", "rotation_matrix", "rotation_mat", "extrinsic_r", "rvec", "rvecs", "rotation_vector",
    "rodrigues",
)  # fmt: skip
_TRANSLATIONS = ("t", "T", "tvec", "tvecs", "translation", "translation_vector", "extrinsic_t")
_CENTRES = ("C", "center", "centre", "camera_center", "cam_center", "position", "camera_position")
_TO_CAMERA = (
    "RT", "Rt", "w2c", "world2cam", "world_to_cam", "world2camera", "world_to_camera", "extrinsic", "extrinsics",
    "extrinsic_matrix",
)  # fmt: skip
_TO_WORLD = ("c2w", "cam2world", "cam_to_world", "camera2world", "camera_to_world")
# Ambiguous keys: some people write world-to-camera matrices under them, others camera-to-world.
_UNCLEAR = ("pose", "poses", "transform", "transformation", "matrix_world", "transform_matrix", "quaternion", "q")
# Largest relative difference between a translation and an optical centre of one camera: files hold about six digits.
_SAME_PLACE = 1e-3


def read_pose(path: Path, name: str, camera: dict[str, Any]) -> tuple[np.ndarray, np.ndarray] | None:
    """Rotation and translation of x_cam = R x + t (file's unit); None if the camera has no pose.

    A world-to-camera rotation R, as a matrix or a rotation vector (rad), with a translation t or an optical centre C;
    or both in one matrix of 3 x 4 or 4 x 4 numbers, from world to camera (``RT``, ``w2c``, ``extrinsic``) or back
    (``c2w``). ``world2cam``: false inverts R and t.
    """
    if camera.get("convention", "opencv") not in ("opencv", None):
        raise camera_fault(
            path, name, f"convention is {str(camera['convention'])[:40]!r}; convert the cameras to OpenCV's"
        )
    is_back = camera.get("world2cam") is False
    matrices = tuple(key for key in _TO_CAMERA + _TO_WORLD if not isinstance(camera.get(key), bool))
    whole = one_of(path, name, camera, matrices)
    turn, shift = (one_of(path, name, camera, keys) for keys in (_ROTATIONS, _TRANSLATIONS))
    centre = one_of(path, name, camera, _CENTRES)
    if whole is not None:
        if turn is not None or shift is not None:
            raise camera_fault(path, name, f"{whole} and {turn or shift} are both there; keep one")
        R, t = _parts(path, name, whole, camera[whole])
        return _back(R, t) if whole in _TO_WORLD else (R, t)
    if turn is None or (shift is None and centre is None):
        unclear = [key for key in _UNCLEAR if camera.get(key) is not None]
        if unclear and turn is None:
            raise camera_fault(
                path, name, f"{unclear[0]} does not say what it means; give R and t with x_cam = R x + t, or name it "
                "w2c (from world to camera) or c2w (back)",
            )  # fmt: skip
        return None
    R = _rotation(path, name, turn, camera[turn])
    if shift is None:
        assert centre is not None  # see above
        C = plain(path, name, centre, camera[centre], 3)
        return (R, -R @ C) if not is_back else (R.T, -R.T @ C)
    t = plain(path, name, shift, camera[shift], 3)
    R, t = _back(R, t) if is_back else (R, t)
    if centre is not None:
        C = plain(path, name, centre, camera[centre], 3)
        if np.linalg.norm(R @ C + t) > _SAME_PLACE * max(1.0, np.linalg.norm(t)):
            raise camera_fault(
                path,
                name,
                f"{shift} and {centre} do not agree: the optical centre is -R^T t; keep the one that is right",
            )
    return R, t


def _rotation(path: Path, name: str, key: str, value: Any) -> np.ndarray:
    found = plain(path, name, key, value)
    if len(found) == 4:
        raise camera_fault(path, name, f"{key} is a quaternion, whose order nothing says; give a matrix, 3 x 3 numbers")
    found = plain(path, name, key, value, 3, 9)
    return found.reshape(3, 3) if len(found) == 9 else from_vector(path, name, key, found)


def _parts(path: Path, name: str, key: str, value: Any) -> tuple[np.ndarray, np.ndarray]:
    found = plain(path, name, key, value, 12, 16)
    if len(found) == 16 and not np.array_equal(found[12:], [0, 0, 0, 1]):
        raise camera_fault(path, name, f"{key} does not end in the row [0, 0, 0, 1]; give it row by row")
    whole = found[:12].reshape(3, 4)
    return whole[:, :3], whole[:, 3]


def _back(R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return R.T, -R.T @ t
