"""Calibration of a subject's body (flesh, bone lengths) from silhouettes. Not in the paper, whose template is given.

In: start poses and outlines of some frames. Out: a `Body`, and the typical costs of its poses.
"""

from ._bundle_adjustment import bundle_adjust as bundle_adjust
from ._flesh import CalibratedFlesh as CalibratedFlesh
from ._flesh import Costs as Costs
from ._flesh import calibrate_flesh as calibrate_flesh
