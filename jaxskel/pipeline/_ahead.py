"""Programs that the calibration of a body and the first batch need, compiled side by side while the search begins."""

from concurrent.futures import ThreadPoolExecutor

from .._runtime.batching import filled
from .._runtime.cores import usable_cores
from ..body import Skeleton, make_body
from ..body_calibration import bundle_ahead
from ..refinement.terms import Observed
from ..search import any_poses, fits_ahead, limbs_ahead, make_model
from ._refine import refine_ahead
from ._settings import Settings
from ._subject import THINNED


def compile_ahead(skeleton: Skeleton, observed: Observed, settings: Settings) -> None:
    """Begin to compile what a subject with this template needs, in threads; with one core, do nothing.

    Compilation uses one core for each program, and leaves Python free. The longest, the refinement, comes second,
    so that two threads end at about the same time.

    Args:
        skeleton: Template (m).
        observed: What the first frames show; only the shapes matter.
        settings: How to reconstruct.
    """
    if settings.search is None or usable_cores() == 1:
        return
    stack, body = filled(observed), make_body(skeleton)
    model, poses = make_model(body, settings.search.objective), any_poses(len(stack.inner))
    threads = ThreadPoolExecutor(usable_cores())
    fits_ahead(threads, model, stack)
    objective = settings.refinement.objective_for(body)
    if not objective.couplings:  # those are compiled for a sequence
        refine_ahead(threads, poses, stack, skeleton, objective, settings.refinement)
    limbs_ahead(threads, model, settings.search, stack)
    bundle_ahead(threads, skeleton, poses, stack.thinned(THINNED))
    threads.shutdown(wait=False)
