"""The pose of a frame by search: hypotheses from the graph and from tables of limb poses, fitted to the hull, compared.

All hypotheses of all frames take the same steps.
"""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Int

from .._runtime.batching import on_device, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import BALL_NAMES, LINKS, SEGMENT_NAMES, Body, Pose, Skeleton, limb_capsules, place_joints
from ..refinement.terms import Objective, Observed, volume_objective
from ._fit import fit_pool, fit_scales, in_chunks
from ._hypotheses import Hypotheses, Pool, pool_of, select_distinct
from ._limb_search import Limb, best_pairs, best_single, score_limb, unexplained, with_limb
from ._limb_tables import arm_table, leg_table
from ._start_poses import other_ways

_ARMS, _LEGS = ("l_arm", "r_arm"), ("l_leg", "r_leg")
_LIMBS = _ARMS + _LEGS
_ARM_SEGMENTS = ("clavicle", "upper_arm", "forearm", "hand")
# A search that makes a pose cheaper by no more than this is not repeated.
_GAIN = 1.0
# What is dear, relative to the typical cost: a share and an offset.
_DEAR = 1.05, 8.0
# What is worth another search costs so much more than the cheapest frames do: poor masks raise the costs of some frames
# far more than of others, and then a high cost tells little.
_DOUBTFUL = 10.0
# The segments that a body without arms has.
_TRUNK = np.array([i for i, name in enumerate(SEGMENT_NAMES) if name[2:] not in _ARM_SEGMENTS], np.int32)
# Limbs are looked for with one of so many rays.
_SOME = 3
# Poses that limbs are searched for at once. What more of them need meanwhile (over 32 MB) is asked from the system each
# time, and given back.
_LIMBS_AT_ONCE = 4

_Propose = Callable[[Pose, Array], Pose]
"""Gives poses (axis ``n``) of some frames other limbs (axes ``n proposals``)."""


class Search(eqx.Module):
    """How broad and how deep to search."""

    rough_steps: int = 4
    """Steps of a first look at the starts."""
    starts: int = 4
    """Starts that go on after the first look."""
    leg_steps: int = 10
    """Steps of the fit of trunk and legs."""
    trunks: int = 2
    """Trunks with legs that go on after half of these, and that arms are searched for, at most."""
    trunk_margin: float = 20.0
    """A trunk with legs goes on as long as it costs no more than the cheapest one and this."""
    margin: float = 10.0
    """The same for hypotheses of all limbs."""
    pairs: int = eqx.field(static=True, default=4)
    """Pairs of limbs that a search proposes. Static: another number compiles again."""
    singles: int = eqx.field(static=True, default=4)
    """Poses that the search for a single arm proposes. Static likewise."""
    steps: int = 8
    """Steps of a fit with all limbs; after half of them only the promising hypotheses go on."""
    again: int = 2
    """How often each arm is freed and searched for again, as long as that makes the pose cheaper."""
    doubtful: float = 45.0
    """Where a pose costs more than this, the legs are searched for too, and then everything from the fallback."""

    def relative_to(self, low: float | None) -> "Search":
        """The same search, where it is known what the cheapest frames of this recording cost."""
        return self if low is None else eqx.tree_at(lambda s: s.doubtful, self, low + _DOUBTFUL)


def cost_threshold(typical: float | None) -> float:
    """What a frame hardly ever costs where it typically costs so much."""
    if typical is None:
        return Search().doubtful
    return _DEAR[0] * typical + _DEAR[1]


class Model(eqx.Module):
    """What is known about the subject, ready for the search."""

    body: Body
    armless: Body
    """The body without arms."""
    limbs: dict[str, Limb]

    @property
    def objective(self) -> Objective:
        """What a pose of the body costs."""
        return volume_objective(self.body)

    @property
    def skeleton(self) -> Skeleton:
        """Of the body."""
        return self.body.skeleton


def make_model(body: Body) -> Model:
    """Prepare a subject for the search."""
    body = single_precision(body)
    # The arms' balls are still there, for terms that look at them, but far thinner than nothing: they touch nothing.
    arms = limb_capsules("l_arm", "r_arm")
    balls = np.isin(np.arange(len(BALL_NAMES)), np.setdiff1d(LINKS[arms], LINKS[~arms]))
    radii = np.where(balls, -9, body.radii)
    armless = Body(body.skeleton, body.segments, np.asarray(body.offsets), radii, LINKS[~arms])
    limbs = {name: Limb(name, (arm_table if name in _ARMS else leg_table)(body.skeleton, name[0])) for name in _LIMBS}
    return Model(body, single_precision(armless), limbs)


def solve_frames(
    model: Model,
    search: Search,
    starts: Pose,
    fallback: Pose,
    observed: Observed,
    frames: Int[np.ndarray, " some"] | None = None,
) -> Hypotheses:
    """Search for the poses of some frames, each by itself.

    Args:
        model: The subject.
        search: How broad and how deep.
        starts: Poses to start from, with leading axes ``some starts``.
        fallback: Poses to start from where these lead to nothing that is cheap, with axes ``frames starts``. Where they
            do not either, what was found is turned to face other ways.
        observed: Outlines and silhouettes, with a leading axis ``frames``, see `on_device`.
        frames: Of these, the ones to search in; by default all.

    Returns:
        Poses of the frames searched in, with axes ``some hypotheses``, the cheapest first.
    """
    frames = np.arange(len(fallback.root)) if frames is None else frames
    stack = on_device(observed)
    most = search.trunks * search.pairs

    def searched(starts: Pose, frames: Int[np.ndarray, " some"]) -> Pool:
        return _searched(model, search, pool_of(starts, frames), stack).cheapest(most)

    def around(frames: Int[np.ndarray, " some"]) -> Pose:
        best = found.rows(frames, 1).best
        joints = np.asarray(place_joints(model.skeleton, on_device(best))[0])
        return other_ways(joints[: len(frames)], model.skeleton)

    found = searched(starts, frames)
    for more in (lambda frames: take(fallback, frames), around):
        best = found.cheapest(1)
        doubtful = best.frame[best.cost > search.doubtful]
        if len(doubtful):
            found = found.joined(searched(more(doubtful), doubtful)).cheapest(most)
    return found.rows(frames, most)


