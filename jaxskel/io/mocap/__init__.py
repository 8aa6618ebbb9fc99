"""Motion capture data of other sources.

In: ASF/AMC or BVH files. Out: a `Motion` of joint positions over time (m), used for synthetic recordings.
"""

from ._asf_amc import parse_asf_amc as parse_asf_amc
from ._asf_amc import read_asf_amc as read_asf_amc
from ._bvh import parse_bvh as parse_bvh
from ._bvh import read_bvh as read_bvh
from ._capture import Motion as Motion
from ._capture import turn as turn
