"""The pose of a frame by search: hypotheses from the graph and from tables of limb poses, fitted to the hull, compared.

All hypotheses of all frames take the same steps.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ._body import BALL_NAMES, LINKS, Body, capsule_ends, limb_capsules
from ._capsules import nearest_to_rays
from ._contours import Contours
from ._descend import descend
from ._limb_search import Limb, best_pairs, best_single, score_limb, unexplained, with_limb
from ._limb_table import arm_table, leg_table
from ._skeleton import Pose, Skeleton
from ._stacks import single_precision, taken
from .parametrisations import HingedLimbs
from .terms import Objective, Observed, place, volume_objective

_HINGED = HingedLimbs()
_ARMS, _LEGS = ("l_arm", "r_arm"), ("l_leg", "r_leg")
_LIMBS = _ARMS + _LEGS
_MOST_STEPS = 16  # of one fit
# Shapes are fixed whatever the search: frames, and hypotheses of each, that are fitted at once.
_FRAMES, _AT_ONCE = 8, 2
# A search that makes a pose cheaper by no more than this is not repeated.
_GAIN = 1.0
# An outline no farther from the body than this may be its own (m).
_NEAR = 0.04
# What is dear, relative to the typical cost: a share and an offset.
_DEAR = 1.05, 8.0
# What is worth another search costs so much more than the cheapest frames do: poor masks raise the costs of some frames
# far more than of others, and then a high cost tells little.
_DOUBTFUL = 10.0
# Steps look at one of so many rays, and limbs are looked for with one of so many; what a pose costs is told by all.
_FEW, _SOME = 9, 3


class Search(eqx.Module):
    """How broad and how deep to search."""

    rough_steps: int = 4
    """Steps of a first look at the starts."""
    starts: int = 4
    """Starts that go on after the first look."""
    leg_steps: int = 10
    """Steps of the fit of trunk and legs."""
    trunks: int = 2
    """Trunks with legs that go on after half of these, and that arms are searched for."""
    pairs: int = eqx.field(static=True, default=4)
    """Pairs of limbs that a search proposes. Static: another number compiles again."""
    singles: int = eqx.field(static=True, default=4)
    """Poses that the search for a single arm proposes. Static likewise."""
    steps: int = 8
    """Steps of a fit with all limbs; after half of them only half of the hypotheses go on."""
    again: int = 2
    """How often each arm is freed and searched for again, as long as that makes the pose cheaper."""
    doubtful: float = 45.0
    """Where a pose costs more than this, the legs are searched for too, and then everything from the fallback."""

    def relative_to(self, low: float | None) -> "Search":
        """The same search, where it is known what the cheapest frames of this recording cost."""
        return self if low is None else eqx.tree_at(lambda s: s.doubtful, self, low + _DOUBTFUL)


def dear(typical: float | None) -> float:
    """What a frame hardly ever costs where it typically costs so much."""
    if typical is None:
        return Search().doubtful
    return _DEAR[0] * typical + _DEAR[1]


class Model(eqx.Module):
    """What is known about the subject, ready for the search."""

    body: Body
    objective: Objective
    trunk: Objective
    """Of the body without arms."""
    limbs: dict[str, Limb]

    @property
    def skeleton(self) -> Skeleton:
        """Of the body."""
        return self.body.skeleton


class Hypotheses(eqx.Module):
    """Poses of some frames, the cheapest of each first."""

    poses: Pose
    """Axes ``frames hypotheses``."""
    cost: Float[np.ndarray, "frames hypotheses"]

    @property
    def best(self) -> Pose:
        """The cheapest of each frame, without the axis of hypotheses."""
        return jax.tree.map(lambda a: a[:, 0], self.poses)

    def first(self, count: int) -> Pose:
        """The cheapest few of each frame."""
        return jax.tree.map(lambda a: a[:, :count], self.poses)

    def last(self, count: int) -> "Hypotheses":
        """All of each frame but the cheapest few."""
        return jax.tree.map(lambda a: a[:, count:], self)

    def merged(self, other: "Hypotheses", frames: Int[np.ndarray, " some"]) -> "Hypotheses":
        """As many hypotheses as before, in some frames the cheapest of these and of `other`, which is of those only."""
        both = _beside([taken(self, frames), other])
        best = both.ordered(np.argsort(both.cost, 1, kind="stable")[:, : self.cost.shape[1]])

        def put(old: np.ndarray, new: np.ndarray) -> np.ndarray:
            old = old.copy()
            old[frames] = new
            return old

        return jax.tree.map(put, self, best)

    def ordered(self, order: Int[np.ndarray, "frames some"]) -> "Hypotheses":
        """Some of each frame's hypotheses, in an order of its own."""
        rows = np.arange(len(order))[:, None]
        return jax.tree.map(lambda a: a[rows, order], self)


