"""Reads small arrays of untrusted `.npz` and `.npy` files."""

import io
from pathlib import Path

import numpy as np

from ..files import fault, keys_of, numbers, read_arrays, read_bounded

# Largest total size of a calibration's arrays (bytes): a thousand cameras take a hundredth of this.
_MAX_BYTES = 2**24


def checked_arrays(path: Path, required: tuple[str, ...], optional: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Read the named arrays, of at most the size of a calibration."""
    return read_arrays(path, required, optional, _MAX_BYTES)


def small_arrays(path: Path) -> dict[str, np.ndarray]:
    """All numeric arrays of an archive."""
    keys = tuple(keys_of(path))
    if not 0 < len(keys) < 1000:
        raise fault(path, None, f"holds {len(keys)} arrays; give one for each camera, or one of them all")
    arrays = checked_arrays(path, keys, ())
    return {key: numbers(path, arrays, key, None) for key in arrays}


def read_array(path: Path) -> np.ndarray:
    """The numbers of an `.npy` file."""
    content = read_bounded(path, _MAX_BYTES, "a calibration")
    try:
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except Exception as error:  # the header is a Python expression: hostile ones raise anything
        raise fault(
            path,
            None,
            f"is no array of plain numbers ({type(error).__name__}), and a pickle is never read; write numpy.save",
        ) from None
    if not isinstance(array, np.ndarray):
        raise fault(path, None, "is an archive; name it .npz")
    return numbers(path, {"array": array}, "array", None)
