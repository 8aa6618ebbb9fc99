"""Programs that a search will need, loaded or compiled side by side before it asks for them."""

from concurrent.futures import Executor

import numpy as np

from ..body import SEGMENT_NAMES, Pose
from ..refinement.terms import Observed
from ._fit import fit_ahead
from ._limb_proposals import BOTH, with_limbs
from ._model import Model
from ._search import ARMS, Search, limbs_at_once


def fits_ahead(threads: Executor, model: Model, stack: Observed) -> None:
    """Begin to compile the fits of `solve_frames`: the same for a body with arms and without."""
    fit_ahead(threads, model.body, model.objective, any_poses, stack)


def limbs_ahead(threads: Executor, model: Model, search: Search, stack: Observed) -> None:
    """Begin to compile the proposals of limbs of `solve_frames`: one program, unless pairs and singles differ."""
    size = limbs_at_once(stack)
    poses, frames = any_poses(size), np.zeros(size, np.int32)
    for count in dict.fromkeys((search.pairs, search.singles)):
        with_limbs.ahead(threads, model, poses, frames, stack, ARMS, BOTH, count)


def any_poses(count: int) -> Pose:
    """Poses of which only the shapes matter."""
    return Pose(np.zeros((count, 3), np.float32), np.zeros((count, len(SEGMENT_NAMES), 3, 3), np.float32))
