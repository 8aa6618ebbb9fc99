"""The refinement of a batch: the arguments of `refine_frames` in the shapes for which it is compiled.

Or those of `refine_sequence`, for frames that are coupled.
"""

from concurrent.futures import Executor
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool

from .._runtime.batching import length_of, padded, single_precision
from ..body import Pose, Skeleton
from ..refinement import Refined, refine_frames, refine_frames_ahead, refine_sequence
from ..refinement.solvers import for_sequences
from ..refinement.terms import Objective, Observed
from ._settings import RefinementSettings


def refine(
    initial: Pose, observed: Observed, skeleton: Skeleton, objective: Objective, how: RefinementSettings
) -> Refined:
    """Refine the poses of some frames of a batch; `observed` is on the device."""
    found = refine_frames(*_arguments(initial, observed, skeleton, objective, how))
    return jax.tree.map(lambda a: np.asarray(a)[: len(initial.root)], found)


def refine_together(
    initial: Pose,
    observed: Observed,
    follows: Bool[np.ndarray, " frames"],
    skeleton: Skeleton,
    objective: Objective,
    how: RefinementSettings,
) -> Refined:
    """Refine the poses of frames that are coupled where they follow one another, see `refine_sequence`."""
    found = refine_sequence(
        single_precision(objective), how.parametrisation, for_sequences(how.solver), single_precision(skeleton),
        single_precision(initial), single_precision(observed), how.rounds, how.max_steps, follows,
    )  # fmt: skip
    return jax.tree.map(np.asarray, found)


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
