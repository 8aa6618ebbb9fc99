"""Silhouettes made from views, each computed once."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Int, UInt8

from ...recording import AbstractSilhouettes
from ._view import View


class ViewSilhouettes(AbstractSilhouettes):
    """Packed silhouettes of views, frame by frame.

    Videos can only be read forwards and background subtraction is slow, so all silhouettes up to the last requested
    frame are kept: in memory, or in a temporary file if they are large.
    """

    def __init__(self, views: Sequence[View], numbers: Int[np.ndarray, " frames"], in_memory: int):
        """Prepare for frames of ascending numbers; silhouettes larger than `in_memory` (bytes) go into a file."""
        self._views, self._numbers = tuple(views), numbers
        width, height = np.max([view.frames.size for view in views], axis=0).tolist()
        self.shape = len(numbers), len(views), height, -(-width // 8)
        self._made = 0
        self._file = None
        if np.prod(self.shape) <= in_memory:
            self._packed = np.zeros(self.shape, np.uint8)
        else:
            # Deleted when it is closed, at the latest with the process.
            self._file = tempfile.NamedTemporaryFile(prefix="jaxskel-")
            self._packed = np.memmap(Path(self._file.name), np.uint8, "w+", shape=self.shape)

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        """Read some frames, computing those that do not exist yet.

        Raises:
            ValueError: One line that names the file and the frame.
        """
        while self._made <= frames.max(initial=-1):
            for camera, view in enumerate(self._views):
                bits = np.packbits(view.silhouette(int(self._numbers[self._made])), axis=-1)
                self._packed[self._made, camera, : bits.shape[0], : bits.shape[1]] = bits
            self._made += 1
        return np.asarray(self._packed[frames])
