"""The whole method in its order: prepare, observe, start, refine (Fig. 2).

In: a `Recording` and `Settings`. Out: `Poses`. `observe_batch` is the front half (Sect. 3.1, 3.2), `start_of` and
`refine_frames` are the back half (Sect. 3.3).
"""

from ._advice import advice as advice
from ._advice import advice_for_volumes as advice_for_volumes
from ._ahead import compile_ahead as compile_ahead
from ._calibrate_body import FRAMES as FRAMES
from ._calibrate_body import STAGES as STAGES
from ._calibrate_body import CalibratedBody as CalibratedBody
from ._calibrate_body import MeasuredLength as MeasuredLength
from ._calibrate_body import calibrate_body as calibrate_body
from ._coupled_batches import check_apart as check_apart
from ._observe_batch import observe_batch as observe_batch
from ._parallel import reconstruct_parallel as reconstruct_parallel
from ._prepare import prepare as prepare
from ._prepared import Prepared as Prepared
from ._reconstruct import batches_from as batches_from
from ._reconstruct import reconstruct as reconstruct
from ._reconstruct import reconstruct_batch as reconstruct_batch
from ._reconstruct import reconstruct_batches as reconstruct_batches
from ._reconstruct_hulls import check_without_silhouettes as check_without_silhouettes
from ._reconstruct_hulls import reconstruct_hulls as reconstruct_hulls
from ._reconstruct_hulls import reconstruct_volumes as reconstruct_volumes
from ._refinement_problem import RefinementProblem as RefinementProblem
from ._refinement_problem import refinement_problem as refinement_problem
from ._settings import GraphSettings as GraphSettings
from ._settings import HullSettings as HullSettings
from ._settings import MatchingSettings as MatchingSettings
from ._settings import RefinementSettings as RefinementSettings
from ._settings import Settings as Settings
from ._settings import paper_settings as paper_settings
from ._stream import Stream as Stream
from ._warm_up import warm_up as warm_up
