"""Calibration of a subject's body (flesh, bone lengths) from silhouettes. Not in the paper, whose template is given.

In: a prior, start poses and outlines of some frames. Out: a `Shape`, its covariance, and the poses.
"""

from ._bundle_adjustment import bundle_adjust as bundle_adjust
from ._bundle_adjustment import bundle_ahead as bundle_ahead
from ._clothing import dressed as dressed
from ._luggage import Luggage as Luggage
from ._luggage import carrying as carrying
from ._luggage import find_luggage as find_luggage
from ._luggage import prior_with_luggage as prior_with_luggage
from ._luggage import usual_backpack as usual_backpack
from ._worn import worn_around_joints as worn_around_joints
