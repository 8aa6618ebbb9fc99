"""Poses on disk, for this package and for other tools.

In: `Poses`. Out: npz, CSV, TRC, MOT, C3D and BVH files. Readers exist for npz, TRC and ground truth. A journal
holds poses while they are still being made.
"""

from ._bvh import BVH_NAMES as BVH_NAMES
from ._bvh import Animation as Animation
from ._bvh import write_bvh as write_bvh
from ._c3d import write_c3d as write_c3d
from ._journal import JOURNAL_FILE as JOURNAL_FILE
from ._journal import PosesJournal as PosesJournal
from ._markers import Markers as Markers
from ._markers import turn_up as turn_up
from ._markers import with_up as with_up
from ._mot import write_angles as write_angles
from ._mot import write_mot as write_mot
from ._people_file import ONLY_PERSON as ONLY_PERSON
from ._people_file import read_people_poses as read_people_poses
from ._people_file import read_people_truth as read_people_truth
from ._people_file import tables_of as tables_of
from ._people_file import write_people_archive as write_people_archive
from ._people_file import write_people_poses as write_people_poses
from ._poses_file import PEOPLE_KEY as PEOPLE_KEY
from ._poses_file import read_poses as read_poses
from ._poses_file import read_truth as read_truth
from ._poses_file import write_archive as write_archive
from ._poses_file import write_keypoint_table as write_keypoint_table
from ._poses_file import write_poses as write_poses
from ._poses_file import write_table as write_table
from ._rig import RIG as RIG
from ._rig import Rig as Rig
from ._rig import TPose as TPose
from ._rig import rig_from as rig_from
from ._rig import rig_of as rig_of
from ._rig import t_pose_of as t_pose_of
from ._trc import parse_trc as parse_trc
from ._trc import read_trc as read_trc
from ._trc import write_trc as write_trc
from ._trc import write_trc_deviations as write_trc_deviations
