"""Masks of a camera in a NumPy archive that holds one array for each camera."""

from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Shaped, UInt8, UInt16

from ..files import StoredRows, check_pixels, fault, numbers, read_arrays


class MaskArchive:
    """The array of one camera: masks (frames, h, w) of bools, integers, or probabilities from 0 to 1.

    If there is also an array ``NAME_shape`` with these three numbers, ``NAME`` is the result of `numpy.packbits` along
    the last axis.
    """

    fps = None

    def __init__(self, path: Path, name: str):
        """Check what the array claims; masks are read when they are needed.

        Raises:
            ValueError: One line that names the file and the key.
        """
        self.path = path
        self._rows = StoredRows(path, name)
        shape, dtype = self._rows.shape, self._rows.dtype
        stated = read_arrays(path, (), (f"{name}_shape",))
        if len(shape) != 3 or dtype.kind not in "buif" or 0 in shape:
            raise fault(path, name, f"{dtype} of shape {shape}; give uint8 (frames, h, w)")
        if stated and dtype not in (np.uint8, np.bool_):
            raise fault(path, name, f"{dtype}, but beside {name}_shape packed bits are expected; give uint8")
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

    @property
    def notes(self) -> tuple[str, ...]:
        """Empty: masks in an archive need no notes."""
        return ()

    @property
    def numbers(self) -> range:
        """Numbers of all masks, from 0."""
        return range(self.span[1] + 1)

    @property
    def is_binary(self) -> bool:
        """Whether the array holds bools or bits, which are read as 0 and 255."""
        return self._packed or self._rows.dtype == np.bool_

    def keeps_values(self) -> bool:
        """True: values are exact, up to the rounding of probabilities."""
        return True

    def named(self, number: int) -> str:
        """Place of a mask in the archive."""
        return f"{self._rows.key}[{number}]"

    def read(self, number: int) -> UInt8[np.ndarray, "h w"] | UInt16[np.ndarray, "h w"] | None:
        """Read a mask, 0 and 255 for bools or bits; None outside of the array."""
        if not 0 <= number <= self.span[1]:
            return None
        row = self._rows.read(number, number + 1)[0]
        if self._packed:
            return np.unpackbits(row, axis=-1, count=self.size[0]) * np.uint8(255)
        if row.dtype == np.bool_:
            return row * np.uint8(255)
        return row if row.dtype == np.uint8 else self._in_whole_numbers(row, number)

    def _in_whole_numbers(self, row: Shaped[np.ndarray, "h w"], number: int) -> UInt16[np.ndarray, "h w"]:
        """Scale probabilities to 0 to 255; leave integers as they are."""
        least, most = float(row.min()), float(row.max())
        if not (least >= 0 and most <= 65535):  # nor NaN
            value = least if not least >= 0 else most
            raise fault(self.path, self._rows.key, f"holds {value:g} in frame {number}; give 0 to 65535, or 0.0 to 1.0")
        if row.dtype.kind == "f":
            row = np.rint(row.astype(np.float64) * (255 if self._is_part else 1))
            if self._is_part and most > 1:
                raise fault(self.path, self._rows.key, f"holds {most:g} in frame {number}, but others 0.0 to 1.0")
        return row.astype(np.uint16)

    @cached_property
    def _is_part(self) -> bool:
        """Whether floats are probabilities: True if no value of a few masks exceeds 1."""
        chosen = np.unique(np.linspace(0, self.span[1], _SAMPLES).astype(int)).tolist()
        return all(self._rows.read(number, number + 1).max() <= 1 for number in chosen)


# Masks that are examined to tell probabilities (0 to 1) from levels (0 to 255).
_SAMPLES = 8
