"""Counts the values of a view's masks, and whether they fill areas or only edges."""

from collections import Counter
from collections.abc import Callable

import cv2
import numpy as np
from jaxtyping import Shaped

# Counting stops at this many different values: the image is then a colour picture.
_ENOUGH = 4096
# Largest share of an image that noise takes besides its most frequent value.
_NOISE = 1e-3


class Tally:
    """Counts of values, accumulated over images."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self.flat: Counter[int] = Counter()
        """Counts of pixels whose neighbours all have the same value."""
        self.varies = False
        """Whether some image has more than one value (besides noise)."""
        self._depths: set[int] = set()

    def add(self, values: Shaped[np.ndarray, "h w"]) -> None:
        """Count the values of one image: 8 bits, 16 bits, or 24-bit colours."""
        if len(self.counts) > _ENOUGH:
            return
        self._depths.add(values.itemsize)
        counts = _counted(values)
        self.varies |= max(counts.values()) < (1 - _NOISE) * values.size
        self.counts.update(counts)
        # Flatness does not matter for black and white alone.
        if values.itemsize <= 2 and len(counts) > 2:
            self.flat.update(_counted(values[cv2.erode(values, _AROUND) == cv2.dilate(values, _AROUND)]))

    def add_all(self, other: "Tally", code: int = 1) -> None:
        """Add another tally's counts, with its values times `code`."""
        self.varies |= other.varies
        self._depths |= other._depths
        for own, others in ((self.counts, other.counts), (self.flat, other.flat)):
            own.update({value * code: count for value, count in others.items()})

    @property
    def top(self) -> int:
        """White level: the largest value that is possible."""
        return 255 if max(self.counts, default=0) <= 255 else 65535

    @property
    def half(self) -> int:
        """Least value that is at least half white."""
        return 128 * (self.top // 255)

    @property
    def white(self) -> int:
        """White level of 16-bit images; 255 if the files hold 8-bit values, provided that something is seen in them."""
        return 255 if self._depths == {2} and self.varies and self.top == 255 else 65535

    def in_one_depth(self) -> None:
        """Convert 16-bit values to 8 bits if both occur.

        Raises:
            ValueError: If that would lose information.
        """
        if self._depths != {1, 2}:
            return
        if any(value > 255 and value % 257 for value in self.counts):
            raise ValueError("some masks have 8 bits, others 16, and not the same values; write all alike")
        for name in ("counts", "flat"):
            scaled: Counter[int] = Counter()
            for value, count in getattr(self, name).items():
                scaled[value // 257 if value > 255 else value] += count
            setattr(self, name, scaled)

    def share(self, fits: Callable[[int], bool]) -> float:
        """Share of all pixels whose values satisfy `fits`."""
        return sum(count for value, count in self.counts.items() if fits(value)) / max(1, self.counts.total())

    def flatness(self, fits: Callable[[int], bool]) -> float:
        """Share of pixels with only equal neighbours, among those whose values satisfy `fits`."""
        fitting = [value for value in self.counts if fits(value)]
        among = sum(self.flat[value] for value in fitting)
        return among / max(1, sum(self.counts[value] for value in fitting))


_AROUND = np.ones((3, 3), np.uint8)


def _counted(values: Shaped[np.ndarray, "*pixels"]) -> dict[int, int]:
    if values.itemsize <= 2:
        # For 8-bit values, OpenCV takes a tenth of NumPy's time.
        is_short = values.itemsize == 1
        counts = cv2.calcHist([values], [0], None, [256], [0, 256]) if is_short else np.bincount(values.ravel())
        counts = counts.ravel().astype(int)
        found = np.flatnonzero(counts)
        return dict(zip(found.tolist(), counts[found].tolist(), strict=True))
    # Most of a mask is black, which need not be sorted.
    lit = values[values > 0]
    found, counts = np.unique(lit, return_counts=True)
    some = dict(zip(found.tolist(), counts.tolist(), strict=True))
    return some | ({0: values.size - lit.size} if lit.size < values.size else {})
