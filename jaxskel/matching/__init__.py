"""Labels of end nodes: which end node is which limb (Sect. 3.2, 3.3, Eq. 1 to 6).

In: a `SkeletalGraph` per frame and the template. Out: `Limbs`: labelled end nodes, neck and pelvis, left and right;
and the stature estimated from the graphs.
"""

from ._arrangement import rotations_onto as rotations_onto
from ._confidence import joint_confidence as joint_confidence
from ._descriptors import EndNodes as EndNodes
from ._descriptors import describe_ends as describe_ends
from ._descriptors import template_ends as template_ends
from ._descriptors import template_geodesics as template_geodesics
from ._dtw import dtw as dtw
from ._joint_targets import joint_targets as joint_targets
from ._label import labelled_limbs as labelled_limbs
from ._limbs import END_NODE_REACH as END_NODE_REACH
from ._limbs import HANDLESS_DESCRIPTOR as HANDLESS_DESCRIPTOR
from ._limbs import HEAD as HEAD
from ._limbs import L_FOOT as L_FOOT
from ._limbs import L_HAND as L_HAND
from ._limbs import PAPER_DESCRIPTOR as PAPER_DESCRIPTOR
from ._limbs import PATH_POINTS as PATH_POINTS
from ._limbs import R_FOOT as R_FOOT
from ._limbs import R_HAND as R_HAND
from ._limbs import Limbs as Limbs
from ._limbs import label_limbs as label_limbs
from ._matchers import DtwMatcher as DtwMatcher
from ._matchers import ExactMatcher as ExactMatcher
from ._matchers import Matcher as Matcher
from ._matchers import Matches as Matches
from ._matchers import cost_matrices as cost_matrices
from ._matchers import soft_cost_matrices as soft_cost_matrices
from ._sides import tell_sides as tell_sides
from ._soft_dtw import soft_dtw as soft_dtw
from ._stature import estimate_size as estimate_size
from ._stature import estimate_stature as estimate_stature
from ._stature import size_of_limbs as size_of_limbs
