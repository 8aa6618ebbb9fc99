"""Files: recordings, calibrations and subjects in, poses out."""

from .bvh import BVH_NAMES as BVH_NAMES
from .bvh import Animation as Animation
from .bvh import write_bvh as write_bvh
from .c3d import write_c3d as write_c3d
from .calibrations import Calibration as Calibration
from .calibrations import choose_views as choose_views
from .calibrations import read_calibration as read_calibration
from .calibrations import write_calibration as write_calibration
from .calibrations import write_easymocap_calibration as write_easymocap_calibration
from .calibrations import write_pose2sim_calibration as write_pose2sim_calibration
from .markers import Markers as Markers
from .poses import read_poses as read_poses
from .poses import read_truth as read_truth
from .poses import write_poses as write_poses
from .poses import write_table as write_table
from .recordings import read_recording as read_recording
from .sequence_file import write_recording as write_recording
from .subject import read_body as read_body
from .subject import read_subject as read_subject
from .subject import write_subject as write_subject
from .trc import parse_trc as parse_trc
from .trc import read_trc as read_trc
from .trc import write_trc as write_trc
