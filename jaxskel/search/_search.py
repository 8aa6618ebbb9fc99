"""Pose search in single frames: fit hypotheses from the graph and from tables of limb poses to the silhouettes.

All hypotheses of all frames take the same number of steps, so that they can be batched.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from .._runtime.batching import length_of, on_device, take
from .._runtime.kinds import check_count, check_number
from .._runtime.steps import Steps, finished
from ..body import SEGMENT_NAMES, Pose, place_joints
from ..refinement.terms import GivenObjective, Observed, check_given, search_objective
from ._facing import both_ways, turned_starts
from ._fit import fit_scales, fitting, in_chunks
from ._hypotheses import Hypotheses, Pool, pool_of, select_distinct
from ._limb_proposals import BOTH, only, with_limbs
from ._limb_search import scores_limbs
from ._model import Model
from ._start_poses import other_ways

ARMS, _LEGS = ("l_arm", "r_arm"), ("l_leg", "r_leg")
_ARM_SEGMENTS = ("clavicle", "upper_arm", "forearm", "hand")
# A search is repeated only if it made the pose cheaper by more than this.
_GAIN = 1.0
# Cost threshold: 1.05 x typical + 8.
_DEAR = 1.05, 8.0
# A frame is searched again if it costs this much more than the cheapest frames. An offset, not a factor: poor masks
# raise the costs of some frames far more than of others, and then a high cost is no sign of a wrong pose.
_DOUBTFUL = 10.0
# Where the cheapest frames cost more than 40, because the subject wears or holds things, costs vary more.
_DOUBTFUL_SHARE = 0.25
# Arms are searched for again where a pose costs more than what is typical by this. In 384 frames of naked people and
# 384 in clothes (crowd p00 to p07, seed 4), 86 and 53 % of the poses cost less; searching again moved a hand in one.
_ENOUGH = 3.0
# A frame is searched again if it costs more than this, where it is not known what poses of the subject cost.
_DOUBTFUL_IF_UNKNOWN = 45.0
# The segments of the body without arms.
_TRUNK = np.array([i for i, name in enumerate(SEGMENT_NAMES) if name[2:] not in _ARM_SEGMENTS], np.int32)
# Poses per batch of the limb search. Larger batches need over 32 MB of temporary memory, which the system then
# allocates and frees each time.
_LIMBS_AT_ONCE = 4

_Propose = Callable[[Pose, Int[np.ndarray, " n"]], Pose]
"""Proposes other limbs for poses (axis ``n``) of the given frames; returns poses with axes ``n proposals``."""


class Search(eqx.Module):
    """What a search for poses minimises, its breadth and depth. Margins and costs are in the units of its objective.

    Attributes:
        objective: Fits every hypothesis and decides between them: an objective, whose terms are given the subject's
            body, or a function that makes one for it. Margins below are for costs like those of `volume_objective`.
        rough_steps: Steps of the first, rough fit of each start.
        starts: Starts kept after the rough fit.
        leg_steps: Steps of the fit of trunk and legs, without arms.
        trunks: Largest number of trunk-and-leg hypotheses kept half-way through `leg_steps`, and of those that get
            arms.
        trunk_margin: A trunk-and-leg hypothesis is kept if it costs at most this much more than the cheapest of its
            frame.
        margin: The same margin for hypotheses with all limbs.
        pairs: Pairs of limb poses that a search for two limbs proposes. Static: another number compiles again.
        singles: Limb poses that the search for a single arm proposes. Static: another number compiles again.
        steps: Steps of a fit with all limbs; only promising hypotheses take the second half of them.
        again: Largest number of times that each arm is removed and searched for again; stops when the cost no longer
            falls.
        enough: Arms of a pose that costs no more than this are not searched for again; at zero, all are. If None, it is
            3 more than poses of the subject typically cost, and zero while that is not known.
        doubtful: Above this cost the legs are searched for too, and then the search starts again from the fallback
            poses. If None, it is 10 more than the cheapest frames cost (a quarter more, if that is more), and 45 while
            that is not known.
        vague: Above this cost a pose that faces the other way is searched for too: silhouettes may not tell. Rendered
            people in clothes typically cost up to 24, a real child in wide clothes, who was turned round, 56.
    """

    objective: GivenObjective = search_objective
    rough_steps: int = 4
    starts: int = 4
    leg_steps: int = 10
    trunks: int = 2
    trunk_margin: float = 20.0
    margin: float = 10.0
    pairs: int = eqx.field(static=True, default=4)
    singles: int = eqx.field(static=True, default=4)
    steps: int = 8
    again: int = 2
    enough: float | None = None
    doubtful: float | None = None
    vague: float = 35.0

    def __check_init__(self):
        """Reject what is no objective, and numbers that make no sense."""
        check_given(self.objective)
        for name in ("rough_steps", "starts", "leg_steps", "trunks", "pairs", "singles", "steps"):
            check_count(name, getattr(self, name))
        check_count("again", self.again, 0)
        for name in ("trunk_margin", "margin", "vague"):
            check_number(name, getattr(self, name), 0.0, np.inf, "a cost, zero or more")
        for name, least in (("enough", 0.0), ("doubtful", -np.inf)):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), least, np.inf, "a cost, or None")

    def relative_to(self, low: float, typical: float) -> "Search":
        """The same search for a recording whose cheapest frames cost `low`, and others `typical`.

        What was given stays. Else arms are searched for again only where a pose costs more than is typical. Where a
        pose typically costs more than `vague`, each frame is searched as far as before, and for a pose that faces the
        other way too.
        """
        vague = typical > self.vague
        enough, doubtful = self.enough, self.doubtful
        if doubtful is None:
            doubtful = low + max(_DOUBTFUL, _DOUBTFUL_SHARE * low)
        # Where costs tell little, no pose is sure: of a real child, a film with fewer searches took front for back.
        if enough is None and not vague:
            enough = typical + _ENOUGH
        return replace(self, enough=enough, doubtful=doubtful, vague=0.0 if vague else self.vague)

    @property
    def enough_cost(self) -> float:
        """`enough`; zero if that is None."""
        return 0.0 if self.enough is None else self.enough

    @property
    def doubtful_cost(self) -> float:
        """`doubtful`; 45 if that is None."""
        return _DOUBTFUL_IF_UNKNOWN if self.doubtful is None else self.doubtful

    @property
    def most(self) -> int:
        """Largest number of hypotheses of a frame."""
        return self.trunks * self.pairs

    @property
    def looks_both_ways(self) -> bool:
        """Whether a pose that faces the other way is searched for in each frame."""
        return self.vague == 0

    def without_rivals(self) -> "Search":
        """The same search without poses that face the other way than the best."""
        return replace(self, vague=np.inf)


def cost_threshold(typical: float | None) -> float:
    """Cost that few frames of a recording exceed (1.05 x typical + 8); 45 if `typical` is unknown."""
    if typical is None:
        return _DOUBTFUL_IF_UNKNOWN
    return _DEAR[0] * typical + _DEAR[1]


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
        search: Breadth and depth of the search.
        starts: Poses to start from, with leading axes ``some starts``.
        fallback: Poses to start from if `starts` give no pose below `Search.doubtful`, with axes ``frames starts``. If
            these fail too, the best pose so far is turned to other directions (`other_ways`).
        observed: Outlines and silhouettes, with a leading axis ``frames``, see `on_device`.
        frames: Indices of the frames to search in; by default all.

    Returns:
        Poses (m, in the world) with axes ``some hypotheses``, the cheapest first; no two of a frame are alike. Where
        the cheapest costs more than `Search.vague`, one that faces the other way is among them.
    """
    return finished(solving(model, search, starts, fallback, observed, frames))


