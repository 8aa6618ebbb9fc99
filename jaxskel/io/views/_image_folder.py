"""Images as a folder with one file for each frame."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from ..files import Indexed, fault, keeps_values, read_image, read_indexed
from ._frame_numbers import number_images

SUFFIXES = (".png", ".bmp", ".tif", ".tiff", ".jpg", ".jpeg", ".webp", ".gif", ".pbm", ".pgm", ".ppm", ".pnm")
"""Suffixes of supported images."""
UNREAD_SUFFIXES = (".heic", ".heif", ".avif", ".jp2", ".j2k", ".jpf", ".jpx", ".jxl", ".exr", ".hdr", ".pfm", ".pam",
                   ".tga", ".psd", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".raw", ".dcm",
                   ".svg")  # fmt: skip
"""Suffixes of unsupported images."""


class ImageFolder:
    """Images whose names hold the frame number: ``000012.png``, ``cam1_12.png``, ``12_640x480.png``."""

    fps = None

    def __init__(self, path: Path):
        """List the files; only the first image, which sets the size of all, is read now.

        Raises:
            ValueError: One line, if there are no images, or their names do not tell their frame numbers.
        """
        self.path = path
        try:
            files = sorted(path.iterdir())
        except OSError as error:
            raise fault(path, None, f"cannot be read ({error.strerror}); check the path") from None
        images = [file for file in files if is_image(file)]
        unread = unread_suffixes(files if not images else _numbered_alone(files, images))
        if unread:
            kinds = " and ".join(unread)
            raise fault(path, None, f"there are {kinds} images, which are not read; convert them to PNG")
        if not images:
            raise fault(path, None, f"holds no images ({', '.join(SUFFIXES)}); check the path")
        numbered = number_images(path, images)
        self._files, self.notes = numbered.files, numbered.notes
        height, width = read_image(self._files[self.span[0]]).shape[:2]
        self.size = width, height

    @property
    def span(self) -> tuple[int, int]:
        """Numbers of the first and the last image."""
        return min(self._files), max(self._files)

    @property
    def numbers(self) -> list[int]:
        """Numbers of all images, in ascending order."""
        return list(self._files)

    def keeps_values(self) -> bool:
        """Whether pixel values are kept exactly, as in PNG; judged by the first image of each suffix."""
        firsts = {file.suffix.lower(): file for file in reversed(self._files.values())}
        return all(keeps_values(file) for file in firsts.values())

    def named(self, number: int) -> str:
        """The name of an image's file."""
        return self._files[number].name

    def read(self, number: int) -> Shaped[np.ndarray, "h w *channels"] | None:
        """Read an image; None if there is no file of this number."""
        file = self._files.get(number)
        if file is None:
            return None
        image = read_image(file)
        self._check_size(file, image)
        return image

    def read_indexed(self, number: int) -> Indexed | None:
        """Read an image as palette indices; None if it has no palette, or there is no file of this number."""
        file = self._files.get(number)
        indexed = None if file is None else read_indexed(file)
        if file is not None and indexed is not None:
            self._check_size(file, indexed.indices)
        return indexed

    def _check_size(self, file: Path, image: Shaped[np.ndarray, "h w *channels"]) -> None:
        height, width = image.shape[:2]
        if (width, height) != self.size:
            first = self._files[self.span[0]].name
            raise fault(file, None, f"is {width} x {height} px, but {first} {self.size[0]} x {self.size[1]}")


def is_image(file: Path) -> bool:
    """Whether a file name is that of an image, and not of a hidden file."""
    return file.suffix.lower() in SUFFIXES and not file.name.startswith(".")


def unread_suffixes(files: Iterable[Path]) -> list[str]:
    """Suffixes of unsupported images among these files."""
    suffixes = {file.suffix.lower() for file in files if not file.name.startswith(".")}
    return sorted(suffixes & set(UNREAD_SUFFIXES))


def _numbered_alone(files: list[Path], images: list[Path]) -> Iterator[Path]:
    """Files that may be frames themselves, rather than side files that a camera keeps beside an image."""
    stems = {image.stem for image in images}
    return (file for file in files if file.stem not in stems and re.search("[0-9]", file.stem))
