"""Programs that the calibration of a body and the first batch need, compiled side by side while other work goes on."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Array, Float

from .._runtime.batching import STACK, filled, single_precision, take
from .._runtime.cores import usable_cores
from ..body import make_body
from ..body_calibration import bundle_ahead, luggage_ahead
from ..cameras import Cameras
from ..matching import Limbs
from ..outlines import RAYS, contours, silhouette_distances
from ..refinement.terms import Observed
from ..search import any_poses, fits_ahead, limbs_ahead, make_model, unexplained_shares
from ._refine import refine_ahead
from ._settings import Settings
from ._settle_subject import THINNED
from ._subject_frames import NO_PRIOR


def compile_ahead(
    cameras: Cameras,
    settings: Settings,
    data: Mapping[str, Float[Array | np.ndarray, "frames ..."]] | None = None,
    at_once: int = STACK,
) -> None:
    """Begin to compile what a subject with these settings needs, in threads; with one core, do nothing.

    Compilation uses one core for each program, and leaves Python free. Programs come in the order in which they are
    needed; the refinement, which takes longest, is compiled while the body is found.

    Args:
        cameras: The rig; only the number and the kinds of cameras and the sizes of images matter.
        settings: How to reconstruct.
        data: The recording's own data; only the shapes matter.
        at_once: Frames that are worked on at once.
    """
    if settings.search is None or usable_cores() == 1:
        return
    skeleton, known = settings.average, settings.body is not None
    stack, body = filled(_nobody(cameras, data or {}), at_once), settings.body or make_body(skeleton)
    # Weights make no other program; without a prior, nothing is computed for its tables.
    model, poses = make_model(body, settings.search.objective, NO_PRIOR), any_poses(len(stack.inner))
    threads = ThreadPoolExecutor(usable_cores())
    fits_ahead(threads, model, stack)
    limbs_ahead(threads, model, settings.search, stack)
    if not known:
        bundle_ahead(threads, skeleton, poses, stack.thinned(THINNED))
    objective = settings.refinement.objective_for(body)
    if not objective.couplings:  # those are compiled for a sequence
        refine_ahead(threads, poses, stack, skeleton, objective, settings.refinement)
    if not known and at_once > 1:  # in a single frame of a stream, nobody looks for luggage
        luggage_ahead(threads, body, take(poses, np.arange(1)), stack)
    unexplained_shares.ahead(threads, single_precision(body), poses, stack.contours)
    threads.shutdown(wait=False)


def _nobody(cameras: Cameras, data: Mapping[str, Float[Array | np.ndarray, "frames ..."]]) -> Observed:
    """What one frame shows in which nobody is seen."""
    width, height = cameras.size.max(0)
    silhouettes = np.zeros((1, len(cameras), height, -(-width // 8)), np.uint8)
    views = silhouettes, cameras, np.ones((1, len(cameras)), bool)
    limbs = Limbs.none(1)
    return Observed(
        limbs.paths, limbs.found, limbs.inner, contours(*views, RAYS), silhouette_distances(*views, 0),
        {name: array[:1] for name, array in data.items()},
    )  # fmt: skip
