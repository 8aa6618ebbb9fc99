"""A second track that faces the other way, where silhouettes may not tell the front of a person from the back.

Each frame by itself tells little: of 30 frames of a real child in wide clothes, 8 cost less the wrong way round. Over a
film their sum decides. Each of the two tracks takes what searches find that faces its way.
"""

from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Float

from .._runtime.batching import take
from ..refinement.terms import Observed
from ._alternatives import Known, facing_alike, latest, no_alternatives, told
from ._best_track import best_track, places_of
from ._cheapest_path import jump_costs
from ._facing import angles_between, left_of, turned_round
from ._fork import Decided, Fork
from ._hypotheses import Hypotheses, Pool
from ._model import Model
from ._track_state import Rival, Track, Tracking, between_searches, last_two

# Angle by which a person may turn in a second (rad): one and a quarter turn.
_TURNING = 2.5 * np.pi


def forked(
    model: Model,
    tracking: Tracking,
    fps: float,
    track: Track | None,
    found: Hypotheses,
    offers: Pool,
    known: Known,
    stack: Observed,
) -> Fork | None:
    """Follow a track that faces the other way than a given one; None if nothing does.

    Args:
        model: The subject.
        tracking: Settings of tracking.
        fps: Frames per second.
        track: State after the frames before; None at the start.
        found: The track, see `best_track`, which took no pose that faces the other way.
        offers: What searches found in some of the frames, both ways; at infinite cost in the others.
        known: All that they found: what faces a track's way is among its hypotheses.
        stack: Observations, on the device.
    """
    away = np.asarray(turned_round(left_of(offers.poses), left_of(found.best)[offers.frame]))
    begins = None if track is None else track.rival
    if begins is None:
        begins = _begun(tracking, track, take(offers, away & np.isfinite(offers.cost)))
    if begins is None:
        return None
    opposite = replace(offers, cost=np.where(away, offers.cost, np.float32(np.inf)))
    state = Track(begins.last, begins.before, 0, np.zeros(0))
    other = best_track(model, tracking.with_turns(tracking.margin), state, opposite, stack)
    places = np.stack([places_of(model, tracks.best) for tracks in (found, other)], 1)
    nothing = no_alternatives(begins.last, known.found.cost.shape[1])
    one_way, other_way = (
        facing_alike(told(way, latest(way, now)))
        for way, now in ((found, known), (other, known._replace(before=nothing)))
    )
    both = jax.tree.map(lambda a, b: np.stack([a[:, 0], b[:, 0]], 1), one_way, other_way)
    others = tuple(jax.tree.map(lambda a: a[:, 1:], way) for way in (one_way, other_way))
    jumps = _costs_of_turns(tracking, fps, np.asarray(left_of(both.poses)), places)
    return Fork(both, others, jumps, np.array([0.0, begins.excess]), between_searches(tracking, fps))


def _costs_of_turns(
    tracking: Tracking,
    fps: float,
    left: Float[np.ndarray, "frames tracks 3"],
    places: Float[np.ndarray, "frames tracks joints 3"],
) -> Float[np.ndarray, "frames tracks tracks"]:
    """Costs of jumps between tracks, and of turns of each track to the next frame that are too fast for a person.

    They grow with the angle, so that two turns by a part of it cost as much as one by all of it.
    """
    half_turn = tracking.turn_margin - tracking.margin
    pairs = left[:, :, None], left[:, None]
    jumps = jump_costs(places[:, :, None], places[:, None], *pairs, tracking.with_turns(tracking.margin))
    jumps += half_turn / np.pi * angles_between(*pairs)
    allowed = _TURNING / fps
    turns = np.maximum(angles_between(left[:-1], left[1:]) - allowed, 0.0) / max(np.pi - allowed, 1e-3)
    jumps[:-1] += half_turn * np.minimum(turns, 1.0)[:, None]
    return jumps


def _begun(tracking: Tracking, track: Track | None, offers: Pool) -> Rival | None:
    """A rival that begins at the first of some poses."""
    if len(offers) == 0:
        return None
    first = jax.tree.map(lambda a: a[0], offers.cheapest(1).poses)
    return Rival(first, first, 0.0 if track is None else tracking.turn_margin)


def rival_after(tracking: Tracking, fork: Fork, way: Decided) -> Rival | None:
    """The state of the other track than the one chosen after the last frame; None where it costs too much to go on."""
    others = fork.both.ordered(1 - way.path[:, None]).best
    excess = float(np.ptp(way.through[-1]))
    left = left_of(jax.tree.map(lambda a: a[-1], fork.both.poses))
    if excess >= tracking.turn_margin or not turned_round(left[:1], left[1:]).all():
        return None
    return Rival(*last_two(others), excess)
