"""Small arrays of `.npz` and `.npy` files that may come from anywhere."""

import io
import math
import zipfile
from pathlib import Path

import numpy as np

from .._archive import fault, numbers, read_arrays, shape_of

# Numbers of one array of a calibration: a thousand cameras' matrices are a hundredth of this.
_MOST_NUMBERS = 1_000_000
_MAX_BYTES = 16 << 20


def keys_of(path: Path) -> list[str]:
    """The arrays of an archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            return [name[:-4] for name in archive.namelist() if name.endswith(".npy")]
    except OSError as error:
        raise fault(path, None, f"cannot be opened ({error.strerror or error}); check the path") from None
    except Exception:  # zipfile raises a dozen kinds on hostile bytes
        raise fault(path, None, "is not a whole .npz archive; write numpy.savez") from None


def checked_arrays(path: Path, required: tuple[str, ...], optional: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Read the named arrays, none of which is larger than a calibration's."""
    keys = keys_of(path)
    for key in (*required, *optional):
        if key in keys and math.prod(shape_of(path, key)) > _MOST_NUMBERS:
            raise fault(path, key, f"holds more than {_MOST_NUMBERS} numbers, too many for a calibration")
    return read_arrays(path, required, optional)


def small_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of numbers of an archive."""
    keys = tuple(keys_of(path))
    if not 0 < len(keys) < 1000:
        raise fault(path, None, f"holds {len(keys)} arrays; give one for each camera, or one of them all")
    arrays = checked_arrays(path, keys, ())
    return {key: numbers(path, arrays, key, None) for key in arrays}


def read_array(path: Path) -> np.ndarray:
    """The numbers of an `.npy` file."""
    try:
        with open(path, "rb") as file:
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise fault(path, None, f"cannot be opened ({error.strerror}); check the path") from None
    if len(content) > _MAX_BYTES:
        raise fault(path, None, "is longer than 16 MB, too long for a calibration; check the path")
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
