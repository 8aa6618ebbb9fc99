"""A recording and poses as files, for tests of those who read them."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel.body import Pose, default_adult, place_joints
from jaxskel.cameras import make_cameras
from jaxskel.io.recordings import write_recording
from jaxskel.poses import Poses, Status
from jaxskel.recording import Recording, Truth, pack_silhouettes

WIDTH, HEIGHT, FRAMES, CAMS = 20, 12, 2, 3


def a_recording() -> Recording:
    """Two frames of three cameras; a width that is no multiple of 8, so that bytes are padded."""
    rng = np.random.default_rng(0)
    adult = default_adult()
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    return Recording(
        cameras=make_cameras(
            K=np.tile([[20.0, 0.1, 10.0], [0.0, 21.0, 6.0], [0.0, 0.0, 1.0]], (CAMS, 1, 1)),
            R=np.stack([np.eye(3), turn, turn @ turn]),
            t=rng.normal(size=(CAMS, 3)),
            size=(WIDTH, HEIGHT),
            dist=rng.normal(size=(CAMS, 5)) * 0.01,
            names=("front", "left", "back"),
        ),
        silhouettes=pack_silhouettes(rng.random((FRAMES, CAMS, HEIGHT, WIDTH)) < 0.5),
        fps=29.97,
        up="-Y",
        frame_index=np.array([4, 9]),
        skeleton=adult,
        truth=Truth(np.stack([adult.rest_joints] * FRAMES), np.stack([adult.rest_tips] * FRAMES)),
        name="clip",
    )


def some_poses() -> Poses:
    """Three frames, the middle one without a pose."""
    rng = np.random.default_rng(1)
    gap = np.array([1.0, np.nan, 1.0], np.float32)[:, None, None]
    adult, rotations = default_adult(1.6), Rotation.random(3 * 17, 1).as_matrix().reshape(3, 17, 3, 3)
    joints, tips = place_joints(adult, Pose(rng.normal(size=(3, 3)), rotations))
    return Poses(
        joints=np.asarray(joints) * gap,
        tips=np.asarray(tips) * gap,
        rotations=rotations.astype(np.float32) * gap[..., None],
        skeleton=adult,
        confidence=(rng.random((3, 15)) * [[1], [0], [1]]).astype(np.float32),
        side_confidence=np.array([1.0, 0.0, 0.5], np.float32),
        status=np.array([Status.OK, Status.NO_HULL, Status.VIEW_LOST]),
        fps=12.5,
        up="+Y",
        frame_index=np.array([7, 8, 9]),
        covariance=(np.diag([1e-4, 4e-4, 9e-4]) * np.ones((3, 15, 1, 1)) * gap[..., None]).astype(np.float32),
        stature_deviation=0.02,
    )


def recording_file(folder: Path) -> Path:
    path = folder / "clip.npz"
    write_recording(path, a_recording())
    return path


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def same(a: object, b: object) -> bool:
    """Equal field by field, with NaN equal to NaN."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if hasattr(a, "__dataclass_fields__"):
        return type(a) is type(b) and all(same(getattr(a, f), getattr(b, f)) for f in a.__dataclass_fields__)
    return a == b


def refused(read, path: Path, *parts: str) -> None:
    """Reading fails with one line that starts with the file and holds the parts."""
    with pytest.raises(ValueError, match=f"^{re.escape(str(path))}: ") as error:
        read(path)
    message = str(error.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


def rows(key, index, value):
    """A change of one element of an array."""

    def change(arrays):
        changed = arrays[key].copy()
        changed[index] = value
        return {key: changed}

    return change


def scaled(key, factor):
    return lambda arrays: {key: arrays[key] * factor}


def cut(key, n):
    return lambda arrays: {key: arrays[key][:n]}
