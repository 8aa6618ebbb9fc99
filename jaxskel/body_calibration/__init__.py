"""Calibration of a subject's body (flesh, bone lengths) from silhouettes. Not in the paper, whose template is given.

In: a prior, start poses and outlines of some frames. Out: a `Shape`, its covariance, and the poses.
"""

from ._additions import Addition as Addition
from ._additions import prior_with_addition as prior_with_addition
from ._additions import usual_backpack as usual_backpack
from ._additions import usual_hair as usual_hair
from ._additions import with_addition as with_addition
from ._bundle_adjustment import FIRST_SCALE as FIRST_SCALE
from ._bundle_adjustment import bundle_adjust as bundle_adjust
from ._bundle_adjustment import bundle_ahead as bundle_ahead
from ._clothing import dressed as dressed
from ._luggage import find_luggage as find_luggage
from ._luggage import luggage_ahead as luggage_ahead
from ._worn import worn_around_joints as worn_around_joints
