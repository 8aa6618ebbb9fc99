"""Data of one's own for a recording: numbers with a row for each frame, for terms of the objective."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ...recording import Recording
from ..files import fault, keys_of, read_arrays
from ._sequence_file import frame_numbers, rows_of

_INDEX = "frame_index"


def read_data(path: str | Path, recording: Recording) -> Recording:
    """A recording with the data of a file: an `.npz` archive of arrays with a row for each frame, NaN where missing.

    With an array ``frame_index``, each row belongs to the frame of that number; frames without a row get NaN. Without
    it, there must be a row for each frame.

    Args:
        path: The file. Its keys are the names that terms find the data by, in ``observed.data``.
        recording: The recording.

    Raises:
        ValueError: One line that names the file and the key.
    """
    path = Path(path)
    arrays = read_arrays(path, required=(), optional=tuple(keys_of(path)))
    index = recording.frame_index
    if _INDEX in arrays:
        index = frame_numbers(path, arrays, arrays[_INDEX].size)
        if len(np.unique(index)) != len(index):
            raise fault(path, _INDEX, "holds a number twice; give one row for each frame")
    names = [name for name in arrays if name != _INDEX]
    if not names:
        raise fault(path, None, "has no arrays; give arrays of numbers with one row for each frame")
    rows = {name: rows_of(path, arrays, name, len(index)) for name in names}
    return recording.with_data(**{name: _by_frame(array, index, recording) for name, array in rows.items()})


def _by_frame(
    array: Float[np.ndarray, "rows ..."], index: Int[np.ndarray, " rows"], recording: Recording
) -> Float[np.ndarray, "frames ..."]:
    row = {number: place for place, number in enumerate(index.tolist())}
    found = np.full((len(recording), *array.shape[1:]), np.nan)
    for frame, number in enumerate(recording.frame_index.tolist()):
        if number in row:
            found[frame] = array[row[number]]
    return found
