"""Masks of a camera in a NumPy archive that holds an array for each camera."""

from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from .._archive import StoredRows, fault, numbers, read_arrays
from .._bounded import check_pixels


class MaskArchive:
    """The array of one camera: masks (frames, h, w) of 0 and 1 or 255.

    Beside an array ``NAME_shape`` with these three numbers, ``NAME`` is what `numpy.packbits` made of the last axis.
    """

    fps = None

    def __init__(self, path: Path, name: str):
        """Check what the array claims; masks are read when they are asked for.

        Raises:
            ValueError: One line that names the file and the key.
        """
        self.path = path
        self._rows = StoredRows(path, name)
        shape, dtype = self._rows.shape, self._rows.dtype
        stated = read_arrays(path, (), (f"{name}_shape",))
        if len(shape) != 3 or dtype not in (np.uint8, np.bool_) or 0 in shape:
            raise fault(path, name, f"{dtype} of shape {shape}; give uint8 (frames, h, w)")
        self._packed = bool(stated)
        frames, height, width = shape
        if stated:
            wanted = numbers(path, stated, f"{name}_shape", (3,))
            width = int(wanted[2])
            if tuple(wanted) != (frames, height, width) or -(-width // 8) != shape[2]:
                raise fault(path, f"{name}_shape", f"{wanted.tolist()} is not that of {name}, {shape} with packed bits")
        check_pixels(path, width, height, name)
        self.size = width, height
        self.span = 0, frames - 1

    def read(self, number: int) -> UInt8[np.ndarray, "h w"] | None:
        """A mask of 0 and 255; None outside of the array."""
        if not 0 <= number <= self.span[1]:
            return None
        row = self._rows.read(number, number + 1)[0]
        if self._packed:
            return np.unpackbits(row, axis=-1, count=self.size[0]) * np.uint8(255)
        return np.where(row > 127 if row.max() > 1 else row > 0, np.uint8(255), np.uint8(0))
