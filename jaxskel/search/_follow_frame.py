"""Tracking in a stream: a person is followed into one more frame, while searches last over several frames.

A search takes as long as many frames. In a stream it goes on step by step while later frames are followed, and what it
finds is carried to the frame that has come by then. Only a person who is lost is searched for at once.
"""

from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Float

from .._runtime.batching import on_device
from ..body import Pose
from ..refinement.terms import Observed
from ._fit import Steps, fit_pool
from ._hypotheses import Hypotheses, Pool, pool_of
from ._search import Model
from ._track import best_track, between_searches, follow_scales, state_after, suspicious
from ._track_state import Ongoing, Searched, Track, Tracking


def follow_frame(
    model: Model, tracking: Tracking, track: Track, observed: Observed
) -> tuple[Hypotheses, Float[np.ndarray, "frames=1"], Track] | None:
    """Follow the person into one more frame; None where the frame is suspicious, so that it must be searched in.

    An ongoing search is taken one step on, in every other frame while the track costs what is usual: of 18 searches in
    nine films none found a better pose. Arguments and results are those of `track_frames`; `observed` is a stack of one
    frame.
    """
    stack = on_device(observed, 1)
    offer = None
    if track.ongoing is not None and not track.hurried:
        if track.ongoing.rests and track.costs[-1] < np.median(track.costs) + tracking.margin:
            track = replace(track, ongoing=replace(track.ongoing, rests=False))
        else:
            track, offer = search_on(model, tracking, track, stack)
    nothing = pool_of(jax.tree.map(lambda a: np.asarray(a)[None, None], track.last), np.zeros(1, int))
    found = best_track(model, tracking, track, nothing if offer is None else offer, stack)
    if offer is None and suspicious(model, track, found).any():
        return None
    after = replace(state_after(track, found, track.since + 1, track.sides), ongoing=track.ongoing)
    return found, np.array([track.sides]), after


def search_is_due(tracking: Tracking, fps: float, track: Track) -> bool:
    """Whether a search should begin in the next frame of a stream; one that goes on is not disturbed."""
    return track.ongoing is None and not track.hurried and track.since + 1 >= between_searches(tracking, fps)


def begun(track: Track, found: Hypotheses, steps: Steps[Searched]) -> Track:
    """The same track with a search in its last frame, of which `found` are the hypotheses, that has begun."""
    pose = jax.tree.map(lambda a: a[0], found.best)
    return replace(track, since=0, ongoing=Ongoing(steps, pose, float(found.cost[0, 0])))


def search_on(model: Model, tracking: Tracking, track: Track, stack: Observed) -> tuple[Track, Pool | None]:
    """Take one step of an ongoing search; at its end, offer what it found, if that was better than the track.

    The pose found is that of an earlier frame. Each segment is moved as the track's has moved since; then the pose is
    fitted to the frame of `stack`.
    """
    assert track.ongoing is not None
    pose, cost = track.ongoing.pose, track.ongoing.cost
    try:
        next(track.ongoing.steps)
    except StopIteration as end:
        found: Searched = end.value
    else:
        return replace(track, ongoing=replace(track.ongoing, rests=True)), None
    track = replace(track, sides=found.sides, ongoing=None)
    if found.cost > cost - tracking.margin:
        return track, None
    moved = np.asarray(track.last.rotations) @ np.asarray(pose.rotations).swapaxes(-1, -2)
    carried = Pose(found.pose.root + (track.last.root - pose.root), moved @ found.pose.rotations)
    carried = jax.tree.map(lambda a: np.asarray(a)[None, None], carried)
    return track, fit_pool(model.body, pool_of(carried, np.zeros(1, int)), stack, follow_scales(tracking))
