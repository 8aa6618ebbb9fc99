"""Numbers in a page: little-endian arrays in base64, which a browser reads as typed arrays."""

import base64

import numpy as np


def packed(array: np.ndarray, kind: str) -> str:
    """The numbers of an array, row by row, as base64; `kind` is NumPy's code of what JavaScript reads ("<i2")."""
    return base64.b64encode(np.ascontiguousarray(array, kind).tobytes()).decode("ascii")


def packed_size(size: int) -> int:
    """Characters that so many bytes take at the most."""
    return (size + 2) // 3 * 4
