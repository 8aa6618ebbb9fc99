"""Files: recordings, calibrations and subjects in, poses out."""

from .calibrations import Calibration as Calibration
from .calibrations import choose_views as choose_views
from .calibrations import read_calibration as read_calibration
from .calibrations import write_calibration as write_calibration
from .calibrations import write_easymocap_calibration as write_easymocap_calibration
from .calibrations import write_pose2sim_calibration as write_pose2sim_calibration
from .poses import read_poses as read_poses
from .poses import read_truth as read_truth
from .poses import write_poses as write_poses
from .recordings import read_recording as read_recording
from .sequence_file import write_recording as write_recording
from .subject import read_body as read_body
from .subject import read_subject as read_subject
from .subject import write_subject as write_subject
