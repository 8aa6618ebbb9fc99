"""Recordings: calibrated, synchronised silhouettes of one person (Sect. 3).

In: packed silhouettes, cameras, frames per second. Out: a `Recording` that can be sliced like a list of frames, its
empty views, and its up axis.
"""

from .._math.up_axes import UP_AXES as UP_AXES
from .._math.up_axes import rotation_to_z_up as rotation_to_z_up
from ._frame_rows import recording_rows as recording_rows
from ._frame_rows import rows_by_index as rows_by_index
from ._recording import Recording as Recording
from ._recording import Truth as Truth
from ._recording import pack_silhouettes as pack_silhouettes
from ._recording import unpack_silhouettes as unpack_silhouettes
from ._recording import unpack_view as unpack_view
from ._silhouettes import AbstractSilhouettes as AbstractSilhouettes
from ._silhouettes import Silhouettes as Silhouettes
from ._views import MIN_VIEWS as MIN_VIEWS
from ._views import Box as Box
from ._views import find_empty_views as find_empty_views
from ._views import person_boxes as person_boxes
from ._views import silhouette_areas as silhouette_areas
from ._views import silhouette_centroids as silhouette_centroids
from ._views import unpacked_box as unpacked_box
