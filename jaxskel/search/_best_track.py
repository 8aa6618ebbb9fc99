"""One track through some frames: followed forwards and, in doubt, other ways; the cheapest path through them."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._runtime.batching import length_of, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import Body, Pose, place_joints
from ..refinement.terms import Objective, Observed
from ._cheapest_path import apart, cheapest_path, jump_costs
from ._facing import left_of, turned_round
from ._fit import Scales, fit_one_of, fit_scales
from ._hypotheses import Hypotheses, Pool
from ._model import Model
from ._track_state import Track, Tracking

# Poses offered in each frame: that of a search, and one that faces the other way.
_OFFERS = 2
# Tracks: forwards, forwards without hysteresis, and backwards from there.
_WAYS = 3


class _Way(NamedTuple):
    """A track one way through consecutive frames.

    Attributes:
        poses: Axis ``frames``.
        followed: The poses before one that is offered was taken instead.
    """

    poses: Pose
    cost: Float[Array | np.ndarray, " *frames"]
    followed: Pose


def follow_scales(tracking: Tracking) -> Scales:
    half = tracking.steps // 2
    return fit_scales((0.08, half), (0.04, tracking.steps - half))


def best_track(model: Model, tracking: Tracking, track: Track | None, offers: Pool, stack: Observed) -> Hypotheses:
    """Follow a person from the state before, or from the first pose that is offered.

    Args:
        model: The subject.
        tracking: Settings of tracking.
        track: State after the frames before; None at the start.
        offers: Poses that the track may go on with, two at most count in each frame; costs are infinite where nothing
            is offered.
        stack: Observations, on the device.

    Returns:
        Three tracks, the chosen one first in each frame: forwards, forwards without hysteresis, and backwards from the
        end of that one, so that later frames decide, too. A track that meets all that is offered is the only one, and
        the others are the same at infinite cost: 17 of 21 stacks of eight films met, and the mean error of these films
        was 13.8 mm with and without going back. In a stack of one frame, one hypothesis.
    """
    count = len(np.unique(offers.frame))
    two = offers.rows(np.arange(count), _OFFERS)
    first = jax.tree.map(lambda a: a[0], two.best)
    last, before = (first, first) if track is None else (track.last, track.before)
    length = length_of(stack)
    frames = np.minimum(np.arange(length), count - 1)
    scales = follow_scales(tracking)

    def follow(order: Int[np.ndarray, " frames"], last: Pose, before: Pose, margins: Float[np.ndarray, "2"]) -> _Way:
        margins, last, before = single_precision((margins, last, before))
        poses, cost = single_precision(take((two.poses, two.cost), order))
        number = order.astype(np.int32)
        found = _follow(model.body, model.objective, margins, scales, last, before, poses, cost, number, stack)
        return jax.tree.map(lambda a: np.asarray(a)[:count], found)

    margins = np.array([tracking.margin, tracking.turn_margin])
    forwards = follow(frames, last, before, margins)
    if length == 1:
        return Hypotheses(*jax.tree.map(lambda a: a[:, None], (forwards.poses, forwards.cost)))
    met = ~apart(places_of(model, forwards.poses), places_of(model, two.best)) | np.isinf(two.cost[:, 0])
    if met.all():
        every = jax.tree.map(lambda a: np.stack([a] * _WAYS, 1), forwards.poses)
        return Hypotheses(every, np.stack([forwards.cost, *[np.full_like(forwards.cost, np.inf)] * (_WAYS - 1)], 1))
    eager = margins - tracking.margin
    eagerly = follow(frames, last, before, eager)
    end = jax.tree.map(lambda a: a[-1], eagerly.poses)
    back = np.maximum(np.arange(count - 1, count - 1 - length, -1), 0)
    backwards = jax.tree.map(lambda a: a[::-1], follow(back, end, end, eager))
    return _cheapest(model, tracking, track, (forwards, eagerly, backwards))


def _cheapest(model: Model, tracking: Tracking, track: Track | None, ways: tuple[_Way, ...]) -> Hypotheses:
    """The poses of all ways, in each frame first that of the cheapest path through them.

    A margin is paid wherever a path jumps: from way to way, and where a way takes a pose that is offered. So a pose
    that few frames speak for must be much cheaper, and one that many speak for need not be.
    """
    places = np.stack([places_of(model, way.poses) for way in ways], 1)
    followed = np.stack([places_of(model, way.followed) for way in ways], 1)
    every = jax.tree.map(lambda *a: np.stack(a, 1), *ways)
    found, left = Hypotheses(every.poses, every.cost), np.asarray(left_of(every.poses))
    taken = jump_costs(followed, places, np.asarray(left_of(every.followed)), left, tracking)
    chosen = cheapest_path(found.cost + taken, *_jumps(model, tracking, track, left, places))
    order = np.argsort(np.arange(len(ways)) != chosen[:, None], axis=1, kind="stable")
    return found.ordered(order)


def _jumps(
    model: Model,
    tracking: Tracking,
    track: Track | None,
    left: Float[np.ndarray, "frames tracks 3"],
    places: Float[np.ndarray, "frames tracks joints 3"],
) -> tuple[Float[np.ndarray, "frames tracks tracks"], Float[np.ndarray, " tracks"]]:
    """Costs of jumps between tracks, and of beginning on each of them.

    To begin on a track is a jump if its first pose is farther from the last one than that of another track.

    Args:
        model: The subject.
        tracking: Margins.
        track: State before the first frame.
        left: Directions of the left sides of the tracks' poses, see `left_of`.
        places: Their joints (m).
    """
    jumps = jump_costs(places[:, :, None], places[:, None], left[:, :, None], left[:, None], tracking)
    if track is None:
        return jumps, np.zeros(jumps.shape[1])
    far = np.linalg.norm(places[0] - last_place(model, track), axis=-1).max(-1)
    return jumps, jumps[0, int(far.argmin())]


@cached_jit
def _follow(
    body: Body,
    objective: Objective,
    margins: Float[Array | np.ndarray, "2"],
    scales: Scales,
    last: Pose,
    before: Pose,
    offered: Pose,
    offered_cost: Float[Array | np.ndarray, "frames offers"],
    order: Int[Array | np.ndarray, " frames"],
    stack: Observed,
) -> _Way:
    """Fit each frame, in the given order, from the pose before or from its extrapolation, whichever is cheaper.

    One of the poses offered (axes ``frames offers``) replaces it if that is cheaper by more than the first of the
    `margins`, or by more than the second if it faces the other way.
    """

    def step(past: tuple[Pose, Pose], frame: tuple[Pose, Array, Array]) -> tuple[tuple[Pose, Pose], _Way]:
        (last, before), (offered, offered_cost, number) = past, frame
        seen = stack.of(number)
        starts = jax.tree.map(lambda *a: jnp.stack(a), last, _onwards(last, before))
        pose, cost = fit_one_of(body, objective, starts, seen, scales)
        turned = turned_round(left_of(offered), left_of(pose)[None])
        needed = offered_cost + jnp.where(turned, margins[1], margins[0])
        nearest = jnp.argmin(needed)
        switch = needed[nearest] < cost
        offered, offered_cost = jax.tree.map(lambda a: a[nearest], (offered, offered_cost))
        followed = pose
        pose = jax.tree.map(lambda new, old: jnp.where(switch, new, old), offered, pose)
        # After a switch, the velocity is zero.
        last = jax.tree.map(lambda new, old: jnp.where(switch, new, old), pose, last)
        return (pose, last), _Way(pose, jnp.where(switch, offered_cost, cost), followed)

    every = offered, jnp.asarray(offered_cost), jnp.asarray(order)
    return jax.lax.scan(step, (last, before), every)[1]


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


def last_place(model: Model, track: Track) -> Float[np.ndarray, "joints 3"]:
    """Joints of the last pose of a track (m)."""
    return places_of(model, jax.tree.map(lambda a: a[None], track.last))[0]


def places_of(model: Model, poses: Pose) -> Float[np.ndarray, "frames joints 3"]:
    """Joints of poses (m)."""
    return np.asarray(place_joints(model.skeleton, single_precision(poses))[0])
