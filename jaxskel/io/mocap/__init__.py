"""Motion capture of other people: ASF/AMC and BVH in, a `Motion` out."""

from ._asf_amc import parse_asf_amc as parse_asf_amc
from ._asf_amc import read_asf_amc as read_asf_amc
from ._bvh import parse_bvh as parse_bvh
from ._bvh import read_bvh as read_bvh
from ._capture import Motion as Motion
from ._capture import turn as turn
