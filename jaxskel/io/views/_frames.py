"""The interface of image sources of one camera."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Shaped


@runtime_checkable
class Frames(Protocol):
    """The images of one camera, numbered as their files are, or from 0."""

    @property
    def path(self) -> Path:
        """File or folder, for messages."""
        ...

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of every image (px)."""
        ...

    @property
    def span(self) -> tuple[int, int]:
        """Numbers of the first and the last image; images between them may be missing."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user on how the images were numbered."""
        ...

    @property
    def numbers(self) -> Sequence[int]:
        """Numbers of all images, in ascending order."""
        ...

    @property
    def fps(self) -> float | None:
        """Images per second, if the file states it."""
        ...

    def keeps_values(self) -> bool:
        """Whether pixel values are kept exactly, so that labels survive."""
        ...

    def named(self, number: int) -> str:
        """Name of an image, for messages."""
        ...

    def read(self, number: int) -> Shaped[np.ndarray, "h w *channels"] | None:
        """Read an image with OpenCV's channels: grey, or blue, green, red; None if it is missing.

        Ascending numbers are read in one pass.

        Raises:
            ValueError: One line that names the file and the image, if it is damaged or of another size.
        """
        ...
