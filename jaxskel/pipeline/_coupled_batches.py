"""Poses of a film whose frames are coupled: each batch is refined together with the frames around it."""

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np

from .._runtime.batching import take
from ..body import Skeleton
from ..hull import Seen, Stopwatch
from ..poses import Poses
from ..refinement import Refined
from ..refinement.terms import Objective
from ._assemble import FramesOf, assemble
from ._refine import refine_together
from ._settings import RefinementSettings, Settings
from ._start import Start

# Frames before and after a batch that are refined together with it: what couplings carry over more than half a second
# is less than a solver's tolerance. With a batch of 32 these are 64 frames, a length that programs are compiled for.
_MARGIN = 16


class Started(NamedTuple):
    """A batch before its refinement.

    Attributes:
        start: None if nobody is seen.
    """

    frames: FramesOf
    seen: Seen
    start: Start | None


def check_apart(settings: Settings, apart: str) -> None:
    """Refuse an objective that couples frames, where they are reconstructed apart.

    Args:
        settings: How to reconstruct.
        apart: Why they are apart and what to do instead, for the message.

    Raises:
        ValueError: One line that names the terms.
    """
    names = list(settings.usual_objective().couplings)
    if names:
        raise ValueError(f"settings: {', '.join(names)} couples frames, {apart}")


def coupled_batches(
    batches: Iterator[Started],
    skeleton: Skeleton,
    objective: Objective,
    how: RefinementSettings,
    stature_deviation: float | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Iterator[Poses]:
    """The poses of consecutive batches, one batch later than they are started.

    Frames that follow one another, and that show the person, are coupled across the ends of the batches. A frame in
    which nobody, or somebody else, is seen ends what is coupled.

    Args:
        batches: All batches of a film, in order.
        skeleton: Template (m).
        objective: Weighted terms, some of which are couplings.
        how: The other settings of the refinement.
        stature_deviation: Standard deviation of the skeleton's stature (m), if it was found.
        stopwatch: Times the stage ``refine``.
    """
    before, batch = None, _next(batches)
    while batch is not None:
        after, refined = _next(batches), None
        if batch.start is not None:
            with stopwatch("refine"):
                refined = _refined(before, batch, after, skeleton, objective, how)
        yield assemble(batch.frames, skeleton, batch.seen, batch.start, refined, stature_deviation)
        before, batch = batch, after


def _next(batches: Iterator[Started]) -> Started | None:
    """The next batch, without its hulls, which are large."""
    found = next(batches, None)
    return None if found is None else found._replace(seen=replace(found.seen, hulls=None))


def _refined(
    before: Started | None,
    batch: Started,
    after: Started | None,
    skeleton: Skeleton,
    objective: Objective,
    how: RefinementSettings,
) -> Refined:
    """Refine the people of a batch together with those in some frames around it."""
    count, pieces = len(batch.seen.status), []
    for part, first in ((before, -len(before.seen.status) if before else 0), (batch, 0), (after, count)):
        if part is None or part.start is None:
            continue
        places = first + part.seen.frames
        chosen = np.flatnonzero((places >= -_MARGIN) & (places < count + _MARGIN))
        start = part.start
        pieces.append((places[chosen], *take((start.plausible, start.poses, start.observed), chosen)))
    places, plausible, initial, observed = jax.tree.map(lambda *parts: np.concatenate(parts), *pieces)
    follows = np.zeros(len(places), bool)
    follows[1:] = (np.diff(places) == 1) & plausible[1:] & plausible[:-1]
    found = refine_together(initial, observed, follows, skeleton, objective, how)
    return take(found, (places >= 0) & (places < count))
