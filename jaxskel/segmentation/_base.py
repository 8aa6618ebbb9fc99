"""Interface of a background model."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, UInt8


@runtime_checkable
class Background(Protocol):
    """A background model that separates a person from the background."""

    def foreground(self, image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """The raw silhouette (True = person) in a colour image: blue, green, red, as OpenCV reads it."""
        ...
