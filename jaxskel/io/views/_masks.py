"""What a silhouette is in an image."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Shaped

from ._mask_values import MOST_VALUES, Grey, Values, told


@runtime_checkable
class Matte(Protocol):
    """Tells the person from the rest of an image."""

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is.

        Raises:
            ValueError: What is wrong with the image; the caller adds which one it is.
        """
        ...


@runtime_checkable
class Choice(Protocol):
    """Which values of a mask are the person."""

    def chosen(self, values: Shaped[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is.

        Raises:
            ValueError: What is wrong with the values.
        """
        ...


@dataclass(frozen=True)
class HalfWhite:
    """What is at least half white is the person."""

    exact: bool = False
    """Whether other images of the view hold two values only, so that dark ones are a number and no noise."""
    white: int = 65535
    """Of 16 bits, what is white; in some files it is 255."""

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


# Numbers of parts or people are few; dark edges of a soft mask have more levels, or are no larger than specks.
_FEW, _SPECKS = 32, 1e-3


@dataclass(frozen=True)
class NotBackground:
    """What is not 0 is the person."""

    known: tuple[int, ...]
    """Values that other images of the view have, in ascending order."""
    void: tuple[int, ...] = (255, 65535)
    """Values that mean "unknown" in many tools where they are not known."""

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
    """These values are the person."""

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
    """Images that are masks already. Where nothing else is said, what is at least half white is the person."""

    values: Values = Grey()
    choice: Choice = HalfWhite()

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is."""
        return self.choice.chosen(self.values.of(image))
