"""The refinement as a separate problem, for notebooks that compare objectives."""

from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, Int

from .._runtime.batching import single_precision, take
from ..body import Body, Pose, Skeleton
from ..recording import Recording
from ..refinement.terms import Observed
from ._prepare import prepare
from ._prepared import Prepared
from ._reconstruct import BATCH
from ._settings import Settings
from ._start import start_of


class RefinementProblem(eqx.Module):
    """Inputs of `refine_frames` except the objective, in a world with z up. See [`refinement_problem`][]."""

    frames: Int[np.ndarray, " people"]
    """Indices of the frames that show a person, from 0; the fields below are for these frames."""
    initial: Pose
    """Result of the search, or, without a search, the pose from the labelled graph."""
    observed: Observed
    skeleton: Skeleton
    body: Body
    """The subject with flesh, for terms about volume."""
    truth: Float[np.ndarray, "people joints=15 3"] | None
    """True joints (m) in the world with z up, if the recording has them."""


def refinement_problem(
    recording: Recording, settings: Settings | None = None, prepared: Prepared | None = None
) -> RefinementProblem:
    """Run all stages before the refinement.

    With ``Settings(search=None)`` the graph alone gives the start pose, which is quick. ``observed`` has outlines and
    silhouettes only with a search; a frame then takes 3 MB per ten views, so pass only some frames of a long recording.

    Raises:
        ValueError: No frame shows a person.
    """
    settings = settings or Settings()
    prepared = prepared or prepare(recording, settings)
    objective = settings.refinement.objective_for(prepared.body)
    frames, starts = [], []
    for first in range(0, len(recording), BATCH):
        found, start, _ = start_of(
            recording.silhouettes[first : first + BATCH], recording.fps, prepared, settings, objective
        )
        if start is not None:
            frames.append(first + found.frames)
            starts.append(start)
    if not starts:
        raise ValueError(f"{recording.name}: no frame shows one whole person; see `jaxskel check`")
    chosen = np.concatenate(frames)
    truth = None if recording.truth is None else recording.truth.joints[chosen] @ prepared.to_z_up.T
    initial = _joined([start.poses for start in starts])
    # The observations are padded to whole batches.
    observed = _joined([take(start.observed, np.arange(len(start.poses.root))) for start in starts])
    skeleton, body = single_precision((prepared.skeleton, prepared.body))
    return RefinementProblem(chosen, initial, observed, skeleton, body, truth)


def _joined(stacks: list[Any]) -> Any:
    """Concatenate stacks of frames, in single precision and on the device."""
    joined = jax.tree.map(lambda *parts: np.concatenate([np.asarray(part) for part in parts]), *stacks)
    return jax.device_put(single_precision(joined))
