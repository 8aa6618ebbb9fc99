"""Packs numbers for a page: little-endian arrays in base64, which a browser reads as typed arrays."""

import base64

import numpy as np


def packed(array: np.ndarray, kind: str) -> str:
    """An array's numbers, row by row, as base64; `kind` is NumPy's code of the type that JavaScript reads ("<i2")."""
    return base64.b64encode(np.ascontiguousarray(array, kind).tobytes()).decode("ascii")


def packed_size(size: int) -> int:
    """Number of characters of `size` bytes in base64, at most."""
    return (size + 2) // 3 * 4
