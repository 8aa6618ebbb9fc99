"""Terms of the refinement objective (Sect. 3.3), one file each; a term needs only a few lines, for one frame.

A term is an `AbstractTerm`: a Module with a weight and a `residual`. It looks up correspondences, such as closest
points, in `correspond`, once before each inner solve, so that the solver sees a smooth function.
"""

from ._arm_collision import ArmCollision as ArmCollision
from ._arm_prior import ArmPrior as ArmPrior
from ._arm_prior import arm_directions as arm_directions
from ._arm_prior import arm_prior as arm_prior
from ._arm_prior import usual_arms as usual_arms
from ._base import AbstractCoupling as AbstractCoupling
from ._base import AbstractTerm as AbstractTerm
from ._base import Objective as Objective
from ._base import Observed as Observed
from ._base import PlacedBody as PlacedBody
from ._base import number as number
from ._base import place as place
from ._contour_contact import ContourContact as ContourContact
from ._end_nodes import EndNodeAttraction as EndNodeAttraction
from ._function_term import FunctionCoupling as FunctionCoupling
from ._function_term import FunctionTerm as FunctionTerm
from ._function_term import coupling_from_function as coupling_from_function
from ._function_term import from_function as from_function
from ._given import GivenObjective as GivenObjective
from ._given import check_given as check_given
from ._given import check_objective as check_objective
from ._given import objective_of as objective_of
from ._graph_attraction import GraphAttraction as GraphAttraction
from ._hinges import HingeLimits as HingeLimits
from ._hip_limits import HipLimits as HipLimits
from ._inner_nodes import InnerNodeAttraction as InnerNodeAttraction
from ._inside_silhouettes import InsideSilhouettes as InsideSilhouettes
from ._keypoints import Keypoints as Keypoints
from ._keypoints import keypoints_term as keypoints_term
from ._losses import AbstractLoss as AbstractLoss
from ._losses import Cauchy as Cauchy
from ._losses import GemanMcClure as GemanMcClure
from ._losses import Huber as Huber
from ._losses import robust_rows as robust_rows
from ._objectives import INSIDE_OVER_OUTLINES as INSIDE_OVER_OUTLINES
from ._objectives import paper_objective as paper_objective
from ._objectives import search_objective as search_objective
from ._objectives import volume_objective as volume_objective
from ._pose_prior import PosePrior as PosePrior
from ._pose_prior import pose_prior as pose_prior
from ._quadrics import CapsuleTerm as CapsuleTerm
from ._rest_prior import RestPrior as RestPrior
from ._rest_prior import firmness as firmness
from ._robust import Robust as Robust
from ._shoulder_limits import ShoulderLimits as ShoulderLimits
from ._smoothness import Smoothness as Smoothness
from ._symmetry import Symmetry as Symmetry