def make_model(body: Body) -> Model:
    """Prepare a subject for the search."""
    body = single_precision(body)
    # Arms far thinner than nothing are nearest to no point and stick out of no hull: the same shapes with and without.
    arms = limb_capsules("l_arm", "r_arm")
    balls = np.setdiff1d(LINKS[arms], LINKS[~arms])
    armless = eqx.tree_at(lambda b: b.radii, body, np.where(np.isin(np.arange(len(BALL_NAMES)), balls), -9, body.radii))
    limbs = {name: Limb(name, (arm_table if name in _ARMS else leg_table)(body.skeleton, name[0])) for name in _LIMBS}
    return Model(body, volume_objective(body), volume_objective(single_precision(armless)), limbs)


def solve_frames(model: Model, search: Search, starts: Pose, fallback: Pose, observed: Observed) -> Hypotheses:
    """Search for the poses of some frames, each by itself.

    Args:
        model: The subject.
        search: How broad and how deep.
        starts: Poses to start from, with leading axes ``frames starts``.
        fallback: Poses to start from where these lead to nothing that is cheap, likewise.
        observed: Fields and surfaces of the hulls, with a leading axis ``frames``.

    Returns:
        Poses with leading axes ``frames hypotheses``, the cheapest first.
    """
    seen = lean(observed)
    found = _searched(model, search, starts, seen)
    doubtful = np.flatnonzero(found.cost[:, 0] > search.doubtful)
    if len(doubtful):
        other = _searched(model, search, taken(fallback, doubtful), taken(seen, doubtful))
        found = found.merged(other, doubtful)
    return found


def lean(observed: Observed) -> Observed:
    """Without what the search does not look at: the fields of hulls are large."""
    graph = observed.paths, observed.found, observed.neck, observed.pelvis
    return Observed(*graph, None, None, observed.contours, observed.silhouettes)


def fit_poses(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed, scales: tuple[Array, Array]
) -> Hypotheses:
    """Let hypotheses (axes ``frames hypotheses``) descend and order them by their cost.

    `scales` comes from [`fit_scales`][]; other steps do not compile again, nor do other numbers of frames.
    """
    return _in_chunks(lambda poses, observed: _fit(objective, skeleton, poses, observed, scales), poses, observed)


def fit_scales(*rounds: tuple[float, int]) -> tuple[Array, Array]:
    """Robust scales (m) and numbers of steps for them, as `fit_poses` takes them."""
    values = np.concatenate([np.full(steps, scale, np.float32) for scale, steps in rounds])
    return jnp.asarray(np.resize(values, _MOST_STEPS)), jnp.asarray(len(values), jnp.int32)


