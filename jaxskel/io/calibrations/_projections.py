"""Plain 3 x 4 projection matrices: `.npy`, `.npz`, rows of numbers in a `.txt` file, or JSON."""

from pathlib import Path
from typing import Any

import numpy as np

from ..files import fault
from ._archives import read_array, small_arrays
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import natural_order, numbers, read_text, split_numbers

# Largest condition number of the left 3 x 3 block of a camera: focal lengths are 10 to 1e5 px.
_MOST_SQUEEZED = 1e8
# Largest text (bytes): a thousand cameras take a quarter of this.
_MAX_BYTES = 1_000_000
# Matrices of smaller numbers than this are refused: dividing by them would overflow.
_FAINTEST = 1e-9
_KEYS = ("P", "projection", "projection_matrix", "proj", "proj_mat")


def read_projection_text(path: Path) -> Contents:
    """Read three rows of four numbers for each camera; skip a first line ``CONTOUR`` as in multi-view stereo."""
    words = read_text(path, _MAX_BYTES).split()
    found = split_numbers(path, "of all rows", "the file", " ".join(words[words[:1] == ["CONTOUR"] :]))
    if len(found) == 0 or len(found) % 12:
        raise fault(path, None, f"holds {len(found)} numbers; give three rows of four for each camera")
    return _contents(path, {f"cam{i}": P for i, P in enumerate(found.reshape(-1, 3, 4))})


def read_projection_array(path: Path) -> Contents:
    """Read an array of shape (cams, 3, 4) or (3, 4) from an `.npy` file."""
    return _contents(path, _stack(path, read_array(path)))


def read_projection_archive(path: Path) -> Contents:
    """Read an `.npz` archive: one array of shape (cams, 3, 4), or one of shape (3, 4) for each camera, by its name."""
    arrays = small_arrays(path)
    if len(arrays) == 1 and next(iter(arrays.values())).ndim == 3:
        return _contents(path, _stack(path, next(iter(arrays.values()))))
    for name, array in arrays.items():
        if array.shape != (3, 4):
            raise fault(path, name, f"has shape {array.shape}; give a projection matrix, (3, 4), for each camera")
    return _contents(path, {name: arrays[name] for name in sorted(arrays, key=natural_order)})


def matrices_in(table: Any) -> dict[str, Any]:
    """The matrix of each camera in JSON: three lists of four, alone or under a key; empty if there is none."""
    if not isinstance(table, dict):
        return {}
    found = {}
    for name, value in table.items():
        if isinstance(value, dict):
            value = next((value[key] for key in _KEYS if key in value), None)
        if not (
            isinstance(value, list) and len(value) == 3 and all(isinstance(r, list) and len(r) == 4 for r in value)
        ):
            return {}
        found[name] = value
    return found


def read_projection_table(path: Path, matrices: dict[str, Any]) -> Contents:
    """Read one matrix for each camera in JSON, by its name."""
    names = sorted(matrices, key=natural_order)
    return _contents(path, {name: numbers(path, name, "P", matrices[name], 12).reshape(3, 4) for name in names})


def _stack(path: Path, array: np.ndarray) -> dict[str, np.ndarray]:
    if array.ndim not in (2, 3) or array.shape[-2:] != (3, 4):
        raise fault(path, None, f"has shape {array.shape}; give projection matrices, (cams, 3, 4)")
    return {f"cam{i}": P for i, P in enumerate(array.reshape(-1, 3, 4))}


def _contents(path: Path, matrices: dict[str, np.ndarray]) -> Contents:
    """The cameras of these matrices; the unit is not stated, and metres are assumed."""
    return Contents("projection matrices", [_entry(path, name, P) for name, P in matrices.items()], 1.0, None)


def _entry(path: Path, name: str, P: np.ndarray) -> CameraEntry:
    """Intrinsics and pose: P equals K (R | t) up to a nonzero factor."""
    left = P[:, :3]
    strengths = np.linalg.svd(left, compute_uv=False)
    if not strengths[-1] * _MOST_SQUEEZED > strengths[0] > _FAINTEST:
        raise camera_fault(path, name, "its matrix is no camera: the left 3 x 3 block is singular; give K (R | t)")
    import scipy.linalg  # takes a while to import, and few have such files

    P = P / strengths[0]
    P = P * np.sign(np.linalg.det(P[:, :3]))
    K, R = scipy.linalg.rq(P[:, :3])
    # Signs may be flipped in pairs: make the focal lengths positive.
    signs = np.sign(np.diag(K))
    K, R = K * signs, signs[:, None] * R
    t = scipy.linalg.solve_triangular(K, P[:, 3])
    return CameraEntry(name, K / K[2, 2], R, t, np.zeros(0), None)
