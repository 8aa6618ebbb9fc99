"""The voxel file: the occupied voxels of each frame in one NumPy `.npz` archive.

Every fault is a `ValueError` of one line that names the file, the key and how to mend it.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Int

from ...volumes import AbstractOccupancy, Volumes, make_volumes
from ..calibrations import up_axis
from ..files import StoredRows, fault, numbers, read_arrays
from ._sequence_file import frame_numbers, frame_rate, skeleton_of, truth
from ._template import TEMPLATE_KEYS, template_of

_FPS = 30.0  # where a file does not say it


def read_voxel_file(path: Path, up: str | None = None) -> Volumes:
    """Read a voxel file.

    Keys: `occupied` (frames, x, y, z) booleans, or bytes of 0 and 1 or 255, or, with `shape` (x, y, z), packed bits
    (`numpy.packbits` over z); `origin` (3,), the lower corner of the first voxel, and `spacing` (m); optional `up`
    ("+Z" if missing), `fps` (30), `frame_index`, and as in a sequence file `rest_joints`, `rest_tips`, `joints`, `tips`
    and `template`.

    Args:
        path: The file.
        up: World axis that points up, if not what the file says.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    stored = StoredRows(path, "occupied")
    arrays = read_arrays(
        path,
        required=("origin", "spacing"),
        optional=("shape", "up", "fps", "frame_index", "rest_joints", "rest_tips", "joints", "tips", *TEMPLATE_KEYS),
    )
    template = template_of(path, arrays)
    occupied = _StoredOccupancy(stored, _depth(path, arrays, stored))
    frames = occupied.shape[0]
    fps = frame_rate(path, arrays) if "fps" in arrays else _FPS
    known = skeleton_of(path, arrays, template), truth(path, arrays, frames, template)
    places = numbers(path, arrays, "origin", None), numbers(path, arrays, "spacing", None)
    try:
        return make_volumes(
            occupied, *places, up or up_axis(path, arrays), fps, frame_numbers(path, arrays, frames), *known, path.stem
        )
    except ValueError as error:
        raise fault(path, None, str(error)) from None


def _depth(path: Path, arrays: dict[str, np.ndarray], stored: StoredRows) -> int | None:
    """Number of voxels along z if they are packed bits, otherwise None."""
    shape, dtype = stored.shape, stored.dtype
    if len(shape) != 4 or dtype not in (np.uint8, np.bool_):
        raise fault(path, "occupied", f"{dtype} of shape {shape}; give booleans or uint8, (frames, x, y, z)")
    if 0 in shape:
        raise fault(path, "occupied", f"has shape {shape}; give at least one frame and one voxel")
    if "shape" not in arrays:
        return None
    x, y, z = numbers(path, arrays, "shape", (3,)).astype(int).tolist()
    if dtype != np.uint8 or shape[1:] != (x, y, -(-z // 8)):
        raise fault(
            path, "shape", f"is {x}, {y}, {z}, but occupied is {dtype} of shape {shape}; pack it by numpy.packbits "
            "over z, or leave out shape",
        )  # fmt: skip
    return z


class _StoredOccupancy(AbstractOccupancy):
    """Voxels in the file.

    Reading raises a `ValueError`, one line that names the file, the key and how to mend it.
    """

    def __init__(self, rows: StoredRows, depth: int | None):
        self._rows, self._packed = rows, depth is not None
        frames, x, y, z = rows.shape
        self.shape = frames, x, y, z if depth is None else depth

    def read(self, frames: Int[np.ndarray, " some"]) -> Bool[np.ndarray, "some x y z"]:
        """Read some frames, one after the other."""
        found = np.empty((len(frames), *self.shape[1:]), bool)
        for place, frame in enumerate(frames.tolist()):
            (row,) = self._rows.read(frame, frame + 1)
            if self._packed:
                row = np.unpackbits(row, axis=-1, count=self.shape[3])
            elif row.dtype == np.uint8 and ((row > 1) & (row < 255)).any():
                raise fault(
                    self._rows.path, self._rows.key, f"frame {frame} holds values between 1 and 255; give 0 and 1, or "
                    "the number of voxels as shape if these are packed bits",
                )  # fmt: skip
            found[place] = row != 0
        return found
