"""The pose of a frame by search: hypotheses from the graph and from tables of limb poses, fitted to the hull, compared.

All hypotheses of all frames take the same steps.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int

from ._body import BALL_NAMES, LINKS, Body, limb_capsules, place_joints
from ._fits import fit_few, fit_scales, in_chunks
from ._hypotheses import Hypotheses, beside
from ._limb_search import Limb, best_pairs, best_single, score_limb, unexplained, with_limb
from ._limb_table import arm_table, leg_table
from ._skeleton import Pose, Skeleton
from ._stacks import padded, single_precision, taken
from ._starts import other_ways
from .terms import Objective, Observed, volume_objective

_ARMS, _LEGS = ("l_arm", "r_arm"), ("l_leg", "r_leg")
_LIMBS = _ARMS + _LEGS
# A search that makes a pose cheaper by no more than this is not repeated.
_GAIN = 1.0
# What is dear, relative to the typical cost: a share and an offset.
_DEAR = 1.05, 8.0
# What is worth another search costs so much more than the cheapest frames do: poor masks raise the costs of some frames
# far more than of others, and then a high cost tells little.
_DOUBTFUL = 10.0
# Limbs are looked for with one of so many rays.
_SOME = 3


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
        fallback: Poses to start from where these lead to nothing that is cheap, likewise. Where they do not either,
            what was found is turned to face other ways.
        observed: Fields and surfaces of the hulls, with a leading axis ``frames``.

    Returns:
        Poses with leading axes ``frames hypotheses``, the cheapest first.
    """
    seen = observed.seen_only()
    found = _searched(model, search, starts, seen)

    def around(frames: Int[np.ndarray, " some"]) -> Pose:
        best = padded(taken(found.best, frames), len(found.cost))
        return other_ways(np.asarray(place_joints(model.skeleton, best)[0])[: len(frames)], model.skeleton)

    for more in (lambda frames: taken(fallback, frames), around):
        doubtful = np.flatnonzero(found.cost[:, 0] > search.doubtful)
        if len(doubtful):
            other = _searched(model, search, more(doubtful), taken(seen, doubtful))
            found = found.merged(other, doubtful)
    return found


def _searched(model: Model, search: Search, starts: Pose, observed: Observed) -> Hypotheses:
    def again(
        found: Hypotheses, frames: Int[np.ndarray, " some"], freed: Callable[[Pose, Observed], Pose]
    ) -> Hypotheses:
        """Free limbs of the best pose of some frames, fit what is proposed for them, and keep what is cheaper."""
        if len(frames) == 0:
            return found
        other = in_chunks(
            lambda poses, part: _fitted_by_halves(model, search, freed(poses, part), part),
            taken(found.first(1), frames), taken(observed, frames),
        )  # fmt: skip
        return found.merged(other, frames)

    found = in_chunks(lambda starts, part: _first_found(model, search, starts, part), starts, observed)
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
        trunks = fit_few(model.trunk, model.skeleton, trunks, observed, fit_scales((scale, steps))).first(count)
    return _fitted_by_halves(model, search, _with_pairs(model, trunks, observed, _ARMS, search.pairs), observed)


def _fitted_by_halves(model: Model, search: Search, poses: Pose, observed: Observed) -> Hypotheses:
    """Fit hypotheses of all limbs; the cheaper half takes all steps, the others stay where they are half-way."""
    half = search.steps // 2
    rough = fit_few(model.objective, model.skeleton, poses, observed, fit_scales((0.06, half)))
    count = (rough.cost.shape[1] + 1) // 2
    scales = fit_scales((0.04, search.steps - half))
    found = beside([fit_few(model.objective, model.skeleton, rough.first(count), observed, scales), rough.last(count)])
    return found.ordered(np.argsort(found.cost, 1, kind="stable"))


@eqx.filter_jit
def _with_pairs(model: Model, poses: Pose, observed: Observed, names: tuple[str, str], count: int) -> Pose:
    """Free two limbs of each pose (axes ``frames poses``) and give them their best pairs (``frames poses*count``)."""
    limbs = tuple(model.limbs[name] for name in names)

    def one(pose: Pose, observed: Observed) -> Pose:
        some = observed.thinned(_SOME)
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
        limb, some = model.limbs[name], observed.thinned(_SOME)
        points, costs = unexplained(model.body, pose, model.objective, some, (name,))
        scored = score_limb(model.body, pose, model.objective, some, limb, points, costs)
        return jax.vmap(lambda index: with_limb(pose, limb, index))(best_single(scored, count))

    return jax.vmap(one)(jax.tree.map(lambda a: jnp.asarray(a[:, 0]), poses), observed)
