"""Drawing: silhouettes, hulls and skeletons over images.

In: a recording and its results. Out: images. `figures` and `plots` need Matplotlib and must be imported explicitly;
`report` and `viewer` are subpackages.
"""

from ._overlays import draw_box as draw_box
from ._overlays import draw_hull as draw_hull
from ._overlays import draw_silhouette as draw_silhouette
from ._overlays import draw_skeleton as draw_skeleton
from ._overlays import tile as tile
from ._people import check_people as check_people
from ._skeleton_style import LEFT as LEFT
from ._skeleton_style import PEOPLE as PEOPLE
from ._skeleton_style import RIGHT as RIGHT
from ._skeleton_style import colours_of as colours_of
from ._skeleton_style import drawn_bones as drawn_bones
from ._skeleton_style import node_labels as node_labels
from ._skeleton_style import thickness as thickness
