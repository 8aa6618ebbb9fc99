"""The refinement of a batch: the arguments of `refine_frames` in the shapes for which it is compiled."""

from concurrent.futures import Executor
from typing import Any

import jax
import numpy as np

from .._runtime.batching import length_of, padded, single_precision
from ..body import Pose, Skeleton
from ..refinement import Refined, refine_frames, refine_frames_ahead
from ..refinement.terms import Objective, Observed
from ._settings import RefinementSettings


def refine(
    initial: Pose, observed: Observed, skeleton: Skeleton, objective: Objective, how: RefinementSettings
) -> Refined:
    """Refine the poses of some frames of a batch; `observed` is on the device."""
    found = refine_frames(*_arguments(initial, observed, skeleton, objective, how))
    return jax.tree.map(lambda a: np.asarray(a)[: len(initial.root)], found)


def refine_ahead(
    threads: Executor,
    initial: Pose,
    observed: Observed,
    skeleton: Skeleton,
    objective: Objective,
    how: RefinementSettings,
) -> None:
    """Begin to compile what `refine` needs for arguments like these."""
    refine_frames_ahead(threads, *_arguments(initial, observed, skeleton, objective, how))


def _arguments(
    initial: Pose, observed: Observed, skeleton: Skeleton, objective: Objective, how: RefinementSettings
) -> tuple[Any, ...]:
    return (
        single_precision(objective), how.parametrisation, how.solver, single_precision(skeleton),
        padded(initial, length_of(observed)), observed, how.rounds, how.max_steps,
    )  # fmt: skip