def solving(
    model: Model,
    search: Search,
    starts: Pose,
    fallback: Pose,
    observed: Observed,
    frames: Int[np.ndarray, " some"] | None = None,
) -> Steps[Hypotheses]:
    """As `solve_frames`, in steps."""
    frames = np.arange(len(fallback.root)) if frames is None else frames
    stack = on_device(observed)
    most = search.most

    def searched(starts: Pose, frames: Int[np.ndarray, " some"], wide: bool) -> Steps[Pool]:
        return (yield from _searched(model, search, pool_of(starts, frames), stack, wide)).distinct(most)

    def joints_found(frames: Int[np.ndarray, " some"]) -> Float[np.ndarray, "some joints 3"]:
        best = found.rows(frames, 1).best
        return np.asarray(place_joints(model.skeleton, on_device(best, length_of(stack)))[0])[: len(frames)]

    def around(frames: Int[np.ndarray, " some"]) -> Pose:
        return other_ways(joints_found(frames), model.skeleton)

    found = yield from searched(starts, frames, wide=False)
    for more in (lambda frames: take(fallback, frames), around):
        best = found.cheapest(1)
        doubtful = best.frame[best.cost > search.doubtful_cost]
        if len(doubtful):
            others = yield from searched(more(doubtful), doubtful, wide=True)
            found = found.joined(others).distinct(most)
    best = found.cheapest(1)
    vague = best.frame[best.cost > search.vague]
    if len(vague):
        others = yield from searched(turned_starts(joints_found(vague), model.skeleton), vague, wide=False)
        found = both_ways(found.joined(others), most)
    return found.rows(frames, most)


