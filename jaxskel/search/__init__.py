"""Generate, fit and compare pose hypotheses. Not in the paper, whose start pose is `initial_poses` (Sect. 3.3).

In: `Limbs` and the observed outlines. Out: `Hypotheses` with their costs, the cheapest first, for each frame by itself
or tracked from frame to frame.
"""

from ._ahead import any_poses as any_poses
from ._ahead import fits_ahead as fits_ahead
from ._ahead import limbs_ahead as limbs_ahead
from ._alternatives import no_alternatives as no_alternatives
from ._costs import costs_by_term as costs_by_term
from ._facing import turned_rivals as turned_rivals
from ._fit import fit_pool as fit_pool
from ._fit import fit_scales as fit_scales
from ._follow_frame import begun as begun
from ._follow_frame import doubt_arises as doubt_arises
from ._follow_frame import follow_frame as follow_frame
from ._follow_frame import search_in_doubt as search_in_doubt
from ._follow_frame import search_is_due as search_is_due
from ._fork import Decided as Decided
from ._fork import Fork as Fork
from ._fork import decide as decide
from ._gaps import before_next as before_next
from ._gaps import over_gap as over_gap
from ._gauss_newton import DAMPING as DAMPING
from ._gauss_newton import RELATIVE_DAMPING as RELATIVE_DAMPING
from ._hypotheses import Hypotheses as Hypotheses
from ._hypotheses import pool_of as pool_of
from ._initial_poses import initial_poses as initial_poses
from ._model import Model as Model
from ._model import fit_of as fit_of
from ._model import make_model as make_model
from ._search import Search as Search
from ._search import cost_threshold as cost_threshold
from ._search import solve_frames as solve_frames
from ._search import solving as solving
from ._start_poses import graphless_poses as graphless_poses
from ._start_poses import start_poses as start_poses
from ._target_poses import target_poses as target_poses
from ._track import Proposed as Proposed
from ._track import track_frames as track_frames
from ._track_state import Rival as Rival
from ._track_state import Searched as Searched
from ._track_state import Track as Track
from ._track_state import Tracking as Tracking
from ._track_state import hurried as hurried
from ._track_state import lost as lost
from ._track_state import must_be_found as must_be_found
from ._uncertainty import SAME_PLACE as SAME_PLACE
from ._uncertainty import Uncertainty as Uncertainty
from ._uncertainty import prior_in_clothes as prior_in_clothes
from ._uncertainty import searched_uncertainty as searched_uncertainty
from ._unexplained import NOT_THE_SUBJECT as NOT_THE_SUBJECT
from ._unexplained import trust_in_explained as trust_in_explained
from ._unexplained import unexplained_shares as unexplained_shares