def _searched(model: Model, search: Search, starts: Pose, observed: Observed) -> Hypotheses:
    def again(
        found: Hypotheses, frames: Int[np.ndarray, " some"], freed: Callable[[Pose, Observed], Pose]
    ) -> Hypotheses:
        """Free limbs of the best pose of some frames, fit what is proposed for them, and keep what is cheaper."""
        if len(frames) == 0:
            return found
        other = _in_chunks(
            lambda poses, part: _fitted_by_halves(model, search, freed(poses, part), part),
            taken(found.first(1), frames), taken(observed, frames),
        )  # fmt: skip
        return found.merged(other, frames)

    found = _in_chunks(lambda starts, part: _first_found(model, search, starts, part), starts, observed)
    frames = np.arange(len(found.cost))
    for turn in range(search.again):
        before = found.cost[:, 0].copy()
        if turn == 1:
            doubtful = np.flatnonzero(before > search.doubtful)
            found = again(found, doubtful, lambda poses, part: _with_pairs(model, poses, part, _LEGS, search.pairs))
        for limb in _ARMS:
            found = again(
                found, frames, lambda poses, part, limb=limb: _with_single(model, poses, part, limb, search.singles)
            )
        frames = np.flatnonzero(found.cost[:, 0] < before - _GAIN)
    return found


def _first_found(model: Model, search: Search, starts: Pose, observed: Observed) -> Hypotheses:
    """Trunk, legs, then both arms at once."""
    half = search.leg_steps // 2
    trunks = starts
    for scale, steps, count in (
        (0.08, search.rough_steps, search.starts),
        (0.08, half, search.trunks),
        (0.05, search.leg_steps - half, search.trunks),
    ):
        trunks = _fit(model.trunk, model.skeleton, trunks, observed, fit_scales((scale, steps))).first(count)
    return _fitted_by_halves(model, search, _with_pairs(model, trunks, observed, _ARMS, search.pairs), observed)


def _fitted_by_halves(model: Model, search: Search, poses: Pose, observed: Observed) -> Hypotheses:
    """Fit hypotheses of all limbs; the cheaper half takes all steps, the others stay where they are half-way."""
    half = search.steps // 2
    rough = _fit(model.objective, model.skeleton, poses, observed, fit_scales((0.06, half)))
    count = (rough.cost.shape[1] + 1) // 2
    scales = fit_scales((0.04, search.steps - half))
    found = _beside([_fit(model.objective, model.skeleton, rough.first(count), observed, scales), rough.last(count)])
    return found.ordered(np.argsort(found.cost, 1, kind="stable"))


def _fit(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed, scales: tuple[Array, Array]
) -> Hypotheses:
    """Fit a few hypotheses at a time, so that any number of them has the same shapes."""
    parts = []
    for start in range(0, poses.root.shape[1], _AT_ONCE):
        part = jax.tree.map(lambda a, s=start: np.asarray(a)[:, s : s + _AT_ONCE], poses)
        count = part.root.shape[1]
        part = jax.tree.map(lambda a, n=count: a[:, np.minimum(np.arange(_AT_ONCE), n - 1)], part)
        fitted, cost = jax.tree.map(np.asarray, _fitted(objective, skeleton, part, observed, scales))
        parts.append(jax.tree.map(lambda a, n=count: a[:, :n], Hypotheses(fitted, cost)))
    found = _beside(parts)
    return found.ordered(np.argsort(found.cost, 1, kind="stable"))


def fit_hypothesis(
    objective: Objective, skeleton: Skeleton, pose: Pose, observed: Observed, scales: tuple[Array, Array]
) -> tuple[Pose, Float[Array, ""]]:
    """Let one hypothesis of one frame descend; also what it costs then, infinite where that is no number."""
    few = _thinned(observed, _FEW)

    def step(number: Array, pose: Pose) -> Pose:
        scaled = eqx.tree_at(lambda o: o.terms["contours"].scale, objective, scales[0][number])
        return descend(scaled, _HINGED, skeleton, pose, few)

    pose = jax.lax.fori_loop(0, scales[1], step, pose)
    cost = sum(objective.costs(place(skeleton, pose), observed).values(), jnp.zeros(()))
    return pose, jnp.where(jnp.isfinite(cost), cost, jnp.inf)