def _searched(model: Model, search: Search, starts: Pool, stack: Observed, wide: bool) -> Steps[Pool]:
    def again(found: Pool, frames: Int[np.ndarray, " some"], propose: _Propose) -> Steps[Pool]:
        """Propose other limbs for the best pose of some frames, fit the proposals, and keep the cheapest."""
        if len(frames) == 0 or not scores_limbs(model.objective):
            return found
        best = found.of(frames).cheapest(1)
        proposed = yield from _proposed(best, propose, stack)
        other = yield from _fitted(model, search, proposed, stack, (search.singles + 1) // 2, best)
        return found.joined(other).distinct(search.most)

    def single(number: int, poses: Pose, at: Int[np.ndarray, " n"]) -> Pose:
        return with_limbs(model, poses, at, stack, ARMS, only(number), search.singles)

    def settled(found: Pool) -> Steps[Pool]:
        """Fit the best pose of each frame further."""
        best = yield from fitting(
            model.body, model.objective, found.cheapest(1), stack, fit_scales((0.04, search.steps))
        )
        return best.joined(found).distinct(search.most)

    found = yield from settled((yield from _first_found(model, search, starts, stack, wide)))
    best = found.cheapest(1)
    frames = every = best.frame[best.cost > search.enough_cost]
    done, found = take(found, ~np.isin(found.frame, every)), found.of(every)
    for turn in range(search.again):
        before = found.cheapest(1).cost
        if turn == 1:
            doubtful = every[before > search.doubtful_cost]
            found = yield from again(found, doubtful, _pairs_of(_LEGS, model, search, stack))
        for number in range(len(ARMS)):
            found = yield from again(found, frames, partial(single, number))
        frames = every[found.cheapest(1).cost < before - _GAIN]
    return (yield from settled(found)).joined(done)


def _first_found(model: Model, search: Search, starts: Pool, stack: Observed, wide: bool) -> Steps[Pool]:
    """Fit the trunk, then the legs, then search for both arms at once; if `wide`, search for the legs before."""
    half = search.leg_steps // 2
    trunks = yield from fitting(model.armless, model.objective, starts, stack, fit_scales((0.08, search.rough_steps)))
    scored = scores_limbs(model.objective)
    if wide and scored:
        # Of every start: before the legs are right, the cost does not tell which trunk is.
        trunks = yield from _proposed(trunks, _pairs_of(_LEGS, model, search, stack), stack)
        trunks = yield from fitting(
            model.armless, model.objective, trunks, stack, fit_scales((0.08, search.rough_steps))
        )
    trunks = trunks.cheapest(search.starts)
    for scale, steps in ((0.08, half), (0.05, search.leg_steps - half)):
        trunks = yield from fitting(model.armless, model.objective, trunks, stack, fit_scales((scale, steps)))
        trunks = take(trunks, select_distinct(trunks, search.trunk_margin, search.trunks, _TRUNK))
    proposed = trunks
    if scored:
        proposed = yield from _proposed(trunks, _pairs_of(ARMS, model, search, stack), stack)
    return (yield from _fitted(model, search, proposed, stack, search.pairs))


def _fitted(
    model: Model, search: Search, pool: Pool, stack: Observed, count: int, known: Pool | None = None
) -> Steps[Pool]:
    """Fit hypotheses with all limbs; only the promising ones take the second half of the steps."""
    half = search.steps // 2
    rough = yield from fitting(model.body, model.objective, pool, stack, fit_scales((0.06, half)))
    chosen = select_distinct(rough, search.margin, count, known=known)
    scales = fit_scales((0.04, search.steps - half))
    fine = yield from fitting(model.body, model.objective, take(rough, chosen), stack, scales)
    return fine.joined(take(rough, ~chosen))


def _proposed(pool: Pool, propose: _Propose, stack: Observed) -> Steps[Pool]:
    """All proposals for each hypothesis of a pool, with costs not computed yet."""
    return pool_of((yield from in_chunks(propose, pool, (limbs_at_once(stack),))), pool.frame)


def limbs_at_once(stack: Observed) -> int:
    """Number of poses for which limbs are proposed at once."""
    return 1 if length_of(stack) == 1 else _LIMBS_AT_ONCE


def _pairs_of(limbs: tuple[str, str], model: Model, search: Search, stack: Observed) -> _Propose:
    return lambda poses, at: with_limbs(model, poses, at, stack, limbs, BOTH, search.pairs)
