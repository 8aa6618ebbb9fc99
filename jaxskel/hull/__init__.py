"""Visual hulls by space carving on a voxel grid, and the person in each hull (Sect. 3).

In: packed silhouettes and cameras. Out: `VisualHulls`, the occupied voxels of the one person in each frame, with a
status for each frame without one.
"""

from ._carve import carve as carve
from ._carve_soft import carve_soft as carve_soft
from ._connected_bodies import Bodies as Bodies
from ._connected_bodies import bodies_among as bodies_among
from ._connected_bodies import find_bodies as find_bodies
from ._frame_bits import FRAMES_PER_WORD as FRAMES_PER_WORD
from ._grid import VoxelGrid as VoxelGrid
from ._grid import check_spacing as check_spacing
from ._grid import make_grid as make_grid
from ._grid_placement import body_middles as body_middles
from ._grid_placement import place_grid as place_grid
from ._max_misses import judge_misses as judge_misses
from ._max_misses import most_misses as most_misses
from ._others import without_others as without_others
from ._people import find_people as find_people
from ._people import observed_edge as observed_edge
from ._projection_table import ProjectionTable as ProjectionTable
from ._projection_table import projecting as projecting
from ._projection_table import projection_table as projection_table
from ._reproject import agreement as agreement
from ._reproject import reproject as reproject
from ._see_people import Seen as Seen
from ._see_people import Stopwatch as Stopwatch
from ._see_people import middles_of_people as middles_of_people
from ._see_people import see_bodies as see_bodies
from ._see_people import see_people as see_people
from ._see_people import trust_views as trust_views
from ._visual_hulls import VisualHulls as VisualHulls
from ._visual_hulls import hulls_from_dense as hulls_from_dense
