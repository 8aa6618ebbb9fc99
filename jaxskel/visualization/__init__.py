"""Drawing: silhouettes, hulls and skeletons over images.

In: a recording and its results. Out: images. `figures` and `plots` need Matplotlib and must be imported explicitly;
`report` and `viewer` are subpackages.
"""

from ._overlays import LEFT as LEFT
from ._overlays import MIDDLE as MIDDLE
from ._overlays import RIGHT as RIGHT
from ._overlays import draw_box as draw_box
from ._overlays import draw_hull as draw_hull
from ._overlays import draw_silhouette as draw_silhouette
from ._overlays import draw_skeleton as draw_skeleton
from ._overlays import tile as tile
