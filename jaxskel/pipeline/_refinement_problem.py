"""The refinement as a separate problem, for notebooks that compare objectives."""

from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, Int

from .._runtime.batching import single_precision, take
from ..body import Body, Pose, Skeleton
from ..cameras import Cameras
from ..hull import Seen
from ..poses import Poses, join_poses
from ..recording import Recording
from ..refinement import Refined
from ..refinement.terms import Observed
from ..search import Hypotheses
from ._assemble import FramesOf, assemble, frames_of
from ._prepare import prepare
from ._prepared import Prepared
from ._reconstruct import BATCH
from ._settings import Settings
from ._start import Start, start_of


class RefinementProblem(eqx.Module):
    """Inputs of `refine_frames` except the objective, in a world with z up. See [`refinement_problem`][].

    Attributes:
        frames: Indices of the frames that show a person, from 0; the fields below are for these frames.
        initial: Result of the search, or, without a search, the pose from the labelled graph.
        body: The subject with flesh, for terms about volume.
        truth: True joints (m) in the world with z up, if the recording has them.
        cameras: The recording's cameras in the world with z up.
        to_z_up: Rotation from the recording's world to the one with z up.
        hypotheses: All that the search found for each frame, the cheapest first; None without a search. See
            [`costs_by_term`][jaxskel.search.costs_by_term].
    """

    frames: Int[np.ndarray, " people"]
    initial: Pose
    observed: Observed
    skeleton: Skeleton
    body: Body
    truth: Float[np.ndarray, "people joints 3"] | None
    cameras: Cameras
    to_z_up: Float[np.ndarray, "3 3"]
    hypotheses: Hypotheses | None
    _batches: "_Batches" = eqx.field(static=True)

    def to_poses(self, refined: Refined) -> Poses:
        """The poses of the whole recording, as `reconstruct` returns them: to be written, exported and evaluated.

        Statuses and confidences are those that the pipeline gives. A covariance is in m^2 only if a residual of the
        objective is one where it is off by one standard deviation, as in the default objective.

        Args:
            refined: Result of `refine_frames` or `refine_sequence` for all of `frames`.

        Raises:
            ValueError: It has another number of frames.
        """
        return self._batches.assembled(jax.tree.map(np.asarray, refined), len(self.frames))


@dataclass(frozen=True, eq=False)
class _Batches:
    """What is left to do for poses, batch by batch."""

    frames: tuple[FramesOf, ...]
    skeleton: Skeleton
    stature_deviation: float | None
    seen: tuple[Seen, ...]
    starts: tuple[Start | None, ...]

    def assembled(self, refined: Refined, frames: int) -> Poses:
        """The poses of all batches."""
        if len(refined.converged) != frames:
            raise ValueError(f"refined: has {len(refined.converged)} frames, but the problem has {frames}; refine all")
        parts, first = [], 0
        for numbered, seen, start in zip(self.frames, self.seen, self.starts, strict=True):
            own = None
            if start is not None:
                own = take(refined, np.arange(first, first + len(seen.frames)))
                first += len(seen.frames)
            parts.append(assemble(numbered, self.skeleton, seen, start, own, self.stature_deviation))
        return join_poses(parts)


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
    numbered, people, found = [], [], []
    for first in range(0, len(recording), BATCH):
        part = recording[first : first + BATCH]
        seen, start, _ = start_of(part, prepared, settings, objective)
        numbered.append(frames_of(part, prepared, settings))
        people.append(replace(seen, hulls=None))
        found.append(start)
    starts = [start for start in found if start is not None]
    if not starts:
        raise ValueError(f"{recording.name}: no frame shows one whole person; see `jaxskel check`")
    firsts = BATCH * np.arange(len(people))
    chosen = np.concatenate([
        first + seen.frames for first, seen, start in zip(firsts, people, found, strict=True) if start is not None
    ])  # fmt: skip
    truth = None if recording.truth is None else recording.truth.joints[chosen] @ prepared.to_z_up.T
    initial = _joined([start.poses for start in starts])
    # The observations are padded to whole batches.
    observed = _joined([take(start.observed, np.arange(len(start.poses.root))) for start in starts])
    skeleton, body = single_precision((prepared.skeleton, prepared.body))
    searched = [start.hypotheses for start in starts if start.hypotheses is not None]
    # The observations are large, and kept once.
    kept = tuple(None if start is None else start._replace(observed=None) for start in found)
    batches = _Batches(tuple(numbered), prepared.skeleton, prepared.stature_deviation, tuple(people), kept)
    return RefinementProblem(
        chosen, initial, observed, skeleton, body, truth, prepared.cameras, prepared.to_z_up,
        jax.tree.map(lambda *parts: np.concatenate(parts), *searched) if searched else None, batches,
    )  # fmt: skip


def _joined(stacks: list[Any]) -> Any:
    """Concatenate stacks of frames, in single precision and on the device."""
    joined = jax.tree.map(lambda *parts: np.concatenate([np.asarray(part) for part in parts]), *stacks)
    return jax.device_put(single_precision(joined))
