"""Camera calibration from a checkerboard, with OpenCV.

In: videos or images of a board. Out: `BoardCalibration` with `Cameras` (intrinsics, and extrinsics in the frame of the
board). [`refine_cameras`][jaxskel.refine_cameras] can refine roughly right extrinsics from silhouettes.
"""

from ._board import Board as Board
from ._board import find_corners as find_corners
from ._films import StillBoard as StillBoard
from ._films import some_frames as some_frames
from ._films import still_board as still_board
from ._intrinsics import Intrinsics as Intrinsics
from ._intrinsics import board_intrinsics as board_intrinsics
from ._pose import camera_pose as camera_pose
from ._rig import BoardCalibration as BoardCalibration
from ._rig import calibrate_cameras as calibrate_cameras
