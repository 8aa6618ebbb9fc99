"""3D human skeletons from calibrated multi-view silhouettes.

The names most people need; each room (`jaxskel.hull`, `jaxskel.graph`, ...) has the rest. In the order of the data:

    recording -> outlines, hull -> graph -> matching -> search -> refinement -> poses

`pipeline` runs them in this order.
"""

from . import body_calibration as body_calibration
from . import camera_calibration as camera_calibration
from . import cameras as cameras
from . import graph as graph
from . import hull as hull
from . import io as io
from . import live as live
from . import matching as matching
from . import outlines as outlines
from . import people as people
from . import pipeline as pipeline
from . import recording as recording
from . import refinement as refinement
from . import search as search
from . import segmentation as segmentation
from . import synthetic as synthetic
from . import verdict as verdict
from . import volumes as volumes
from ._runtime.kept_programs import keep_compiled as keep_compiled
from .body import JOINT_NAMES as JOINT_NAMES
from .body import JOINT_PARENTS as JOINT_PARENTS
from .body import TIP_NAMES as TIP_NAMES
from .body import Body as Body
from .body import Pose as Pose
from .body import Skeleton as Skeleton
from .body import default_adult as default_adult
from .body import make_body as make_body
from .body import make_skeleton as make_skeleton
from .camera_calibration.from_silhouettes import refine_cameras as refine_cameras
from .cameras import Cameras as Cameras
from .cameras import make_cameras as make_cameras
from .io import read_recording as read_recording
from .pipeline import GraphSettings as GraphSettings
from .pipeline import HullSettings as HullSettings
from .pipeline import MatchingSettings as MatchingSettings
from .pipeline import Prepared as Prepared
from .pipeline import RefinementProblem as RefinementProblem
from .pipeline import RefinementSettings as RefinementSettings
from .pipeline import Settings as Settings
from .pipeline import Stream as Stream
from .pipeline import calibrate_body as calibrate_body
from .pipeline import observe_batch as observe_batch
from .pipeline import paper_settings as paper_settings
from .pipeline import prepare as prepare
from .pipeline import reconstruct as reconstruct
from .pipeline import reconstruct_batches as reconstruct_batches
from .pipeline import reconstruct_hulls as reconstruct_hulls
from .pipeline import reconstruct_parallel as reconstruct_parallel
from .pipeline import refinement_problem as refinement_problem
from .pipeline import warm_up as warm_up
from .poses import Poses as Poses
from .poses import Status as Status
from .poses import join_poses as join_poses
from .poses import metrics as metrics
from .poses import smooth as smooth
from .recording import Recording as Recording
from .recording import Truth as Truth
from .recording import pack_silhouettes as pack_silhouettes
from .recording import unpack_silhouettes as unpack_silhouettes
from .refinement import learn_weights as learn_weights
from .refinement import parametrisations as parametrisations
from .refinement import refine_frames as refine_frames
from .refinement import refine_sequence as refine_sequence
from .refinement import terms as terms
from .search import Search as Search
from .search import Tracking as Tracking
from .volumes import virtual_recording as virtual_recording
