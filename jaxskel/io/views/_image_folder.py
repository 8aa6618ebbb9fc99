"""A folder with an image file for each frame."""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from .._archive import fault
from .._images import read_image

SUFFIXES = (".png", ".bmp", ".tif", ".tiff", ".jpg", ".jpeg")


class ImageFolder:
    """Images that carry their frame's number at the end of their name: ``000012.png``, ``cam1_12.png``."""

    fps = None

    def __init__(self, path: Path):
        """List the files; images are read when they are asked for, but for the first, whose size all must have.

        Raises:
            ValueError: One line, where there are none, or two of the same number.
        """
        self.path = path
        self._files: dict[int, Path] = {}
        try:
            files = sorted(file for file in path.iterdir() if is_image(file))
        except OSError as error:
            raise fault(path, None, f"cannot be read ({error.strerror}); check the path") from None
        for file in files:
            digits = re.search(r"(\d+)\D*$", file.stem)
            if digits is None or len(digits[1]) > 9:
                raise fault(file, None, "has no frame number in its name; call it 000000.png, 000001.png, ...")
            number = int(digits[1])
            if number in self._files:
                raise fault(file, None, f"is frame {number}, as {self._files[number].name} is; remove one of them")
            self._files[number] = file
        if not self._files:
            raise fault(path, None, f"holds no images ({', '.join(SUFFIXES)}); check the path")
        height, width = read_image(self._files[self.span[0]]).shape[:2]
        self.size = width, height

    @property
    def span(self) -> tuple[int, int]:
        """Numbers of the first and the last image."""
        return min(self._files), max(self._files)

    @property
    def lossless(self) -> bool:
        """Whether a 0 is a 0."""
        return not any(file.suffix.lower() in (".jpg", ".jpeg") for file in self._files.values())

    def read(self, number: int) -> Shaped[np.ndarray, "h w *channels"] | None:
        """An image; None where there is no file of this number."""
        file = self._files.get(number)
        if file is None:
            return None
        image = read_image(file)
        height, width = image.shape[:2]
        if (width, height) != self.size:
            first = self._files[self.span[0]].name
            raise fault(file, None, f"is {width} x {height} px, but {first} {self.size[0]} x {self.size[1]}")
        return image


def is_image(file: Path) -> bool:
    """Whether a file is an image by its name, and not a hidden one."""
    return file.suffix.lower() in SUFFIXES and not file.name.startswith(".")
