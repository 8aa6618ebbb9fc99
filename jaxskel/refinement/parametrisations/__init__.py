"""Parametrisations: how a pose is written as unknowns of a least squares problem with bone lengths kept (Sect. 3.3).

In: a pose. Out: unknowns relative to it, and the placed body for given unknowns.
"""

from ._base import JointRotations as JointRotations
from ._base import Parametrisation as Parametrisation
from ._exact_bones import ExactBones as ExactBones
from ._free_joints import AugmentedLagrangian as AugmentedLagrangian
from ._free_joints import FreeJoints as FreeJoints
from ._free_joints import SoftBones as SoftBones
from ._hinged_limbs import HingedLimbs as HingedLimbs
from ._motion import Motion as Motion
from ._symmetric_lengths import SymmetricLengths as SymmetricLengths
