"""Faults that a view's images may have, each as the change to its silhouettes that would mend it."""

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from jaxtyping import Bool

Masks = Bool[np.ndarray, "frames rows columns"]

# A scale that is off by less than this is ignored, and only the shift reported: hulls of few views exceed the body.
_RESIZED = 0.07


class ImageRepair(Protocol):
    """A change to the silhouettes of a view."""

    def apply(self, masks: Masks) -> Masks:
        """Return the silhouettes as they would be without the fault, at the same size."""
        ...

    @property
    def told(self) -> str:
        """The fault, as a predicate whose subject is the view: 'is mirrored'."""
        ...

    @property
    def keeps_size(self) -> bool:
        """Whether the person covers as many pixels as before."""
        ...


@dataclass(frozen=True)
class HalfTurn:
    """Images that are upside down."""

    told = "is turned by 180 degrees (turn = 180 in recording.toml says so)"
    keeps_size = True

    def apply(self, masks: Masks) -> Masks:
        """Turn them back."""
        return masks[:, ::-1, ::-1]


@dataclass(frozen=True)
class Mirrored:
    """Images with left and right exchanged, which no rotation of a camera can produce."""

    told = "is mirrored left to right (flip its images)"
    keeps_size = True

    def apply(self, masks: Masks) -> Masks:
        """Flip them."""
        return masks[:, :, ::-1]


@dataclass(frozen=True)
class Flipped:
    """Images with top and bottom exchanged but not left and right, as some image formats store them."""

    told = "is flipped top to bottom (flip its images)"
    keeps_size = True

    def apply(self, masks: Masks) -> Masks:
        """Flip them."""
        return masks[:, ::-1]


@dataclass(frozen=True)
class QuarterTurn:
    """Images that lie on their side, cut or padded to the size of upright ones.

    Attributes:
        quarters: Number of counterclockwise turns by 90 degrees that mend it.
    """

    quarters: int
    keeps_size: bool = False

    @property
    def told(self) -> str:
        """The fault."""
        return f"is turned by {90 * self.quarters} degrees (turn = {90 * self.quarters} in recording.toml says so)"

    def apply(self, masks: Masks) -> Masks:
        """Turn them back about the middle of the image."""
        turned = np.rot90(masks, self.quarters, (1, 2))
        found = np.zeros_like(masks)
        rows, columns = (min(a, b) for a, b in zip(masks.shape[1:], turned.shape[1:], strict=True))
        to, of = ([(n - m) // 2 for n, m in zip(s.shape[1:], (rows, columns), strict=True)] for s in (found, turned))
        part = turned[:, of[0] : of[0] + rows, of[1] : of[1] + columns]
        found[:, to[0] : to[0] + rows, to[1] : to[1] + columns] = part
        return found


@dataclass(frozen=True)
class Inverted:
    """Masks in which the person is black."""

    told = "is inverted: the person is the background of its masks"
    keeps_size = False

    def apply(self, masks: Masks) -> Masks:
        """Swap person and background."""
        return ~masks


@dataclass(frozen=True)
class Similarity:
    """Images that are shifted, resized or rolled relative to the calibration.

    Attributes:
        scale: Size of the image relative to the calibrated one, about the middle of the image.
        down: How far the image lies to the right of and below its place (reduced px).
        roll: Rotation of the image about its middle (rad).
    """

    scale: float
    right: float
    down: float
    roll: float = 0.0

    def told(self, step: int, focal: float) -> str:
        """The fault in words.

        Args:
            step: Side length in image pixels of one reduced pixel.
            focal: Focal length of the camera (reduced px).
        """
        if abs(self.scale - 1) > _RESIZED:
            return (
                f"is resized: the person is about {self.scale:.2f} times as large as the others say (scale in "
                "recording.toml, or the calibration of this image size)"
            )
        turned = np.degrees(np.hypot(np.arctan(np.hypot(self.right, self.down) / focal), self.roll))
        return (
            f"is not where its calibration has it: its camera was moved, by about {turned:.1f} degrees (calibrate it "
            f"again; jaxskel refine-cameras mends small errors), or its images are cut, by about "
            f"[{-step * self.right:.0f}, {-step * self.down:.0f}] px (crop in recording.toml)"
        )

    def apply(self, masks: Masks) -> Masks:
        """Move them to where the calibration expects them."""
        rows, columns = masks.shape[1:]
        middle = np.array([columns - 1, rows - 1]) / 2
        cosine, sine = np.cos(self.roll) * self.scale, np.sin(self.roll) * self.scale
        # OpenCV wants the map from the calibrated image to the actual one.
        linear = np.array([[cosine, -sine], [sine, cosine]])
        matrix = np.column_stack([linear, middle - linear @ middle + [self.right, self.down]])
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.stack([cv2.warpAffine(m.astype(np.uint8), matrix, (columns, rows), flags=flags) > 0 for m in masks])


DISCRETE: tuple[ImageRepair, ...] = (
    HalfTurn(), Mirrored(), Flipped(), QuarterTurn(1), QuarterTurn(3), Inverted(),
)  # fmt: skip
"""Faults without a continuous parameter."""
