"""Camera calibration, which the paper takes as given.

In: films of a checkerboard (`from_boards`), or silhouettes and a rough calibration (`from_silhouettes`).
Out: `Cameras`.
"""

from . import from_boards as from_boards
from . import from_silhouettes as from_silhouettes
