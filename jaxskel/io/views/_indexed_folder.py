"""A folder of label images: the palette indices are read, not the colours."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from ..files import fault
from ._image_folder import ImageFolder


class IndexedFolder:
    """The images of a folder, each read as palette indices."""

    fps = None

    def __init__(self, folder: ImageFolder, palette: UInt8[np.ndarray, "colours 3"]):
        """Take a folder and the palette that all of its images with as many colours must have."""
        self._folder, self._palette = folder, palette

    @property
    def path(self) -> Path:
        """The folder."""
        return self._folder.path

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of every image (px)."""
        return self._folder.size

    @property
    def span(self) -> tuple[int, int]:
        """Numbers of the first and the last image."""
        return self._folder.span

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user on how the images were numbered."""
        return self._folder.notes

    @property
    def numbers(self) -> list[int]:
        """Numbers of all images, in ascending order."""
        return self._folder.numbers

    def keeps_values(self) -> bool:
        """True: indices are exact."""
        return True

    def named(self, number: int) -> str:
        """The name of an image's file."""
        return self._folder.named(number)

    def read(self, number: int) -> UInt8[np.ndarray, "h w"] | None:
        """Read the indices; None if there is no file of this number."""
        indexed = self._folder.read_indexed(number)
        if indexed is None and number not in self._folder.numbers:
            return None
        if indexed is None or not _agree(indexed.palette, self._palette):
            told = "has no palette" if indexed is None else "has another palette"
            raise fault(self.path / self.named(number), None, f"{told} than the other masks; write all alike")
        return indexed.indices


def labelled(folder: ImageFolder, numbers: Iterable[int]) -> IndexedFolder | None:
    """The folder as label images if some of its images mark indices as labels; None if colours are what counts.

    Colours count if there is no palette, or not the same one in all images; if it is grey, so that black is the
    background whatever its index; and if its colours differ in opacity.
    """
    palettes: list[UInt8[np.ndarray, "colours 3"]] = []
    used: set[int] = set()
    for number in numbers:
        indexed = folder.read_indexed(number)
        if indexed is None or palettes and not _agree(indexed.palette, palettes[0]):
            return None
        palettes.append(indexed.palette)
        here = set(np.unique(indexed.indices).tolist())
        if any(indexed.opacity[index] < 255 for index in here - {0} if index < len(indexed.opacity)):
            return None
        used |= here
    palette = max(palettes, key=len)
    # In a view that shows nobody so far, only the background index is used.
    chosen = sorted(used) if len(used) > 1 else list(range(len(palette)))
    if chosen[-1] < len(palette):
        colours = palette[chosen]
        if (colours == colours[:, :1]).all() and len(np.unique(colours[:, 0])) == len(chosen):
            return None
    return IndexedFolder(folder, palette)


def _agree(some: UInt8[np.ndarray, "a 3"], others: UInt8[np.ndarray, "b 3"]) -> bool:
    """Whether two palettes are equal up to the length of the shorter one."""
    shorter = min(len(some), len(others))
    return bool((some[:shorter] == others[:shorter]).all())
