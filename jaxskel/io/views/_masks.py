"""Rules that find the silhouette in an image."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Shaped

from ._mask_values import MOST_VALUES, Grey, Values, told


@runtime_checkable
class Matte(Protocol):
    """Separates the person from the rest of an image."""

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is.

        Raises:
            ValueError: What is wrong with the image; the caller adds which one it is.
        """
        ...


@runtime_checkable
class Choice(Protocol):
    """Selects the mask values that are the person."""

    def chosen(self, values: Shaped[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is.

        Raises:
            ValueError: What is wrong with the values.
        """
        ...


@dataclass(frozen=True)
class HalfWhite:
    """The person is what is at least half white.

    Attributes:
        exact: Whether other images of the view hold only two values, so that dark values are labels rather than noise.
        white: White level of 16-bit images; in some files it is 255.
    """

    exact: bool = False
    white: int = 65535

    def chosen(self, values: Shaped[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """True where the mask is at least half white."""
        half = 128 if values.dtype == np.uint8 else 128 * (self.white // 255)
        brightest = int(values.max())
        if values.dtype != np.uint8 and brightest > self.white:
            raise ValueError(f"holds {brightest}, but others no more than {self.white}; write all alike")
        darkest = int(values.min())
        if self.exact and darkest < brightest < half:
            found = np.unique(values).tolist()
            if len(found) <= _FEW and np.count_nonzero(values > darkest) > _SPECKS * values.size:
                raise ValueError(f"holds {told(found)}, but others white; write all alike, 0 and 255")
        return values >= half


# Labels have at most the first number of values; dark edges of a soft mask have more, or a smaller area share.
_FEW, _SPECKS = 32, 1e-3


@dataclass(frozen=True)
class NotBackground:
    """The person is everything that is not 0.

    Attributes:
        known: Values that other images of the view have, in ascending order.
        void: Values that many tools use for "unknown", unless they are among the known ones.
    """

    known: tuple[int, ...]
    void: tuple[int, ...] = (255, 65535)

    def chosen(self, values: Shaped[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """True where the mask is not 0."""
        mask = values > 0
        if values.max() > self.known[-1]:
            found = np.unique(values[mask]).tolist()
            if found[-1] in self.void or len(found) > MOST_VALUES:
                raise ValueError(
                    f"holds {told(found)}, but others {told(self.known)}; name those of the person, person = [...]"
                )
        return mask


@dataclass(frozen=True)
class Among:
    """The person is one of these values."""

    values: tuple[int, ...]

    def chosen(self, values: Shaped[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """True where the mask has one of the values."""
        if values.itemsize > 2:
            return np.isin(values, self.values)
        table = np.zeros(2 ** (8 * values.itemsize), bool)
        table[[value for value in self.values if value < len(table)]] = True
        return table[values]


@dataclass(frozen=True)
class Masks:
    """Images that are masks already; by default, the person is what is at least half white."""

    values: Values = Grey()
    choice: Choice = HalfWhite()

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is."""
        return self.choice.chosen(self.values.of(image))
