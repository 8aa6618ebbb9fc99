"""Silhouettes cut out of colour images by background subtraction."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Shaped

from ...segmentation import Background, Cleaning


@dataclass(frozen=True)
class CutOut:
    """A [`Matte`][]: the foreground by a background model, cleaned."""

    background: Background
    cleaning: Cleaning

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is."""
        return self.cleaning.apply(self.background.foreground(in_colour(image)))


def in_colour(image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w 3"]:
    """Convert any image to blue, green and red of 8 bits."""
    if image.dtype == np.uint16:
        image = (image // 257).astype(np.uint8)
    if image.ndim == 2 or image.shape[2] == 1:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    return np.ascontiguousarray(image[:, :, :3])
