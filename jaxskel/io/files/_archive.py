"""Reads arrays of untrusted `.npz` archives.

Their claims are checked against their bytes before memory is allocated, pickled objects are never read, and every
fault is a `ValueError` of one line that names the file, the key and how to mend it.
"""

import io
import math
import reprlib
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

import numpy as np
from jaxtyping import Bool, Float, Shaped

from ._bounded import open_regular
from ._errors import fault as fault

# Largest total size of the arrays: at 30 frames per second, joints and tips of ten hours fit, poses of two and a half.
_MAX_BYTES = 2**28
# Largest size of an array's header (bytes); NumPy writes some 100 bytes and refuses more than 10 000.
_HEADER = 20_000
# Deflate cannot shrink data further than this; a member that claims more lies about its size.
_MAX_DEFLATE_RATIO = 1032
# No length (m), focal length (px) or lens coefficient comes near this; refusing it keeps later squares finite.
_MAX_NUMBER = 1e9


def texts(path: Path, arrays: dict[str, np.ndarray], key: str) -> list[str]:
    """The strings of an array with at most one dimension.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    array = arrays[key]
    if array.dtype.kind != "U" or array.ndim > 1:
        raise fault(path, key, f"{array.dtype} of shape {array.shape}; give text")
    if not _is_text(array):
        raise fault(
            path, key, "holds what is no text (numbers beyond Unicode, or halves of characters); write it again"
        )
    return [str(text) for text in array.reshape(-1)]


def _is_text(array: np.ndarray) -> bool:
    """Whether all code points are valid; from others NumPy makes invalid strings, or raises."""
    order = array.dtype.str[0]
    points = np.frombuffer(array.tobytes() or bytes(4), f"{order}u4")
    return not ((points > 0x10FFFF) | ((points >= 0xD800) & (points <= 0xDFFF))).any()


def numbers(
    path: Path,
    arrays: dict[str, np.ndarray],
    key: str,
    shape: tuple[int | None, ...] | None,
    nan: bool = False,
) -> Float[np.ndarray, "..."]:
    """The real numbers of an array of the given shape (None matches any length or shape), as float64.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    array = arrays[key]
    if array.dtype.kind not in "iuf":
        raise fault(path, key, f"holds {array.dtype}; give numbers")
    fits = shape is None or (
        array.ndim == len(shape) and all(b in (None, a) for a, b in zip(array.shape, shape, strict=True))
    )
    if not fits:
        wanted = ", ".join("any" if n is None else str(n) for n in shape or ())
        raise fault(path, key, f"has shape {array.shape}; give ({wanted})")
    # A wider float may overflow and a signalling NaN raise a flag; both are refused below.
    with np.errstate(over="ignore", invalid="ignore"):
        array = array.astype(np.float64)
    bad = ~(np.abs(array) < _MAX_NUMBER) & ~(nan & np.isnan(array))
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise fault(path, key, f"holds {array[where]} at index {where}; give finite numbers in metres or pixels")
    return array


def switches(path: Path, arrays: dict[str, np.ndarray], key: str, count: int) -> Bool[np.ndarray, " count"]:
    """An array of `count` values, each true or false; the numbers 1 and 0 are accepted.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    array = arrays[key]
    if array.dtype.kind not in "biu" or array.shape != (count,) or not np.isin(array, (0, 1)).all():
        raise fault(path, key, f"holds {array.dtype} of shape {array.shape}; give ({count},) values, true or false")
    return array.astype(bool)


def short(array: np.ndarray) -> str:
    """A value for a message: itself if it is single, otherwise its shape and type."""
    is_shown = array.size == 1 and (array.dtype.kind != "U" or _is_text(array))
    return reprlib.repr(array.reshape(()).item()) if is_shown else f"{array.dtype} of shape {array.shape}"


def read_arrays(
    path: Path, required: tuple[str, ...], optional: tuple[str, ...], most: int = _MAX_BYTES
) -> dict[str, Shaped[np.ndarray, "..."]]:
    """Read the named arrays of an `.npz` archive, checking what they claim against the actual bytes.

    Args:
        path: The file.
        required: Arrays that must be there.
        optional: Arrays that may be there.
        most: Largest total size of the arrays (bytes).

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    with _opened(path) as archive:
        wanted = _members(path, archive, required, optional)
        for key, info in wanted.items():
            _header(path, key, archive, info)
        if sum(info.file_size for info in wanted.values()) > most:
            largest = max(wanted, key=lambda key: wanted[key].file_size)
            raise fault(
                path,
                largest,
                f"is too long: {', '.join(wanted)} take more than {most >> 20} MiB together; split the file",
            )
        arrays = {}
        for key, info in wanted.items():
            try:
                with archive.open(info) as stream:
                    arrays[key] = np.load(stream, allow_pickle=False)
            except Exception as error:  # checksum, deflate stream, memory, ...
                raise _damaged(path, key, error) from None
        return arrays


