"""The refinement as a problem of its own: for notebooks that swap objectives."""

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
    """All that `refine_frames` needs but an objective, in a world with z up. See [`refinement_problem`][]."""

    frames: Int[np.ndarray, " people"]
    """The frames that show a person, counted from the recording's first; what follows is of these."""
    initial: Pose
    """Where the search ended, or, without one, where the labelled graph led."""
    observed: Observed
    skeleton: Skeleton
    body: Body
    """The subject with flesh, for terms about volume."""
    truth: Float[np.ndarray, "people joints=15 3"] | None
    """True joints (m), where the recording has any; in the world with z up."""


def refinement_problem(
    recording: Recording, settings: Settings | None = None, prepared: Prepared | None = None
) -> RefinementProblem:
    """Do all that comes before the refinement.

    With ``Settings(search=None)`` the graph alone says where to start, which is quick; ``observed`` has outlines and
    silhouettes only with a search. A frame takes 3 MB per
    ten views then: pass some of the frames of a long recording.

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
    # What was observed is filled up to whole batches.
    observed = _joined([take(start.observed, np.arange(len(start.poses.root))) for start in starts])
    skeleton, body = single_precision((prepared.skeleton, prepared.body))
    return RefinementProblem(chosen, initial, observed, skeleton, body, truth)


def _joined(stacks: list[Any]) -> Any:
    """Stacks of frames one after the other, in single precision and on the device."""
    joined = jax.tree.map(lambda *parts: np.concatenate([np.asarray(part) for part in parts]), *stacks)
    return jax.device_put(single_precision(joined))
