"""Front or back, where silhouettes may not tell: a batch is refined both ways, and waits for the film to decide."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..body import Skeleton
from ..hull import Seen
from ..poses import Poses
from ..refinement import Refined
from ..search import Decided, Fork, Track, decide
from ._assemble import FramesOf, assemble
from ._start import Start
from ._uncertainties import TrustInSearch

# Batches that wait at most: 256 frames, ten seconds of film. So much is lost if a run is killed.
_LONGEST = 8
# What poses have of each frame that depends on the way the person faces.
_OF_FRAMES = ("joints", "tips", "rotations", "confidence", "side_confidence", "status", "covariance")


class RefinedBatch(NamedTuple):
    """A batch after its refinement.

    Attributes:
        start: None if nobody is seen; its observations are left out, because they are large.
        refined: None if nobody is seen.
        track: Tracking state for the next batch.
        begins: Whether no other batch was followed before.
        skeleton: The subject's skeleton (m).
        stature_deviation: Standard deviation of its stature (m), if it was found.
        other: The start and the poses on the other track in each frame, if there are two.
    """

    frames: FramesOf
    seen: Seen
    start: Start | None
    refined: Refined | None
    track: Track | None
    begins: bool
    skeleton: Skeleton
    stature_deviation: float | None = None
    other: tuple[Start, Refined] | None = None

    @property
    def fork(self) -> Fork | None:
        """The two tracks, if there are two."""
        return None if self.start is None else self.start.fork

    def poses_of(self, start: Start | None, refined: Refined | None) -> Poses:
        """The poses that were refined from a start."""
        return assemble(self.frames, self.skeleton, self.seen, start, refined, self.stature_deviation)


def decided(batches: Iterator[RefinedBatch]) -> Iterator[tuple[Poses, Track | None]]:
    """The poses of consecutive batches, each with its tracking state, as soon as no later frame can change them.

    Batches may be of several stretches of a film; each is decided by itself.
    """
    waiting: list[RefinedBatch] = []
    for batch in batches:
        if batch.begins:
            yield from _assembled(waiting, _film(waiting))
            waiting = []
        waiting.append(batch)
        film = _film(waiting)
        goes_on = batch.track is not None and batch.track.rival is not None
        ready = _ready(waiting, film) if goes_on else len(waiting)
        yield from _assembled(waiting[:ready], film)
        waiting = waiting[ready:]
    yield from _assembled(waiting, _film(waiting))


def _film(waiting: list[RefinedBatch]) -> Decided | None:
    """What all that wait say; None if nowhere are two tracks."""
    forks = [batch.fork for batch in waiting if batch.fork is not None]
    return decide(forks) if forks else None


def _ready(waiting: list[RefinedBatch], film: Decided | None) -> int:
    """Number of the first batches that are decided, or have waited long enough."""
    ends = np.cumsum([0 if batch.fork is None else len(batch.fork.both.cost) for batch in waiting])
    settled = 0 if film is None else film.settled
    return max(int(np.searchsorted(ends, settled, "right")), len(waiting) - _LONGEST)


def _assembled(batches: list[RefinedBatch], film: Decided | None) -> Iterator[tuple[Poses, Track | None]]:
    """The poses of the first batches of those that decided."""
    first = 0
    for batch in batches:
        if batch.fork is None or film is None:
            yield batch.poses_of(batch.start, batch.refined), batch.track
            continue
        frames = slice(first, first + len(batch.fork.both.cost))
        first = frames.stop
        yield _along(batch, batch.fork, film.path[frames], film.through[frames]), batch.track


def _along(
    batch: RefinedBatch,
    fork: Fork,
    path: Int[np.ndarray, " people"],
    through: Float[np.ndarray, "people tracks=2"],
) -> Poses:
    """The poses along a path through the two tracks."""
    assert batch.start is not None
    assert batch.refined is not None
    assert batch.other is not None
    at_first = decide([fork]).path

    def poses(way: Int[np.ndarray, " people"], start: Start, refined: Refined) -> Poses:
        trust = start.uncertainty
        assert isinstance(trust, TrustInSearch)
        trust = trust._replace(cost=fork.hypotheses(way, through).cost)
        return batch.poses_of(start._replace(uncertainty=trust), refined)

    turned = np.zeros(len(batch.seen.status), bool)
    turned[batch.seen.frames] = path != at_first
    return _of_both(poses(at_first, batch.start, batch.refined), poses(1 - at_first, *batch.other), turned)


def _of_both(poses: Poses, others: Poses, chosen: Bool[np.ndarray, " frames"]) -> Poses:
    """Poses in which some frames are chosen from others."""

    def put(name: str) -> np.ndarray:
        own, other = np.array(getattr(poses, name)), np.asarray(getattr(others, name))
        own[chosen] = other[chosen]
        return own

    return replace(poses, **{name: put(name) for name in _OF_FRAMES})