def keys_of(path: Path) -> list[str]:
    """The names of an archive's arrays."""
    with _opened(path) as archive:
        return list(_named(archive))


def shape_of(path: Path, key: str) -> tuple[int, ...]:
    """The shape that an array claims, checked against the actual bytes."""
    with _opened(path) as archive:
        return _header(path, key, archive, _members(path, archive, (key,), ())[key])[1]


class StoredRows:
    """An array that stays in its archive, from which some rows at a time are read.

    Reading an earlier row starts again at the beginning, because a compressed stream only goes forwards.
    """

    def __init__(self, path: Path, key: str):
        """Check what the array claims against the actual bytes."""
        self.path, self.key = path, key
        self._open: ExitStack = ExitStack()
        self._stream: IO[bytes] | None = None
        with _opened(path) as archive:
            self._info = _members(path, archive, (key,), ())[key]
            self._begin, self.shape, by_columns, self.dtype = _header(path, key, archive, self._info)
        if by_columns and len(self.shape) > 1:
            raise fault(path, key, "is stored by columns; save numpy.ascontiguousarray of it")
        self._row = math.prod(self.shape[1:]) * self.dtype.itemsize

    def read(self, start: int, stop: int) -> Shaped[np.ndarray, "rows ..."]:
        """The rows from `start` to before `stop`.

        Raises:
            ValueError: The file has been damaged since it was opened.
        """
        try:
            if self._stream is None:
                archive = self._open.enter_context(_opened(self.path))
                self._stream = self._open.enter_context(archive.open(self._info))
            self._stream.seek(self._begin + self._row * start)
            found = self._stream.read(self._row * (stop - start))
            return np.frombuffer(found, self.dtype).reshape(stop - start, *self.shape[1:])
        except Exception as error:  # checksum, deflate stream, ...
            raise _damaged(self.path, self.key, error) from None

    def __del__(self) -> None:
        self._open.close()


def _damaged(path: Path, key: str, error: Exception) -> ValueError:
    return fault(path, key, f"is damaged ({type(error).__name__}: {error}); write it again")


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    with open_regular(path) as file:
        try:
            archive = zipfile.ZipFile(file)
        except OSError as error:
            raise fault(path, None, f"cannot be opened ({error.strerror or error}); check the path") from None
        except Exception:  # zipfile raises a dozen kinds of exception on hostile bytes
            raise fault(
                path,
                None,
                "is not a whole .npz archive but truncated or another format; write numpy.savez_compressed",
            ) from None
        with archive:
            yield archive


def _members(
    path: Path, archive: zipfile.ZipFile, required: tuple[str, ...], optional: tuple[str, ...]
) -> dict[str, zipfile.ZipInfo]:
    members = _named(archive)
    for key in required:
        if key not in members:
            raise fault(path, key, f"is missing; the file holds {', '.join(members) or 'no arrays'}")
    return {key: members[key] for key in (*required, *optional) if key in members}


def _named(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    return {i.filename[:-4]: i for i in archive.infolist() if i.filename.endswith(".npy")}


def _header(
    path: Path, key: str, archive: zipfile.ZipFile, info: zipfile.ZipInfo
) -> tuple[int, tuple[int, ...], bool, np.dtype]:
    """Offset of an array's numbers, its shape, whether it is in Fortran order, and its type; all checked."""
    ratio = {zipfile.ZIP_STORED: 1, zipfile.ZIP_DEFLATED: _MAX_DEFLATE_RATIO}.get(info.compress_type)
    if ratio is None:
        raise fault(path, key, "is compressed in an unknown way; write it with numpy.savez_compressed")
    if info.compress_size > path.stat().st_size or info.file_size > ratio * info.compress_size:
        raise fault(
            path,
            key,
            f"claims {info.file_size} bytes that the file cannot hold; it is damaged, write it again",
        )
    try:
        with archive.open(info) as member:
            stream = io.BytesIO(member.read(_HEADER))
            version = np.lib.format.read_magic(stream)
            one = version == (1, 0)
            read_header = np.lib.format.read_array_header_1_0 if one else np.lib.format.read_array_header_2_0
            shape, by_columns, dtype = read_header(stream)
            begin = stream.tell()
    except Exception as error:  # the header is a Python expression: hostile ones raise anything
        raise fault(path, key, f"is not a NumPy array ({type(error).__name__}); write numpy.savez_compressed") from None
    if dtype.hasobject:
        raise fault(
            path,
            key,
            "holds pickled Python objects, which are never read; save plain arrays of numbers or text",
        )
    if dtype.kind not in "biufU":
        raise fault(path, key, f"holds {dtype}; save plain arrays of numbers or text")
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != info.file_size - begin:
        raise fault(
            path,
            key,
            f"claims shape {shape} of {dtype} but holds {info.file_size - begin} bytes; the file is damaged, "
            "write it again",
        )
    return begin, shape, by_columns, dtype