def _searched(model: Model, search: Search, starts: Pool, stack: Observed) -> Pool:
    def again(found: Pool, frames: Int[np.ndarray, " some"], propose: _Propose) -> Pool:
        """Free limbs of the best pose of some frames, fit what is proposed for them, and keep what is cheaper."""
        if len(frames) == 0:
            return found
        best = found.of(frames).cheapest(1)
        proposed = _proposed(best, propose)
        other = _fitted(model, search, proposed, stack, (search.singles + 1) // 2, best)
        return found.joined(other).cheapest(search.trunks * search.pairs)

    def single(limb: str, poses: Pose, at: Int[Array, " n"]) -> Pose:
        return _with_single(model, poses, at, stack, limb, search.singles)

    def settled(found: Pool) -> Pool:
        """The best pose of each frame takes more steps."""
        best = fit_pool(model.body, found.cheapest(1), stack, fit_scales((0.04, search.steps)))
        return best.joined(found).cheapest(search.trunks * search.pairs)

    found = settled(_first_found(model, search, starts, stack))
    frames = every = np.unique(found.frame)
    for turn in range(search.again):
        before = found.cheapest(1).cost
        if turn == 1:
            doubtful = every[before > search.doubtful]
            found = again(found, doubtful, lambda poses, at: _with_pairs(model, poses, at, stack, _LEGS, search.pairs))
        for limb in _ARMS:
            found = again(found, frames, partial(single, limb))
        frames = every[found.cheapest(1).cost < before - _GAIN]
    return settled(found)


def _first_found(model: Model, search: Search, starts: Pool, stack: Observed) -> Pool:
    """Trunk, legs, then both arms at once."""
    half = search.leg_steps // 2
    trunks = fit_pool(model.armless, starts, stack, fit_scales((0.08, search.rough_steps))).cheapest(search.starts)
    for scale, steps in ((0.08, half), (0.05, search.leg_steps - half)):
        trunks = fit_pool(model.armless, trunks, stack, fit_scales((scale, steps)))
        trunks = take(trunks, select_distinct(trunks, search.trunk_margin, search.trunks, _TRUNK))
    pairs = _proposed(trunks, lambda poses, at: _with_pairs(model, poses, at, stack, _ARMS, search.pairs))
    return _fitted(model, search, pairs, stack, search.pairs)


def _fitted(model: Model, search: Search, pool: Pool, stack: Observed, count: int, known: Pool | None = None) -> Pool:
    """Fit hypotheses of all limbs; a few promising ones take all steps, the others stay where they are half-way."""
    half = search.steps // 2
    rough = fit_pool(model.body, pool, stack, fit_scales((0.06, half)))
    chosen = select_distinct(rough, search.margin, count, known=known)
    scales = fit_scales((0.04, search.steps - half))
    return fit_pool(model.body, take(rough, chosen), stack, scales).joined(take(rough, ~chosen))


def _proposed(pool: Pool, propose: _Propose) -> Pool:
    """All that is proposed for each hypothesis of a pool."""
    return pool_of(in_chunks(propose, pool, _LIMBS_AT_ONCE), pool.frame)


@cached_jit
def _with_pairs(
    model: Model, poses: Pose, frames: Int[Array, " n"], stack: Observed, names: tuple[str, str], count: int
) -> Pose:
    """Free two limbs of each pose and give them their best pairs (axes ``n count``)."""
    limbs = tuple(model.limbs[name] for name in names)

    def one(pose: Pose, frame: Int[Array, ""]) -> Pose:
        some = stack.of(frame).thinned(_SOME)
        points, costs = unexplained(model.body, pose, model.objective, some, names)
        left, right = (score_limb(model.body, pose, model.objective, some, limb, points, costs) for limb in limbs)
        first, second = best_pairs(left, right, count)
        return jax.vmap(lambda i, j: with_limb(with_limb(pose, limbs[0], i), limbs[1], j))(first, second)

    return jax.vmap(one)(poses, frames)


@cached_jit
def _with_single(model: Model, poses: Pose, frames: Int[Array, " n"], stack: Observed, name: str, count: int) -> Pose:
    """Free one limb of each pose and give it its best poses (axes ``n count``)."""

    def one(pose: Pose, frame: Int[Array, ""]) -> Pose:
        limb, some = model.limbs[name], stack.of(frame).thinned(_SOME)
        points, costs = unexplained(model.body, pose, model.objective, some, (name,))
        scored = score_limb(model.body, pose, model.objective, some, limb, points, costs)
        return jax.vmap(lambda index: with_limb(pose, limb, index))(best_single(scored, count))

    return jax.vmap(one)(poses, frames)
