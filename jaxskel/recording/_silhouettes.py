"""Silhouettes that are read from storage on access, so that memory does not limit the length of a recording."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Int, UInt8

# Frames per batch when all frames are read.
_AT_ONCE = 32


class AbstractSilhouettes(ABC):
    """Packed bits of frames that are stored elsewhere, indexed like an array ``frames cams h w8``.

    Attributes:
        shape: Frames, cameras, height (px), width (bytes of 8 px).
    """

    shape: tuple[int, int, int, int]

    @abstractmethod
    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        """Read some frames, in ascending order."""

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> UInt8[np.ndarray, "..."]:
        """Read the frames of a number, a slice or an array of numbers; indices of other axes may follow."""
        frames, *others = index if isinstance(index, tuple) else (index,)
        chosen = np.arange(len(self))[frames]
        found = self.read(np.atleast_1d(chosen))
        return found[(slice(None) if np.ndim(chosen) else 0, *others)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """All frames, in memory."""
        return np.asarray(self[:], dtype)

    def batches(self) -> Iterator[UInt8[np.ndarray, "some cams h w8"]]:
        """Iterate over all frames in batches."""
        for start in range(0, len(self), _AT_ONCE):
            yield self[start : start + _AT_ONCE]


Silhouettes = UInt8[np.ndarray, "frames cams h w8"] | AbstractSilhouettes
