"""The template (the paper's G', Fig. 2a, Sect. 3.2, 3.3): joints, bones, and a body of capsules around them.

In: joint positions at rest, or a stature. Out: a `Skeleton`, a `Body`, a `Pose` and its joint positions.
"""

from ._capsule_body import BALL_NAMES as BALL_NAMES
from ._capsule_body import BALL_SIDES as BALL_SIDES
from ._capsule_body import FREE_BALLS as FREE_BALLS
from ._capsule_body import HEM as HEM
from ._capsule_body import LIKE_BALL as LIKE_BALL
from ._capsule_body import LINKS as LINKS
from ._capsule_body import Body as Body
from ._capsule_body import ball_centres as ball_centres
from ._capsule_body import capsule_ends as capsule_ends
from ._capsule_body import limb_capsules as limb_capsules
from ._capsule_body import make_body as make_body
from ._capsule_body import place_body as place_body
from ._capsule_body import place_joints as place_joints
from ._capsules import Grazed as Grazed
from ._capsules import all_distances as all_distances
from ._capsules import nearest_capsule as nearest_capsule
from ._capsules import nearest_to_rays as nearest_to_rays
from ._capsules import toward_capsule as toward_capsule
from ._population import Population as Population
from ._population import adults as adults
from ._population import children as children
from ._shape import FLESH_FROM as FLESH_FROM
from ._shape import LENGTH_NAMES as LENGTH_NAMES
from ._shape import QUANTITIES as QUANTITIES
from ._shape import Prior as Prior
from ._shape import Shape as Shape
from ._shape import flesh_prior as flesh_prior
from ._shape import lengths_of as lengths_of
from ._shape import measured_body as measured_body
from ._shape import people_prior as people_prior
from ._shape import population_prior as population_prior
from ._shape import shaped_body as shaped_body
from ._skeleton import JOINT_NAMES as JOINT_NAMES
from ._skeleton import JOINT_OF_PIVOT as JOINT_OF_PIVOT
from ._skeleton import JOINT_PARENTS as JOINT_PARENTS
from ._skeleton import MIRROR_JOINTS as MIRROR_JOINTS
from ._skeleton import PIVOT_NAMES as PIVOT_NAMES
from ._skeleton import SEGMENT_NAMES as SEGMENT_NAMES
from ._skeleton import SEGMENT_OF_JOINT as SEGMENT_OF_JOINT
from ._skeleton import SEGMENT_OF_PIVOT as SEGMENT_OF_PIVOT
from ._skeleton import SEGMENT_OF_TIP as SEGMENT_OF_TIP
from ._skeleton import SEGMENT_PARENTS as SEGMENT_PARENTS
from ._skeleton import TIP_NAMES as TIP_NAMES
from ._skeleton import TIP_PARENTS as TIP_PARENTS
from ._skeleton import Pose as Pose
from ._skeleton import Skeleton as Skeleton
from ._skeleton import default_adult as default_adult
from ._skeleton import forward_kinematics as forward_kinematics
from ._skeleton import hinge_axes as hinge_axes
from ._skeleton import make_skeleton as make_skeleton
from ._skeleton import place_segments as place_segments
from ._skeleton import rest_origins as rest_origins
from ._skeleton import stretched as stretched
