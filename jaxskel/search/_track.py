"""Poses of consecutive frames: each frame is fitted from the one before, full searches keep the track honest."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._runtime.batching import on_device, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import Pose, place_joints
from ..refinement.terms import Observed
from ._fit import Scales, fit_hypothesis, fit_scales
from ._hypotheses import Hypotheses, Pool, pool_of
from ._search import Model, Search, cost_threshold, solve_frames

# Frames followed in one go, forwards and backwards.
TRACKED_FRAMES = 32
# Costs that the running median looks back on.
_RECENT = 90
# Poses that agree to this in every joint are the same (m).
_SAME = 0.05
# Where a joint moves farther than this from one frame to the next (m), the pose before tells little of the one after.
_FAR = 0.2


class Tracking(eqx.Module):
    """How to follow a person from frame to frame."""

    interval: float = 0.25
    """Time between two full searches (s): so long at most does the track follow a pose that another one beats."""
    steps: int = 6
    """Steps of the fit from the frame before."""
    margin: float = 2.0
    """Hysteresis: by so much must another pose be cheaper to be switched to."""


class Track(eqx.Module):
    """Where a person was."""

    last: Pose
    before: Pose
    since: int
    """Frames since the last full search."""
    costs: Float[np.ndarray, " recent"]
    """Of the poses so far, the last ones."""
    sides: float = 0.5
    """How sure the last full search was of left and right."""


class Proposed(NamedTuple):
    """Where a search in some frames starts."""

    starts: Pose
    """Axes ``frames starts``."""
    sides: Float[np.ndarray, " frames"]
    """How sure left and right are (0.5..1)."""


def track_frames(
    model: Model,
    search: Search,
    tracking: Tracking,
    fps: float,
    track: Track | None,
    propose: Callable[[Int[np.ndarray, " some"]], Proposed],
    fallback: Pose,
    observed: Observed,
) -> tuple[Hypotheses, Float[np.ndarray, " frames"], Track]:
    """Poses of up to `TRACKED_FRAMES` consecutive frames.

    A full search is made at regular intervals, where the track costs more than is usual for the subject, and where it
    moves so far that it may have been led astray. From the poses that it finds the track goes on forwards and
    backwards; where the two differ, the one that is cheaper over all frames wins, and so left and right are decided by
    the sequence.

    Args:
        model: The subject.
        search: How to search.
        tracking: How to follow.
        fps: Frames per second.
        track: Where the person was in the frames before; None where that is not known.
        propose: Gives poses to start from for those frames that are searched in.
        fallback: As for `solve_frames`.
        observed: Outlines and silhouettes, with a leading axis ``frames``.

    Returns:
        Two hypotheses for each frame, the chosen one first; how sure left and right are, by the last search; and the
        track to go on with.
    """
    count = len(fallback.root)
    every = max(1, round(tracking.interval * fps))
    since = every if track is None else track.since
    searched = np.flatnonzero((np.arange(count) + 1 + since) % every == 0) if every > 1 else np.arange(count)
    if track is None:
        searched = np.union1d(searched, [0])
    stack = on_device(observed)
    sides = np.full(count, np.nan)

    def searched_in(frames: Int[np.ndarray, " some"]) -> Pool:
        starts, sides[frames] = propose(frames)
        found = solve_frames(model, search, starts, fallback, stack, frames)
        return Pool(frames, found.best, found.cost[:, 0])

    # What is not searched for is offered by nobody.
    offers = pool_of(jax.tree.map(lambda a: a[:, :1], fallback), np.arange(count))
    if len(searched):
        offers = offers.joined(searched_in(searched)).cheapest(1)
    costs = np.zeros(0) if track is None else track.costs
    found = _best_track(model, tracking, track, offers, stack)
    usual = float(np.median(np.concatenate([costs, found.cost[:, 0]])[-_RECENT:]))
    places = _places(model, found.best)
    start = places[0] if track is None else _last_place(model, track)
    moved = np.linalg.norm(np.diff(places, axis=0, prepend=start[None]), axis=-1).max(-1)
    lost = np.setdiff1d(np.flatnonzero((found.cost[:, 0] > cost_threshold(usual)) | (moved > _FAR)), searched)
    if len(lost):
        offers = offers.joined(searched_in(lost)).cheapest(1)
        found = _best_track(model, tracking, track, offers, stack)
    last, before = (jax.tree.map(lambda a, i=i: a[max(count - i, 0)], found.best) for i in (1, 2))
    if count == 1 and track is not None:
        before = track.last
    costs = np.concatenate([costs, found.cost[:, 0]])[-_RECENT:]
    # Each frame knows what the last search before it found.
    latest = np.maximum.accumulate(np.where(np.isnan(sides), -1, np.arange(count)))
    sides = np.where(latest >= 0, sides[latest], 0.5 if track is None else track.sides)
    return found, sides, Track(last, before, (since + count) % every, costs, float(sides[-1]))


def _best_track(model: Model, tracking: Tracking, track: Track | None, offers: Pool, stack: Observed) -> Hypotheses:
    count = len(offers)
    first = jax.tree.map(lambda a: a[0], offers.poses)
    last, before = (first, first) if track is None else (track.last, track.before)
    frames = np.minimum(np.arange(TRACKED_FRAMES), count - 1)
    half = tracking.steps // 2
    scales = fit_scales((0.08, half), (0.04, tracking.steps - half))

    def follow(order: Int[np.ndarray, " frames"], last: Pose, before: Pose) -> tuple[Pose, np.ndarray]:
        margin, number = jnp.asarray(tracking.margin, jnp.float32), jnp.asarray(order, jnp.int32)
        last, before = single_precision((last, before))
        poses, cost = single_precision(take((offers.poses, offers.cost), order))
        found = _follow(model, margin, scales, last, before, poses, cost, number, stack)
        return jax.tree.map(lambda a: np.asarray(a)[:count], found)

    forwards, cost = follow(frames, last, before)
    end = jax.tree.map(lambda a: a[-1], forwards)
    back = np.maximum(np.arange(count - 1, count - 1 - TRACKED_FRAMES, -1), 0)
    backwards, other = jax.tree.map(lambda a: a[::-1], follow(back, end, end))
    places = np.stack([_places(model, forwards), _places(model, backwards)], 1)
    costs = np.stack([cost, other], 1)
    start = None if track is None else _last_place(model, track)
    chosen = cheapest_path(costs, places, tracking.margin, start)
    both = Hypotheses(jax.tree.map(lambda a, b: np.stack([a, b], 1), forwards, backwards), costs)
    return both.ordered(np.stack([chosen, 1 - chosen], 1))


def cheapest_path(
    costs: Float[np.ndarray, "frames tracks"],
    places: Float[np.ndarray, "frames tracks points 3"],
    margin: float,
    start: Float[np.ndarray, "points 3"] | None = None,
) -> Int[np.ndarray, " frames"]:
    """Which track to be on in each frame: costs add up, and so does the margin for each jump (Viterbi).

    It is a jump where the poses of both tracks in the frame that is left differ; from `start`, where the new pose is
    as far from it as no person moves.
    """
    frames, tracks = costs.shape
    apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1).max(-1)
    jump = np.where(apart > _SAME, margin, 0.0)
    total = costs[0].astype(np.float64)
    if start is not None:
        far = np.linalg.norm(places[0] - start, axis=-1).max(-1)
        total = total + np.where(far > far.min() + _SAME, margin, 0.0)
    came = np.zeros((frames, tracks), int)
    for frame in range(1, frames):
        ways = total[:, None] + jump[frame - 1]
        came[frame] = ways.argmin(0)
        total = ways.min(0) + costs[frame]
    path = np.zeros(frames, int)
    path[-1] = total.argmin()
    for frame in range(frames - 1, 0, -1):
        path[frame - 1] = came[frame, path[frame]]
    return path


@cached_jit
def _follow(
    model: Model,
    margin: Float[Array, ""],
    scales: Scales,
    last: Pose,
    before: Pose,
    offered: Pose,
    offered_cost: Float[Array, " frames"],
    order: Int[Array, " frames"],
    stack: Observed,
) -> tuple[Pose, Float[Array, " frames"]]:
    """Fit each frame from the one before in some order, and from where the motion leads to.

    What is offered is taken where it is cheaper.
    """

    def step(past: tuple[Pose, Pose], frame: tuple[Pose, Array, Array]) -> tuple[tuple[Pose, Pose], tuple[Pose, Array]]:
        (last, before), (offered, offered_cost, number) = past, frame
        seen = stack.of(number)
        hypotheses = jax.tree.map(lambda *a: jnp.stack(a), last, _onwards(last, before))
        poses, cost = jax.vmap(lambda pose: fit_hypothesis(model.body, pose, seen, scales))(hypotheses)
        best = jnp.argmin(cost)
        pose, cost = jax.tree.map(lambda a: a[best], (poses, cost))
        switch = offered_cost < cost - margin
        pose = jax.tree.map(lambda new, old: jnp.where(switch, new, old), offered, pose)
        # After a jump there is no motion to go on with.
        last = jax.tree.map(lambda new, old: jnp.where(switch, new, old), pose, last)
        return (pose, last), (pose, jnp.where(switch, offered_cost, cost))

    return jax.lax.scan(step, (last, before), (offered, offered_cost, order))[1]


def _onwards(last: Pose, before: Pose) -> Pose:
    """The pose after the last one if the motion goes on as it was."""
    rotations, old = jnp.asarray(last.rotations), jnp.asarray(before.rotations)
    # Written out: see `HingedLimbs`.
    turns = (rotations[:, :, None] * old[:, None]).sum(-1)
    turned = (turns[..., None] * rotations[:, None]).sum(-2)
    return Pose(2 * jnp.asarray(last.root) - before.root, turned)


def _last_place(model: Model, track: Track) -> Float[np.ndarray, "joints=15 3"]:
    return _places(model, jax.tree.map(lambda a: a[None], track.last))[0]


def _places(model: Model, poses: Pose) -> Float[np.ndarray, "frames joints=15 3"]:
    return np.asarray(place_joints(model.skeleton, single_precision(poses))[0])
