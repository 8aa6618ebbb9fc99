"""Camera extrinsics refined until the silhouettes agree with each other.

In: a recording with a roughly right calibration. Out: `RefinedCameras`.
"""

from ._refine_cameras import FRAMES as FRAMES
from ._refine_cameras import RefinedCameras as RefinedCameras
from ._refine_cameras import refine_cameras as refine_cameras
