"""File formats, one subpackage each kind of data.

In: recordings (calibration, images, masks), subjects, keypoints, motion capture. Out: validated types, and files with
poses in the formats of other tools.
"""

from . import calibrations as calibrations
from . import files as files
from . import keypoints as keypoints
from . import mocap as mocap
from . import poses as poses
from . import proposals as proposals
from . import recordings as recordings
from . import subjects as subjects
from . import templates as templates
from . import views as views
from .calibrations import Calibration as Calibration
from .calibrations import choose_views as choose_views
from .calibrations import read_calibration as read_calibration
from .calibrations import write_calibration as write_calibration
from .calibrations import write_easymocap_calibration as write_easymocap_calibration
from .calibrations import write_pose2sim_calibration as write_pose2sim_calibration
from .keypoints import read_keypoints as read_keypoints
from .keypoints import undistort_keypoints as undistort_keypoints
from .mocap import Motion as Motion
from .mocap import parse_asf_amc as parse_asf_amc
from .mocap import parse_bvh as parse_bvh
from .mocap import read_asf_amc as read_asf_amc
from .mocap import read_bvh as read_bvh
from .poses import BVH_NAMES as BVH_NAMES
from .poses import Animation as Animation
from .poses import Markers as Markers
from .poses import parse_trc as parse_trc
from .poses import read_people_poses as read_people_poses
from .poses import read_poses as read_poses
from .poses import read_trc as read_trc
from .poses import read_truth as read_truth
from .poses import write_angles as write_angles
from .poses import write_bvh as write_bvh
from .poses import write_c3d as write_c3d
from .poses import write_keypoint_table as write_keypoint_table
from .poses import write_mot as write_mot
from .poses import write_people_poses as write_people_poses
from .poses import write_poses as write_poses
from .poses import write_table as write_table
from .poses import write_trc as write_trc
from .poses import write_trc_deviations as write_trc_deviations
from .recordings import read_data as read_data
from .recordings import read_people as read_people
from .recordings import read_recording as read_recording
from .recordings import read_volumes as read_volumes
from .recordings import write_people as write_people
from .recordings import write_recording as write_recording
from .subjects import read_body as read_body
from .subjects import read_subject as read_subject
from .subjects import write_subject as write_subject
from .templates import read_template as read_template
