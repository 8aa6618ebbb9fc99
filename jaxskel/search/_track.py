"""Tracking: each frame is fitted from the one before; full searches at intervals correct the track."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import length_of, on_device, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import Pose, place_joints
from ..refinement.terms import Observed
from ._cheapest_path import cheapest_path, jump_costs, left_of, turned_round
from ._fit import Scales, fit_hypothesis, fit_scales
from ._hypotheses import Hypotheses, Pool, pool_of
from ._model import Model
from ._search import Search, cost_threshold, solve_frames
from ._track_state import Track, Tracking, must_be_found

# Number of past costs in the running median.
_RECENT = 90
# If a joint moves farther than this between two frames (m), the track may be lost, and the frame is searched in.
_FAR = 0.2


class Proposed(NamedTuple):
    """Start poses for a full search in some frames.

    Attributes:
        starts: Axes ``frames starts``.
        sides: Confidence that left and right are not exchanged (0.5..1).
    """

    starts: Pose
    sides: Float[np.ndarray, " frames"]


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
    """Estimate the poses of consecutive frames: of up to 32, or of one that arrives by itself.

    A full search runs at regular intervals, in frames that cost more than is usual for the subject, and in frames where
    a joint moves suspiciously far. From the poses found, the track runs forwards and backwards. Where the two differ,
    the path that is cheaper over all frames wins, so the sequence as a whole decides between left and right. A stack of
    one frame has no way back.

    Args:
        model: The subject.
        search: Settings of the full search.
        tracking: Settings of tracking.
        fps: Frames per second.
        track: State after the frames before; None at the start.
        propose: Returns the start poses for the given frame indices.
        fallback: As for `solve_frames`.
        observed: Outlines and silhouettes, with a leading axis ``frames``, see `on_device`.

    Returns:
        Two hypotheses for each frame, the chosen one first, or one in a stack of one frame; the confidence of the
        latest search in left and right (0.5..1); and the new tracking state.
    """
    count = len(fallback.root)
    every = between_searches(tracking, fps)
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

    # Frames not searched get a placeholder of infinite cost.
    offers = pool_of(jax.tree.map(lambda a: a[:, :1], fallback), np.arange(count))
    if len(searched):
        offers = offers.joined(searched_in(searched)).cheapest(1)
    found = best_track(model, tracking, track, offers, stack)
    lost = np.setdiff1d(np.flatnonzero(suspicious(model, track, found)), searched)
    if len(lost):
        offers = offers.joined(searched_in(lost)).cheapest(1)
        found = best_track(model, tracking, track, offers, stack)
    # Each frame takes the confidence of the latest search before it.
    latest = np.maximum.accumulate(np.where(np.isnan(sides), -1, np.arange(count)))
    sides = np.where(latest >= 0, sides[latest], 0.5 if track is None else track.sides)
    return found, sides, state_after(track, found, (since + count) % every, float(sides[-1]))


def follow_scales(tracking: Tracking) -> Scales:
    half = tracking.steps // 2
    return fit_scales((0.08, half), (0.04, tracking.steps - half))


def between_searches(tracking: Tracking, fps: float) -> int:
    """Frames from one full search to the next."""
    return max(1, round(tracking.interval * fps))


def suspicious(model: Model, track: Track | None, found: Hypotheses) -> Bool[np.ndarray, " frames"]:
    """Frames that cost more than is usual for the subject, or in which a joint moves suspiciously far."""
    usual = float(np.median(_costs_after(track, found)))
    places = _places(model, found.best)
    start = places[0] if track is None else _last_place(model, track)
    moved = np.linalg.norm(np.diff(places, axis=0, prepend=start[None]), axis=-1).max(-1)
    return (found.cost[:, 0] > cost_threshold(usual)) | (moved > _FAR)


def _costs_after(track: Track | None, found: Hypotheses) -> Float[np.ndarray, " recent"]:
    costs = np.zeros(0) if track is None else track.costs
    return np.concatenate([costs, found.cost[:, 0]])[-_RECENT:]


def state_after(track: Track | None, found: Hypotheses, since: int, sides: float) -> Track:
    """State after the frames found; a person who was lost before a single frame has no velocity after it."""
    count = len(found.cost)
    last, before = (jax.tree.map(lambda a, i=i: a[max(count - i, 0)], found.best) for i in (1, 2))
    if count == 1 and track is not None and not must_be_found(track):
        before = track.last
    return Track(last, before, since, _costs_after(track, found), sides)


def best_track(model: Model, tracking: Tracking, track: Track | None, offers: Pool, stack: Observed) -> Hypotheses:
    count = len(offers)
    first = jax.tree.map(lambda a: a[0], offers.poses)
    last, before = (first, first) if track is None else (track.last, track.before)
    length = length_of(stack)
    frames = np.minimum(np.arange(length), count - 1)
    scales = follow_scales(tracking)

    def follow(order: Int[np.ndarray, " frames"], last: Pose, before: Pose) -> tuple[Pose, np.ndarray]:
        margins = jnp.asarray([tracking.margin, tracking.turn_margin], jnp.float32)
        number = jnp.asarray(order, jnp.int32)
        last, before = single_precision((last, before))
        poses, cost = single_precision(take((offers.poses, offers.cost), order))
        found = _follow(model, margins, scales, last, before, poses, cost, number, stack)
        return jax.tree.map(lambda a: np.asarray(a)[:count], found)

    forwards, cost = follow(frames, last, before)
    if length == 1:
        return Hypotheses(jax.tree.map(lambda a: a[:, None], forwards), cost[:, None])
    end = jax.tree.map(lambda a: a[-1], forwards)
    back = np.maximum(np.arange(count - 1, count - 1 - length, -1), 0)
    backwards, other = jax.tree.map(lambda a: a[::-1], follow(back, end, end))
    both = Hypotheses(jax.tree.map(lambda a, b: np.stack([a, b], 1), forwards, backwards), np.stack([cost, other], 1))
    places = np.stack([_places(model, forwards), _places(model, backwards)], 1)
    chosen = cheapest_path(both.cost, *_jumps(model, tracking, track, both, places))
    return both.ordered(np.stack([chosen, 1 - chosen], 1))


def _jumps(
    model: Model,
    tracking: Tracking,
    track: Track | None,
    both: Hypotheses,
    places: Float[np.ndarray, "frames tracks joints 3"],
) -> tuple[Float[np.ndarray, "frames tracks tracks"], Float[np.ndarray, " tracks"]]:
    """Costs of jumps between two tracks, and of beginning on each of them; `places` are their joints (m).

    To begin on a track is a jump if its first pose is farther from the last one than that of the other track.
    """
    left = np.asarray(left_of(both.poses))
    jumps = jump_costs(places[:, :, None], places[:, None], left[:, :, None], left[:, None], tracking)
    if track is None:
        return jumps, np.zeros(2)
    far = np.linalg.norm(places[0] - _last_place(model, track), axis=-1).max(-1)
    near = int(far.argmin())
    return jumps, jumps[0, near]


@cached_jit
def _follow(
    model: Model,
    margins: Float[Array, "2"],
    scales: Scales,
    last: Pose,
    before: Pose,
    offered: Pose,
    offered_cost: Float[Array, " frames"],
    order: Int[Array, " frames"],
    stack: Observed,
) -> tuple[Pose, Float[Array, " frames"]]:
    """Fit each frame, in the given order, from the pose before and from its extrapolation; keep the cheaper result.

    An offered pose replaces it if that is cheaper by more than the first of the `margins`, or by more than the second
    if it faces the other way.
    """

    def step(past: tuple[Pose, Pose], frame: tuple[Pose, Array, Array]) -> tuple[tuple[Pose, Pose], tuple[Pose, Array]]:
        (last, before), (offered, offered_cost, number) = past, frame
        seen = stack.of(number)
        hypotheses = jax.tree.map(lambda *a: jnp.stack(a), last, _onwards(last, before))
        poses, cost = jax.vmap(lambda pose: fit_hypothesis(model.body, model.objective, pose, seen, scales))(hypotheses)
        best = jnp.argmin(cost)
        pose, cost = jax.tree.map(lambda a: a[best], (poses, cost))
        turned = turned_round(left_of(offered), left_of(pose))
        switch = offered_cost < cost - jnp.where(turned, margins[1], margins[0])
        pose = jax.tree.map(lambda new, old: jnp.where(switch, new, old), offered, pose)
        # After a switch, the velocity is zero.
        last = jax.tree.map(lambda new, old: jnp.where(switch, new, old), pose, last)
        return (pose, last), (pose, jnp.where(switch, offered_cost, cost))

    return jax.lax.scan(step, (last, before), (offered, offered_cost, order))[1]


def _onwards(last: Pose, before: Pose) -> Pose:
    """Extrapolate the pose with constant velocity (m, in the world)."""
    rotations, old = jnp.asarray(last.rotations), jnp.asarray(before.rotations)
    # Products written out: faster for small matrices, see `_product` in `HingedLimbs`.
    turns = (rotations[:, :, None] * old[:, None]).sum(-1)
    turned = (turns[..., None] * rotations[:, None]).sum(-2)
    # Rounding errors of such products grow by half from frame to frame, until the matrices are no rotations any more.
    # A step of Newton's iteration for the nearest rotation squares them.
    gram = (turned[..., :, None] * turned[..., None, :]).sum(-3)
    straight = 1.5 * turned - 0.5 * (turned[..., None] * gram[:, None]).sum(-2)
    return Pose(2 * jnp.asarray(last.root) - before.root, straight)


def _last_place(model: Model, track: Track) -> Float[np.ndarray, "joints 3"]:
    return _places(model, jax.tree.map(lambda a: a[None], track.last))[0]


def _places(model: Model, poses: Pose) -> Float[np.ndarray, "frames joints 3"]:
    return np.asarray(place_joints(model.skeleton, single_precision(poses))[0])