@eqx.filter_jit
def unexplained_shares(body: Body, poses: Pose, contours: Contours) -> Float[Array, " frames"]:
    """Share of each frame's outlines that lie outside of the body, and not near it."""

    def share(pose: Pose, contours: Contours) -> Array:
        placed = place(body.skeleton, pose)
        ends = jnp.asarray(capsule_ends(body, placed.origins, placed.rotations))
        radii = jnp.asarray(body.radii)[body.links]
        near = nearest_to_rays(jnp.asarray(contours.centres), jnp.asarray(contours.directions), ends, radii)
        return (near.distance > _NEAR).mean()

    return jax.vmap(share)(poses, contours)


@eqx.filter_jit
def _fitted(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed, scales: tuple[Array, Array]
) -> tuple[Pose, Float[Array, "frames hypotheses"]]:
    def fit(pose: Pose, observed: Observed) -> tuple[Pose, Array]:
        return fit_hypothesis(objective, skeleton, pose, observed, scales)

    single = jax.tree.map(jnp.asarray, poses)
    return jax.vmap(lambda poses, frame: jax.vmap(lambda pose: fit(pose, frame))(poses))(single, observed)


@eqx.filter_jit
def _with_pairs(model: Model, poses: Pose, observed: Observed, names: tuple[str, str], count: int) -> Pose:
    """Free two limbs of each pose (axes ``frames poses``) and give them their best pairs (``frames poses*count``)."""
    limbs = tuple(model.limbs[name] for name in names)

    def one(pose: Pose, observed: Observed) -> Pose:
        some = _thinned(observed, _SOME)
        points, costs = unexplained(model.body, pose, model.objective, some, names)
        left, right = (score_limb(model.body, pose, model.objective, some, limb, points, costs) for limb in limbs)
        first, second = best_pairs(left, right, count)
        return jax.vmap(lambda i, j: with_limb(with_limb(pose, limbs[0], i), limbs[1], j))(first, second)

    single = jax.tree.map(jnp.asarray, poses)
    found = jax.vmap(lambda poses, frame: jax.vmap(lambda pose: one(pose, frame))(poses))(single, observed)
    return jax.tree.map(lambda a: a.reshape(a.shape[0], -1, *a.shape[3:]), found)


@eqx.filter_jit
def _with_single(model: Model, poses: Pose, observed: Observed, name: str, count: int) -> Pose:
    """Free one limb of each pose (axes ``frames 1``) and give it its best poses (axes ``frames count``)."""

    def one(pose: Pose, observed: Observed) -> Pose:
        limb, some = model.limbs[name], _thinned(observed, _SOME)
        points, costs = unexplained(model.body, pose, model.objective, some, (name,))
        scored = score_limb(model.body, pose, model.objective, some, limb, points, costs)
        return jax.vmap(lambda index: with_limb(pose, limb, index))(best_single(scored, count))

    return jax.vmap(one)(jax.tree.map(lambda a: jnp.asarray(a[:, 0]), poses), observed)


def _in_chunks(work: Callable[[Any, Observed], Hypotheses], poses: Any, observed: Observed) -> Hypotheses:
    """Work on a fixed number of frames at a time, the last ones filled up with a frame that is there already."""
    count = len(observed.neck)
    done = []
    for start in range(0, count, _FRAMES):
        frames = np.minimum(np.arange(start, start + _FRAMES), count - 1)
        # On the device once, not with each of many calls: silhouettes are large.
        done.append(work(*jax.device_put(single_precision(taken((poses, observed), frames)))))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *done)


def _thinned(observed: Observed, factor: int) -> Observed:
    assert observed.contours is not None
    return eqx.tree_at(lambda o: o.contours, observed, observed.contours.thinned(factor))


def _beside(parts: list[Hypotheses]) -> Hypotheses:
    return jax.tree.map(lambda *a: np.concatenate(a, 1), *parts)
