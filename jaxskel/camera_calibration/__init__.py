"""Cameras calibrated: by a board (`from_boards`), or refined by the silhouettes (`from_silhouettes`)."""

from . import from_boards as from_boards
from . import from_silhouettes as from_silhouettes
