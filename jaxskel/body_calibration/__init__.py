"""Calibration of a subject's body (flesh, bone lengths) from silhouettes. Not in the paper, whose template is given.

In: a prior, start poses and outlines of some frames. Out: a `Shape`, its covariance, and the poses.
"""

from ._bundle_adjustment import bundle_adjust as bundle_adjust
from ._clothing import dressed as dressed
