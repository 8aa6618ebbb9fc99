"""One camera of a recording: its images, the rule that finds the silhouette in them, and its timing."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from ..files import fault
from ._frames import Frames
from ._masks import Matte


@dataclass(frozen=True)
class View:
    """One camera's silhouettes by frame number of the recording.

    Attributes:
        offset: Number of the image that belongs to frame 0 of the recording.
        speed: Images for each frame of the recording: the camera's frame rate over the recording's.
    """

    name: str
    frames: Frames
    matte: Matte
    offset: int = 0
    speed: float = 1.0

    @property
    def span(self) -> tuple[int, int]:
        """First and last frame of the recording for which this view has an image."""
        first, last = self.frames.span
        lowest = int(np.ceil((first - self.offset - 0.5) / self.speed))
        highest = int(np.floor((last - self.offset + 0.5) / self.speed))
        return lowest + (self._image_of(lowest) < first), highest - (self._image_of(highest) > last)

    def silhouette(self, frame: int) -> Bool[np.ndarray, "h w"]:
        """True where the person is; all False if the camera has no image of this frame.

        Raises:
            ValueError: One line that names the file, and the frame if its image is unusable.
        """
        number = self._image_of(frame)
        image = self.frames.read(number)
        if image is None:
            width, height = self.frames.size
            return np.zeros((height, width), bool)
        try:
            return self.matte.foreground(image)
        except ValueError as error:
            raise fault(self.frames.path, None, f"{self.frames.named(number)} {error}") from None

    def _image_of(self, frame: int) -> int:
        """Number of the image nearest in time."""
        return int(np.floor(frame * self.speed + 0.5)) + self.offset
