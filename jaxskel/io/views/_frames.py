"""Where a camera's images come from."""

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
        """Numbers of the first and the last image; some between them may be missing."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of how the images were numbered."""
        ...

    @property
    def numbers(self) -> Sequence[int]:
        """Numbers of all images, in ascending order."""
        ...

    @property
    def fps(self) -> float | None:
        """Images per second, where the file says it."""
        ...

    def keeps_values(self) -> bool:
        """Whether pixels are as they were written, so that a 1 is a 1."""
        ...

    def named(self, number: int) -> str:
        """What an image is called, for messages."""
        ...

    def read(self, number: int) -> Shaped[np.ndarray, "h w *channels"] | None:
        """An image, as OpenCV reads it: grey, or blue, green, red; None where it is missing.

        Numbers that ascend are read in one pass.

        Raises:
            ValueError: One line that names the file and the image, where it is damaged or of another size.
        """
        ...
