"""A folder of images whose colours stand for labels: the indices of a palette are read, not the colours."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from ..files import fault
from ._image_folder import ImageFolder


class IndexedFolder:
    """The images of a folder, each as the indices of its palette."""

    fps = None

    def __init__(self, folder: ImageFolder, palette: UInt8[np.ndarray, "colours 3"]):
        """Take the folder's images; of their palettes, all that have as many colours must have these."""
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
        """What a person should know of how the images were numbered."""
        return self._folder.notes

    @property
    def numbers(self) -> list[int]:
        """Numbers of all images, in ascending order."""
        return self._folder.numbers

    def keeps_values(self) -> bool:
        """An index is an index."""
        return True

    def named(self, number: int) -> str:
        """The name of an image's file."""
        return self._folder.named(number)

    def read(self, number: int) -> UInt8[np.ndarray, "h w"] | None:
        """Indices; None where there is no file of this number."""
        indexed = self._folder.read_indexed(number)
        if indexed is None and number not in self._folder.numbers:
            return None
        if indexed is None or not _agree(indexed.palette, self._palette):
            told = "has no palette" if indexed is None else "has another palette"
            raise fault(self.path / self.named(number), None, f"{told} than the other masks; write all alike")
        return indexed.indices


def labelled(folder: ImageFolder, numbers: Iterable[int]) -> IndexedFolder | None:
    """The folder's indices, where some of its images say that these are labels; None where colours are what counts.

    Colours count where there is no palette, or not the same in all; where it is grey, so that black is the background,
    whatever its index; and where its colours are opaque or not.
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
    # Of a view in which nobody is yet, nothing but the background is used.
    chosen = sorted(used) if len(used) > 1 else list(range(len(palette)))
    if chosen[-1] < len(palette):
        colours = palette[chosen]
        if (colours == colours[:, :1]).all() and len(np.unique(colours[:, 0])) == len(chosen):
            return None
    return IndexedFolder(folder, palette)


def _agree(some: UInt8[np.ndarray, "a 3"], others: UInt8[np.ndarray, "b 3"]) -> bool:
    """Whether two palettes are the same as far as both go."""
    shorter = min(len(some), len(others))
    return bool((some[:shorter] == others[:shorter]).all())
