"""How often each value stands in a view's masks, and whether it fills areas or only edges."""

from collections import Counter
from collections.abc import Callable

import cv2
import numpy as np
from jaxtyping import Shaped

# Colours of a picture are not counted any further.
_ENOUGH = 4096
# Of an image, so much beside its most frequent value is more than noise.
_NOISE = 1e-3


class Tally:
    """Counts of values, as images are added."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self.flat: Counter[int] = Counter()
        """Of the pixels, those amid others of the same value."""
        self.varies = False
        """Whether there is an image that is not all alike."""
        self._depths: set[int] = set()

    def add(self, values: Shaped[np.ndarray, "h w"]) -> None:
        """Count one image's values: bytes, two bytes, or colours of 24 bits."""
        if len(self.counts) > _ENOUGH:
            return
        self._depths.add(values.itemsize)
        counts = _counted(values)
        self.varies |= max(counts.values()) < (1 - _NOISE) * values.size
        self.counts.update(counts)
        # Of black and white alone nobody asks.
        if values.itemsize <= 2 and len(counts) > 2:
            self.flat.update(_counted(values[cv2.erode(values, _AROUND) == cv2.dilate(values, _AROUND)]))

    def add_all(self, other: "Tally", code: int = 1) -> None:
        """Count what another has counted, its values times a number."""
        self.varies |= other.varies
        self._depths |= other._depths
        for own, others in ((self.counts, other.counts), (self.flat, other.flat)):
            own.update({value * code: count for value, count in others.items()})

    @property
    def top(self) -> int:
        """White: the largest value that there could be."""
        return 255 if max(self.counts, default=0) <= 255 else 65535

    @property
    def half(self) -> int:
        """The least that is at least half white."""
        return 128 * (self.top // 255)

    @property
    def white(self) -> int:
        """White of 16 bits: there are files that hold bytes in them; not so where nothing is seen yet."""
        return 255 if self._depths == {2} and self.varies and self.top == 255 else 65535

    def in_one_depth(self) -> None:
        """Bring values of 16 bits to those of 8, where there are both.

        Raises:
            ValueError: Where that would lose something.
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
        """Share of all pixels whose values fit."""
        return sum(count for value, count in self.counts.items() if fits(value)) / max(1, self.counts.total())

    def flatness(self, fits: Callable[[int], bool]) -> float:
        """Of the pixels whose values fit, the share that is amid others of the same value."""
        fitting = [value for value in self.counts if fits(value)]
        among = sum(self.flat[value] for value in fitting)
        return among / max(1, sum(self.counts[value] for value in fitting))


_AROUND = np.ones((3, 3), np.uint8)


def _counted(values: Shaped[np.ndarray, "*pixels"]) -> dict[int, int]:
    if values.itemsize <= 2:
        # Of bytes, OpenCV takes a tenth of NumPy's time.
        is_short = values.itemsize == 1
        counts = cv2.calcHist([values], [0], None, [256], [0, 256]) if is_short else np.bincount(values.ravel())
        counts = counts.ravel().astype(int)
        found = np.flatnonzero(counts)
        return dict(zip(found.tolist(), counts[found].tolist(), strict=True))
    # Black is most of a mask: it need not be sorted.
    lit = values[values > 0]
    found, counts = np.unique(lit, return_counts=True)
    some = dict(zip(found.tolist(), counts.tolist(), strict=True))
    return some | ({0: values.size - lit.size} if lit.size < values.size else {})
