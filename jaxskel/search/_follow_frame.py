"""Tracking in a stream: a person is followed into one more frame, while searches last over several frames.

A search takes as long as many frames. In a stream it goes on step by step while later frames are followed, and what it
finds is carried to the frame that has come by then. Only a person who is lost is searched for at once.
"""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np

from .._runtime.batching import on_device
from .._runtime.steps import Steps
from ..refinement.terms import Observed
from ._alternatives import Alternatives, carried, told
from ._best_track import best_track, follow_scales, places_of
from ._cheapest_path import apart
from ._fit import fit_pool
from ._hypotheses import Hypotheses, Pool, pool_of
from ._model import Model
from ._search import cost_threshold
from ._track import Followed, state_after
from ._track_state import Ongoing, Searched, Track, Tracking, between_searches, until_search

# A pose that costs more than this many times what few frames of the subject cost is not followed any further.
_ASTRAY = 1.5
# Steps of a search that began in doubt: in the frame in which it began, which is enough for most, and in later ones.
_AT_ONCE, _IN_DOUBT = 30, 4


def follow_frame(model: Model, tracking: Tracking, fps: float, track: Track, observed: Observed) -> Followed | None:
    """Follow the person into one more frame; None where the track has gone astray, so that it must be searched in.

    An ongoing search is taken on. Arguments and results are those of `track_frames`; `observed` is a stack of one
    frame.
    """
    stack, offering = on_device(observed, 1), tracking.for_one_offer(fps)
    track, offer = _searched_on(model, offering, track, stack, _steps(tracking, track))
    followed = _followed(model, offering, track, stack, offer)
    if followed.found.cost[0, 0] > _ASTRAY * _unusual(track):
        return None
    return followed


def search_in_doubt(
    model: Model,
    tracking: Tracking,
    fps: float,
    track: Track,
    followed: Followed,
    steps: Steps[Searched],
    observed: Observed,
) -> Followed:
    """Begin a search in a frame that the person was followed into with doubt, and take the better pose.

    Args:
        model: The subject.
        tracking: Settings of tracking.
        fps: Frames per second.
        track: State after the frame before.
        followed: Result of `follow_frame`.
        steps: The search; where it does not end soon, it goes on in the next frames.
        observed: A stack of this frame.
    """
    stack, offering = on_device(observed, 1), tracking.for_one_offer(fps)
    after, offer = _searched_on(model, offering, begun(followed.track, followed.found, steps), stack, _AT_ONCE)
    if offer is None:
        return Followed(_told(followed.found, after), np.array([after.sides]), after)
    kept = {name: getattr(after, name) for name in ("sides", "ongoing", "alternatives", "calm")}
    track = replace(track, since=after.since - 1, **kept)
    return _followed(model, offering, track, stack, offer)


def _followed(model: Model, tracking: Tracking, track: Track, stack: Observed, offer: Pool | None) -> Followed:
    """The pose that follows, or the one that is offered: the first of the track's alternatives."""
    pool = pool_of(jax.tree.map(lambda a: np.asarray(a)[None, None], track.last), np.zeros(1, int))
    found = best_track(model, tracking, track, pool if offer is None else offer, stack)
    if offer is not None and track.alternatives is not None and eqx.tree_equal(found.best, offer.poses):
        track = replace(track, alternatives=track.alternatives.taken())
    after = state_after(track, found, track.since + 1, track.sides)
    after = replace(after, ongoing=track.ongoing, alternatives=track.alternatives, calm=track.calm)
    return Followed(_told(found, after), np.array([track.sides]), after)


def _told(found: Hypotheses, track: Track) -> Hypotheses:
    """The pose of one frame, and the alternatives known to its track."""
    alone = found.ordered(np.zeros((1, 1), int))
    if track.alternatives is None:
        return alone
    return told(alone, jax.tree.map(lambda a: np.asarray(a)[None], track.alternatives))


def _searched_on(
    model: Model, tracking: Tracking, track: Track, stack: Observed, steps: int
) -> tuple[Track, Pool | None]:
    """Take some steps of the ongoing search; at its end, what it offers, see `search_on`."""
    if track.ongoing is not None:
        track = replace(track, ongoing=replace(track.ongoing, rested=steps == 0))
    offer = None
    for _ in range(steps):
        if track.ongoing is not None:
            track, offer = search_on(model, tracking, track, stack)
    return track, offer


def _steps(tracking: Tracking, track: Track) -> int:
    """Steps of the ongoing search in the next frame.

    While the track costs what is usual, the search rests in every other frame: of 18 searches in nine films none found
    a better pose.
    """
    if track.ongoing is None or track.hurried:
        return 0
    if track.ongoing.in_doubt:
        return _IN_DOUBT
    return int(track.ongoing.rested or track.costs[-1] > np.median(track.costs) + tracking.margin)


def _unusual(track: Track) -> float:
    """Cost that few frames of the subject exceed."""
    return cost_threshold(float(np.median(track.costs)))


def _in_doubt(track: Track) -> bool:
    return bool(track.costs[-1] > _unusual(track))


def doubt_arises(tracking: Tracking, fps: float, track: Track) -> bool:
    """Whether the last frame cost more than is usual, and no search has begun lately."""
    return _in_doubt(track) and track.since >= between_searches(tracking, fps)


def search_is_due(tracking: Tracking, fps: float, track: Track) -> bool:
    """Whether a search should begin in the next frame of a stream; one that goes on is not disturbed."""
    return track.ongoing is None and not track.hurried and track.since + 1 >= until_search(tracking, fps, track)


def begun(track: Track, found: Hypotheses, steps: Steps[Searched]) -> Track:
    """The same track with a search in its last frame, of which `found` are the hypotheses, that has begun."""
    pose = jax.tree.map(lambda a: a[0], found.best)
    return replace(track, since=0, ongoing=Ongoing(steps, pose, float(found.cost[0, 0]), _in_doubt(track)))


def search_on(model: Model, tracking: Tracking, track: Track, stack: Observed) -> tuple[Track, Pool | None]:
    """Take one step of an ongoing search; at its end, offer what it found, if that was better than the track.

    The pose found is that of an earlier frame. Each segment is moved as the track's has moved since; then the pose is
    fitted to the frame of `stack`.
    """
    assert track.ongoing is not None
    pose, cost, in_doubt = track.ongoing.pose, track.ongoing.cost, track.ongoing.in_doubt
    try:
        next(track.ongoing.steps)
    except StopIteration as end:
        found: Searched = end.value
    else:
        return track, None
    first = jax.tree.map(lambda a: a[:1], found.poses)
    met = not apart(places_of(model, first), places_of(model, jax.tree.map(lambda a: np.asarray(a)[None], pose)))[0]
    track = replace(track, sides=found.sides, ongoing=None, calm=met and not in_doubt)
    poses = carried(found.poses, pose, track.last)
    track = replace(track, alternatives=Alternatives(poses, found.cost - np.float32(cost), track.last))
    if found.cost[0] > cost - tracking.margin:
        return track, None
    pool = pool_of(jax.tree.map(lambda a: a[None, :1], poses), np.zeros(1, int))
    return track, fit_pool(model.body, model.objective, pool, stack, follow_scales(tracking))
