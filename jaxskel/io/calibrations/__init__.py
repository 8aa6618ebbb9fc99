"""Calibrations of other tools, one reader for each format.

In: a calibration file or folder. Out: a validated `Calibration`: intrinsics, extrinsics (world to camera, m),
distortion, image sizes and the up axis. Some formats can be written too.
"""

from ._calibration import Calibration as Calibration
from ._calibration import Contents as Contents
from ._calibration import choose_views as choose_views
from ._calibration import not_posed as not_posed
from ._calibration import validated as validated
from ._easymocap import write_easymocap_calibration as write_easymocap_calibration
from ._read import beside as beside
from ._read import contents_of as contents_of
from ._read import read_calibration as read_calibration
from ._sequence import up_axis as up_axis
from ._sequence import write_calibration as write_calibration
from ._toml import write_pose2sim_calibration as write_pose2sim_calibration
