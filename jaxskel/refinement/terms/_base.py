"""Base classes of the terms: the placed body, the observed frame, the weighted objective."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from ..._runtime.kinds import check_number, told
from ...body import HUMAN_15, Body, Pose, Skeleton, SkeletonTemplate, place_segments
from ...outlines import Contours, SilhouetteDistances
from ._definitions import as_first_defined


class PlacedBody(eqx.Module):
    """Skeleton of one frame, placed in the world.

    Attributes:
        joints: (m)
        tips: (m)
        rotations: Rotation of each segment from the body frame at rest to the world.
        origins: Pivot that each segment turns about (m).
        template: What the skeleton consists of.
    """

    joints: Float[Array, "joints 3"]
    tips: Float[Array, "tips 3"]
    rotations: Float[Array, "segments 3 3"]
    origins: Float[Array, "segments 3"]
    template: SkeletonTemplate = eqx.field(static=True, default=HUMAN_15)


class Observed(eqx.Module):
    """Observations of one frame or of a batch: the labelled skeletal graph and the outlines, in the world (m).

    Attributes:
        paths: Graph paths from the root to the end node of each of the template's tips, sampled at equal distances (m).
        found: Whether an end node was found for each label.
        inner: Nodes of the template's inner joints, such as pelvis and neck (m).
        contours: Viewing rays through the outlines of the silhouettes.
        silhouettes: Signed distance to each silhouette (m).
        data: What else is known of each frame, by names of your own, see `with_data`.
    """

    paths: Float[Array | np.ndarray, "*frames labels points 3"]
    found: Bool[Array | np.ndarray, "*frames labels"]
    inner: Float[Array | np.ndarray, "*frames inner 3"]
    contours: Contours | None = None
    silhouettes: SilhouetteDistances | None = None
    data: dict[str, Float[Array | np.ndarray, "..."]] = eqx.field(default_factory=dict)

    def with_data(self, /, **data: Any) -> "Observed":
        """The same with more data, for terms of your own: arrays with the frames axis first, NaN where missing.

        Raises:
            ValueError: An array has not one row for each frame.
        """
        found = {name: jnp.asarray(array, jnp.result_type(float)) for name, array in data.items()}
        frames = self.inner.shape[:-2]
        for name, array in found.items():
            if array.shape[: len(frames)] != frames:
                raise ValueError(
                    f"{name}: has shape {array.shape}, but there are {frames[0]} frames; give one row for each frame"
                )
        return replace(self, data=self.data | found)

    def of(self, frame: Int[Array, ""]) -> "Observed":
        """One frame of a stack on the device, without copying its silhouettes."""
        rest = eqx.tree_at(lambda o: o.silhouettes, self, None, is_leaf=lambda leaf: leaf is None)
        one = jax.tree.map(lambda a: a[frame], rest)
        found = None if self.silhouettes is None else self.silhouettes.of(frame)
        return eqx.tree_at(lambda o: o.silhouettes, one, found, is_leaf=lambda leaf: leaf is None)

    def thinned(self, factor: int) -> "Observed":
        """Keep one outline ray in `factor`."""
        assert self.contours is not None
        return eqx.tree_at(lambda o: o.contours, self, self.contours.thinned(factor))


def place(skeleton: Skeleton, pose: Pose) -> PlacedBody:
    """Place the skeleton of one frame in the world (m)."""
    joints, tips, origins = place_segments(skeleton, pose)
    return PlacedBody(joints, tips, jnp.asarray(pose.rotations), origins, skeleton.template)


def number(value: Any) -> Float[Array, "..."]:
    """A term's number as an array of floats: an integer would have another type and compile again."""
    array = jnp.asarray(value)
    return array if jnp.issubdtype(array.dtype, jnp.inexact) else array.astype(jnp.result_type(float))


def number_if_any(value: Any) -> Float[Array, "..."] | None:
    """As `number`, but None stays None."""
    return None if value is None else number(value)


def _compiled_once(terms: dict[str, Any]) -> dict[str, Any]:
    """Terms with arrays in place of Python floats, of the first class that is defined alike.

    With other numbers, or after a notebook's cell has been run again, nothing is compiled again.
    """
    return {
        name: jax.tree.map(lambda leaf: number(leaf) if isinstance(leaf, float) else leaf, as_first_defined(term))
        for name, term in terms.items()
    }


