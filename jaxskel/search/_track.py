"""Tracking: each frame is fitted from the one before; full searches at intervals correct the track."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from .._runtime.batching import on_device, take
from ..body import Pose
from ..refinement.terms import Observed
from ._alternatives import Alternatives, Known, latest, no_alternatives, told
from ._best_track import best_track, last_place, places_of
from ._cheapest_path import apart
from ._facing import cheapest_each_way
from ._fork import Fork, decide
from ._hypotheses import Hypotheses, Pool, pool_of
from ._model import Model
from ._rival_track import forked, rival_after
from ._search import Search, cost_threshold, solve_frames
from ._track_state import Track, Tracking, last_two, must_be_found, until_search

# Number of past costs in the running median.
_RECENT = 90
# If a joint moves farther than this between two frames (m), the track may be lost, and the frame is searched in.
_FAR = 0.2
# What is found in such frames leads the track elsewhere, into frames that may be doubtful too and are searched in next.
# With one round, three frames of a real child kept poses that cost twice what is usual, and 28 faced the wrong way. In
# nine films of naked people, rounds after the first changed nothing.
_ROUNDS = 3


class Proposed(NamedTuple):
    """Start poses for a full search in some frames.

    Attributes:
        starts: Axes ``frames starts``.
        sides: Confidence that left and right are not exchanged (0.5..1).
    """

    starts: Pose
    sides: Float[np.ndarray, " frames"]


class Followed(NamedTuple):
    """Poses of consecutive frames.

    Attributes:
        found: The hypotheses of each frame, the chosen one first: then the other track's where one faces the other way,
            see `Fork`; then those of other ways, but not in a stack of one frame; then what the latest search found.
        sides: Confidence of the latest search that left and right are not exchanged (0.5..1).
        track: The new state.
        fork: Both tracks where another one faces the other way: later frames may choose again.
    """

    found: Hypotheses
    sides: Float[np.ndarray, " frames"]
    track: Track
    fork: Fork | None = None


def track_frames(
    model: Model,
    search: Search,
    tracking: Tracking,
    fps: float,
    track: Track | None,
    propose: Callable[[Int[np.ndarray, " some"]], Proposed],
    fallback: Pose,
    observed: Observed,
) -> Followed:
    """Estimate the poses of consecutive frames: of up to 32, or of one that arrives by itself.

    A full search runs at regular intervals, see `Tracking`, in frames that cost more than is usual for the subject, and
    in frames where a joint moves suspiciously far. From the poses found, the track runs forwards, and other ways if it
    does not meet all of them, see `best_track`. Where these differ, the path that is cheapest over all frames wins, so
    the sequence as a whole decides between left and right. A stack of one frame has one way.

    Args:
        model: The subject.
        search: Settings of the full search.
        tracking: Settings of tracking.
        fps: Frames per second.
        track: State after the frames before; None at the start.
        propose: Returns the start poses for the given frame indices.
        fallback: As for `solve_frames`.
        observed: Outlines and silhouettes, with a leading axis ``frames``, see `on_device`.
    """
    count = len(fallback.root)
    period = until_search(tracking, fps, track)
    since = period if track is None else track.since
    searched = np.flatnonzero((np.arange(count) + 1 + since) % period == 0) if period > 1 else np.arange(count)
    if track is None:
        searched = np.union1d(searched, [0])
    stack = on_device(observed)
    sides = np.full(count, np.nan)
    # Frames not searched get a placeholder of infinite cost.
    placeholders = pool_of(jax.tree.map(lambda a: a[:, :1], fallback), np.arange(count))

    def searched_in(frames: Int[np.ndarray, " some"]) -> Pool:
        if len(frames) == 0:
            return take(placeholders, frames)
        starts, sides[frames] = propose(frames)
        return solve_frames(model, search, starts, fallback, stack, frames).pool(frames)

    every = searched_in(searched)
    offers = placeholders.joined(cheapest_each_way(every))
    # Where a second track faces the other way, neither turns to it.
    two_tracks = search.looks_both_ways and count > 1
    ahead = tracking.with_turns(np.inf) if two_tracks else tracking
    found = best_track(model, ahead, track, offers, stack)
    for _ in range(_ROUNDS):
        lost = np.setdiff1d(np.flatnonzero(suspicious(model, track, found)), searched)
        if len(lost) == 0:
            break
        searched, every = np.union1d(searched, lost), every.joined(searched_in(lost))
        offers = placeholders.joined(cheapest_each_way(every))
        found = best_track(model, ahead, track, offers, stack)
    known = Known(every.rows(searched, search.most), searched, _known_before(track, found, search.most))
    fork = forked(model, tracking, fps, track, found, offers, known, stack) if two_tracks else None
    rival = None
    if fork is not None:
        way = decide([fork])
        found, rival = fork.hypotheses(way.path, way.through), rival_after(tracking, fork, way)
    alternatives = latest(found, known)
    if fork is None:
        found = told(found, alternatives)
    after = jax.tree.map(lambda a: a[-1], alternatives)
    # Each frame takes the confidence of the latest search before it.
    search_of = np.maximum.accumulate(np.where(np.isnan(sides), -1, np.arange(count)))
    sides = np.where(search_of >= 0, sides[search_of], 0.5 if track is None else track.sides)
    state = state_after(track, found, (since + count) % period, float(sides[-1]))
    met = ~apart(places_of(model, known.found.best), places_of(model, take(found.best, searched)))
    calm = fork is None and bool(met.all()) and (len(met) > 0 or (track is not None and track.calm))
    return Followed(found, sides, replace(state, rival=rival, alternatives=after, calm=calm), fork)


def _known_before(track: Track | None, found: Hypotheses, count: int) -> Alternatives:
    """What was known before the first frame."""
    if track is not None and track.alternatives is not None:
        return track.alternatives
    return no_alternatives(jax.tree.map(lambda a: a[0], found.best), count)


def suspicious(model: Model, track: Track | None, found: Hypotheses) -> Bool[np.ndarray, " frames"]:
    """Frames that cost more than is usual for the subject, or in which a joint moves suspiciously far."""
    usual = float(np.median(_costs_after(track, found)))
    places = places_of(model, found.best)
    start = places[0] if track is None else last_place(model, track)
    moved = np.linalg.norm(np.diff(places, axis=0, prepend=start[None]), axis=-1).max(-1)
    return (found.cost[:, 0] > cost_threshold(usual)) | (moved > _FAR)


def _costs_after(track: Track | None, found: Hypotheses) -> Float[np.ndarray, " recent"]:
    costs = np.zeros(0) if track is None else track.costs
    return np.concatenate([costs, found.cost[:, 0]])[-_RECENT:]


def state_after(track: Track | None, found: Hypotheses, since: int, sides: float) -> Track:
    """State after the frames found; a person who was lost before a single frame has no velocity after it."""
    last, before = last_two(found.best)
    if len(found.cost) == 1 and track is not None and not must_be_found(track):
        before = track.last
    return Track(last, before, since, _costs_after(track, found), sides)
