"""Evidence from silhouettes: viewing rays along their outlines, and signed distances to them.

In: packed silhouettes and cameras. Out: `Contours` and `SilhouetteDistances`, which objectives compare a body with. Not
in the paper, which uses only the hull.
"""

from ._credible_rays import credible as credible
from ._distances import SilhouetteDistances as SilhouetteDistances
from ._distances import signed_distances as signed_distances
from ._distances import silhouette_distances as silhouette_distances
from ._rays import RAYS as RAYS
from ._rays import Contours as Contours
from ._rays import contours as contours
from ._rays import outline as outline
from ._tangency import ConvexOutline as ConvexOutline
from ._tangency import convex_outline as convex_outline
from ._tangency import pairs_of as pairs_of
from ._tangency import tangent_misses as tangent_misses
