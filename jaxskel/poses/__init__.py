"""The result: poses of all frames with a status and a confidence; filters, joint angles and scores.

In: joints (m). Out: `Poses`, smoothed poses, joint angles, and errors against a ground truth (`metrics`).
"""

from . import metrics as metrics
from ._joint_angles import ANGLE_NAMES as ANGLE_NAMES
from ._joint_angles import JointAngles as JointAngles
from ._joint_angles import joint_angles as joint_angles
from ._marker_scores import score_markers as score_markers
from ._people_scores import PeopleScore as PeopleScore
from ._people_scores import score_people as score_people
from ._poses import STATUS_NAMES as STATUS_NAMES
from ._poses import WITH_POSE as WITH_POSE
from ._poses import Poses as Poses
from ._poses import Status as Status
from ._poses import join_poses as join_poses
from ._smooth import smooth as smooth
from .metrics import CURVE_THRESHOLDS_MM as CURVE_THRESHOLDS_MM
from .metrics import LIMBS as LIMBS
from .metrics import Score as Score
from .metrics import join_scores as join_scores
from .metrics import score as score
from .metrics import score_poses as score_poses
from .metrics import score_table as score_table
