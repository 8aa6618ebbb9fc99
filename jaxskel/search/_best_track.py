"""One track through some frames: followed forwards and, in doubt, backwards; the cheaper way in each frame."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._runtime.batching import length_of, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import Pose, place_joints
from ..refinement.terms import Observed
from ._cheapest_path import apart, cheapest_path, jump_costs
from ._facing import left_of, turned_round
from ._fit import Scales, fit_hypothesis, fit_scales
from ._hypotheses import Hypotheses, Pool
from ._model import Model
from ._track_state import Track, Tracking

# Poses offered in each frame: that of a search, and one that faces the other way.
_OFFERS = 2


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
        The tracks forwards and backwards, the chosen one first. A track that meets all that is offered is not followed
        backwards, and its second hypothesis is the first at infinite cost: 17 of 21 stacks of eight films met, and the
        mean error of these films was 13.8 mm with and without going back. In a stack of one frame, one hypothesis.
    """
    count = len(np.unique(offers.frame))
    two = offers.rows(np.arange(count), _OFFERS)
    first = jax.tree.map(lambda a: a[0], two.best)
    last, before = (first, first) if track is None else (track.last, track.before)
    length = length_of(stack)
    frames = np.minimum(np.arange(length), count - 1)
    scales = follow_scales(tracking)

    def follow(order: Int[np.ndarray, " frames"], last: Pose, before: Pose) -> tuple[Pose, np.ndarray]:
        margins = jnp.asarray([tracking.margin, tracking.turn_margin], jnp.float32)
        number = jnp.asarray(order, jnp.int32)
        last, before = single_precision((last, before))
        poses, cost = single_precision(take((two.poses, two.cost), order))
        found = _follow(model, margins, scales, last, before, poses, cost, number, stack)
        return jax.tree.map(lambda a: np.asarray(a)[:count], found)

    forwards, cost = follow(frames, last, before)
    if length == 1:
        return Hypotheses(jax.tree.map(lambda a: a[:, None], forwards), cost[:, None])
    places = places_of(model, forwards)
    if not (np.isfinite(two.cost[:, 0]) & apart(places, places_of(model, two.best))).any():
        twice = jax.tree.map(lambda a: np.stack([a, a], 1), forwards)
        return Hypotheses(twice, np.stack([cost, np.full_like(cost, np.inf)], 1))
    end = jax.tree.map(lambda a: a[-1], forwards)
    back = np.maximum(np.arange(count - 1, count - 1 - length, -1), 0)
    backwards, other = jax.tree.map(lambda a: a[::-1], follow(back, end, end))
    both = Hypotheses(jax.tree.map(lambda a, b: np.stack([a, b], 1), forwards, backwards), np.stack([cost, other], 1))
    places = np.stack([places, places_of(model, backwards)], 1)
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
    far = np.linalg.norm(places[0] - last_place(model, track), axis=-1).max(-1)
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
    offered_cost: Float[Array, "frames offers"],
    order: Int[Array, " frames"],
    stack: Observed,
) -> tuple[Pose, Float[Array, " frames"]]:
    """Fit each frame, in the given order, from the pose before and from its extrapolation; keep the cheaper result.

    One of the poses offered (axes ``frames offers``) replaces it if that is cheaper by more than the first of the
    `margins`, or by more than the second if it faces the other way.
    """

    def step(past: tuple[Pose, Pose], frame: tuple[Pose, Array, Array]) -> tuple[tuple[Pose, Pose], tuple[Pose, Array]]:
        (last, before), (offered, offered_cost, number) = past, frame
        seen = stack.of(number)
        hypotheses = jax.tree.map(lambda *a: jnp.stack(a), last, _onwards(last, before))
        poses, cost = jax.vmap(lambda pose: fit_hypothesis(model.body, model.objective, pose, seen, scales))(hypotheses)
        best = jnp.argmin(cost)
        pose, cost = jax.tree.map(lambda a: a[best], (poses, cost))
        turned = turned_round(left_of(offered), left_of(pose)[None])
        needed = offered_cost + jnp.where(turned, margins[1], margins[0])
        nearest = jnp.argmin(needed)
        switch = needed[nearest] < cost
        offered, offered_cost = jax.tree.map(lambda a: a[nearest], (offered, offered_cost))
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


def last_place(model: Model, track: Track) -> Float[np.ndarray, "joints 3"]:
    """Joints of the last pose of a track (m)."""
    return places_of(model, jax.tree.map(lambda a: a[None], track.last))[0]


def places_of(model: Model, poses: Pose) -> Float[np.ndarray, "frames joints 3"]:
    """Joints of poses (m)."""
    return np.asarray(place_joints(model.skeleton, single_precision(poses))[0])
