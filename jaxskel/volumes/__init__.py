"""Voxels of a person, frame by frame, from whatever source: a scan, a depth rig, a simulation.

In: occupied voxels with their place in the world. Out: `Volumes` with z up for the graph, or a `Recording` of virtual
cameras around them.
"""

from ._virtual_recording import VIRTUAL_CAMERAS as VIRTUAL_CAMERAS
from ._virtual_recording import rendered as rendered
from ._virtual_recording import seen_by_virtual_cameras as seen_by_virtual_cameras
from ._virtual_recording import virtual_recording as virtual_recording
from ._volumes import AbstractOccupancy as AbstractOccupancy
from ._volumes import Volumes as Volumes
from ._volumes import hulls_of as hulls_of
from ._volumes import make_volumes as make_volumes
