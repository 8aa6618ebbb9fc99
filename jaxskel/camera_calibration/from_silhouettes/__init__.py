"""Refines camera extrinsics until the silhouettes of all views agree.

In: a recording with a roughly right calibration. Out: `RefinedCameras`.
"""

from ._refine_cameras import FRAMES as FRAMES
from ._refine_cameras import RefinedCameras as RefinedCameras
from ._refine_cameras import refine_cameras as refine_cameras
