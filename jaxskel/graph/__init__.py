"""The skeletal graph of a hull (Sect. 3.1).

In: `VisualHulls`. Out: a `SkeletalGraph` per frame: a pruned tree of centre-line nodes rooted at the head. Root finder
and skeletoniser are arguments.
"""

from ._followed_heights import FollowedHeights as FollowedHeights
from ._forest import Forest as Forest
from ._forest import forest_of as forest_of
from ._person_graphs import MIN_BRANCH as MIN_BRANCH
from ._person_graphs import person_graphs as person_graphs
from ._person_graphs import skeletal_graphs as skeletal_graphs
from ._root_finders import HeadBall as HeadBall
from ._root_finders import HighestVoxel as HighestVoxel
from ._root_finders import RootFinder as RootFinder
from ._scoop import scoop as scoop
from ._shells import shells as shells
from ._skeletal_graph import MAX_ENDS as MAX_ENDS
from ._skeletal_graph import SkeletalGraph as SkeletalGraph
from ._skeletal_graph import prune as prune
from ._skeletonisers import GeodesicShells as GeodesicShells
from ._skeletonisers import Skeletoniser as Skeletoniser
from ._skeletonisers import VoxelScooping as VoxelScooping
from ._thinnest_paths import ThinnestPaths as ThinnestPaths
