"""What a page shows: the frames, the bodies that are drawn over them, and the page itself for given silhouettes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ._overlays import Overlays


@dataclass(frozen=True)
class Content:
    """The content of a page but for its silhouettes, of which there are as many as it has room for.

    Attributes:
        rows: Frame of the recording for each frame of the page.
        bodies: Joints and tips of each person in the world (m), NaN without a pose.
        page: The page as text, with these silhouettes.
    """

    rows: Int[np.ndarray, " frames"]
    bodies: Float[np.ndarray, "people frames points 3"]
    page: Callable[[Overlays], str]