class AbstractTerm(eqx.Module):
    """One residual of the objective. The weight multiplies its squared norm; to switch a term off, leave it out.

    Attributes:
        needs_graph: Whether the term uses ``paths``, ``found`` or ``inner`` of ``observed``. Tracking
            computes these only if a term needs them.
        needs_outlines: Whether the term uses ``contours`` or ``silhouettes`` of ``observed``, which only a search
            computes.
    """

    needs_graph: ClassVar[bool] = True

    needs_outlines: ClassVar[bool] = False

    weight: eqx.AbstractVar[Float[Array, ""]]

    def correspond(self, body: PlacedBody, observed: Observed) -> PyTree:
        """Look up what stays fixed during an inner solve; nothing by default."""
        return None

    def residual(self, body: PlacedBody, observed: Observed, fixed: Any) -> Float[Array, "..."]:
        """Unweighted residual of one frame; `fixed` is the result of `correspond`."""
        raise NotImplementedError

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Unweighted cost of a pose: the squared norm of the residual, unless a term overrides it by a robust cost."""
        return (self.residual(body, observed, self.correspond(body, observed)) ** 2).sum()

    def of_body(self, body: Body) -> "AbstractTerm":
        """The same term for another subject: every `Body` and `Skeleton` in it is replaced."""

        def other(node: Any) -> Any:
            return body if isinstance(node, Body) else body.skeleton if isinstance(node, Skeleton) else node

        return jax.tree.map(other, self, is_leaf=lambda node: isinstance(node, Body | Skeleton))

    def at_scale(self, scale: Float[Array, ""]) -> "AbstractTerm":
        """The same term with another robust scale (m): fits begin with a large one. By default the term itself."""
        return self

    def with_prior(self, factor: float) -> "AbstractTerm":
        """The same term where all that is known without this frame counts `factor` times; by default the term itself.

        Priors of poses count more where outlines tell less, as around clothes, and not at all where a body is found.
        """
        return self

    def ball_costs(
        self, points: Float[Array, "balls 3"], radii: Float[Array, " balls"], observed: Observed
    ) -> Float[Array, " balls"] | None:
        """Unweighted cost of balls that a limb is made of, wherever the rest of the body is.

        The search scores its tables of limb poses by this. None, the default: the term only takes part in the fits
        and in the choice between hypotheses.

        Args:
            points: Centres (m, in the world): two on the upper bone, three on the lower one, for each pose.
            radii: Their radii (m).
            observed: One frame.
        """
        return None

    def collision_costs(
        self,
        points: Float[Array, "balls 3"],
        radii: Float[Array, " balls"],
        ends: Float[Array, "capsules 2 3"],
        capsule_radii: Float[Array, "capsules 2"],
    ) -> Float[Array, " balls"] | None:
        """Unweighted cost of an arm's balls (m) beside capsules of trunk, head and legs, as `ball_costs`."""
        return None

    def posture_costs(
        self, limb: str, directions: Float[np.ndarray, "postures 6"]
    ) -> Float[np.ndarray, " postures"] | None:
        """Unweighted cost of how a limb is held, whatever the frame shows, as `ball_costs`.

        Args:
            limb: ``arm`` or ``leg``.
            directions: Unit vectors along upper and lower bone: front, left, up of chest or pelvis, as of a left limb.
        """
        return None

    def ray_costs(self, distance: Float[Array, "*rays"], observed: Observed) -> Float[Array, "*rays"] | None:
        """Unweighted cost of outline rays at a distance (m) from the body, zero or more, as `ball_costs`."""
        return None


class AbstractCoupling(eqx.Module):
    """A residual that couples a frame with the ones before and after it, for `refine_sequence`."""

    weight: eqx.AbstractVar[Float[Array, ""]]

    def residual(self, before: PlacedBody, body: PlacedBody, after: PlacedBody) -> Float[Array, "..."]:
        """Unweighted residual of one frame that is neither the first nor the last."""
        raise NotImplementedError


class Objective(eqx.Module):
    """A named collection of weighted terms. New weights or data of the same shapes do not compile again."""

    terms: dict[str, AbstractTerm | AbstractCoupling] = eqx.field(converter=_compiled_once)

    def __check_init__(self):
        """Reject what is no term."""
        for name, term in self.terms.items():
            if isinstance(term, type) or not hasattr(term, "residual"):
                raise ValueError(f"objective: its term {name!r} is {told(term)}; give a term, such as RestPrior()")

    def plus(self, **terms: AbstractTerm | AbstractCoupling) -> "Objective":
        """The objective with more terms; a term replaces one of the same name."""
        return Objective(self.terms | terms)

    def without(self, *names: str) -> "Objective":
        """The objective without some terms."""
        self._check(names)
        return Objective({name: term for name, term in self.terms.items() if name not in names})

    def weighted(self, **weights: Any) -> "Objective":
        """The objective with other weights for some terms."""
        self._check(weights)
        for name, weight in weights.items():
            if not isinstance(weight, jax.Array | np.ndarray):
                check_number(name, weight, 0.0, np.inf, "a weight, zero or more")
        found = {name: number(weight) for name, weight in weights.items()}
        changed = {name: eqx.tree_at(lambda t: t.weight, self.terms[name], found[name]) for name in found}
        return Objective(self.terms | changed)

    def _check(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in self.terms:
                raise ValueError(f"the objective has no term {name!r}; it has {', '.join(self.terms)}")

    def of_body(self, body: Body) -> "Objective":
        """The same objective for another subject, see `AbstractTerm.of_body`; couplings stay as they are."""
        return self.plus(**{name: term.of_body(body) for name, term in self.of_frames.items()})

    def at_scale(self, scale: Float[Array, ""]) -> "Objective":
        """The objective with another robust scale (m) in all terms that have one."""
        return self.plus(**{name: term.at_scale(scale) for name, term in self.of_frames.items()})

    def with_prior(self, factor: float) -> "Objective":
        """The objective with other weights of its priors, see `AbstractTerm.with_prior`; couplings stay as they are."""
        return self.plus(**{name: term.with_prior(factor) for name, term in self.of_frames.items()})

    @property
    def of_frames(self) -> dict[str, AbstractTerm]:
        """The terms of single frames."""
        return {name: term for name, term in self.terms.items() if isinstance(term, AbstractTerm)}

    @property
    def couplings(self) -> dict[str, AbstractCoupling]:
        """The terms that couple frames."""
        return {name: term for name, term in self.terms.items() if isinstance(term, AbstractCoupling)}

    @property
    def needs_graph(self) -> bool:
        """Whether any term uses the labelled graph."""
        return any(term.needs_graph for term in self.of_frames.values())

    @property
    def needs_outlines(self) -> bool:
        """Whether any term uses the outlines of the silhouettes."""
        return any(term.needs_outlines for term in self.of_frames.values())

    def correspond(self, body: PlacedBody, observed: Observed) -> dict[str, PyTree]:
        """Look up the correspondences of all terms."""
        return {name: term.correspond(body, observed) for name, term in self.of_frames.items()}

    def residuals(
        self, body: PlacedBody, observed: Observed, fixed: dict[str, PyTree]
    ) -> dict[str, Float[Array, "..."]]:
        """Weighted residuals of one frame, by name of the term."""
        return {
            name: jnp.sqrt(term.weight) * term.residual(body, observed, fixed[name])
            for name, term in self.of_frames.items()
        }

    def costs(self, body: PlacedBody, observed: Observed) -> dict[str, Float[Array, ""]]:
        """Weighted cost of one frame, by name of the term."""
        return {name: term.weight * term.cost(body, observed) for name, term in self.of_frames.items()}

    def coupled(self, before: PlacedBody, bodies: PlacedBody, after: PlacedBody) -> dict[str, Float[Array, "..."]]:
        """Weighted residuals between frames, by name of the term; all arrays have a leading frames axis."""
        return {
            name: jnp.sqrt(term.weight) * jax.vmap(term.residual)(before, bodies, after)
            for name, term in self.couplings.items()
        }
