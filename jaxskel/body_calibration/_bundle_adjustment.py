"""Bundle adjustment: the dimensions of a body together with its poses in many frames.

Gauss-Newton with correspondences fixed during each step. A pose shares residuals only with the body, so the unknowns
of each frame are eliminated before the body's are solved for (Schur complement); cost is linear in the frames.
"""

from concurrent.futures import Executor
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import single_precision
from .._runtime.compile_cache import cached_jit
from ..body import (
    FLESH_FROM,
    HUMAN_15,
    LENGTH_NAMES,
    LINKS,
    QUANTITIES,
    Body,
    Pose,
    Prior,
    Shape,
    Skeleton,
    ball_centres,
    shaped_body,
)
from ..refinement.parametrisations import HingedLimbs
from ..refinement.terms import (
    INSIDE_OVER_OUTLINES,
    CapsuleTerm,
    ContourContact,
    InsideSilhouettes,
    Objective,
    Observed,
    place,
    volume_objective,
)
from ..search import DAMPING, RELATIVE_DAMPING
from ._clothing import Clothing
from ._shape_quadrics import contour_quadrics, inside_quadrics, may_err

_HINGED = HingedLimbs()
_POSE = 3 + sum(HUMAN_15.freedoms)
# The outlines of a well fitted body have a standard deviation of 5 mm. As errors of neighbouring rays are correlated,
# a frame's rays count as only 30 independent measurements, about one for each capsule. In the objective of frames by
# themselves they count as 360, because there the pose may give way instead of the body.
_MEASUREMENTS, _DEVIATION = 30, 0.005
# Where outlines fit worse, because masks are poor, cameras are off or clothes swing, they count less: the median
# distance times this is the standard deviation of distances that are normally distributed.
_OF_MEDIAN = 1.48
_CONTOURS = np.float32(_MEASUREMENTS / _DEVIATION**2)
_INSIDE = _CONTOURS * INSIDE_OVER_OUTLINES
# Robust scale (m) of ray distances, for both signs: a body too fat is as wrong as one too thin.
SCALE = np.float32(0.018)
# In the first steps the scale (m) is wider and narrows by this factor, so that thick clothes attract the body. Until it
# is this narrow the lengths stay, because wide clothes would also be explained by a larger body.
FIRST_SCALE, _NARROWING, _LENGTHS_FROM = 0.12, 0.8, 0.05
# Factor on the rest prior: it helps where nothing is observed, but biases all lengths in the same direction.
_REST = 0.3
# Standard deviation of known joints from a chain of rigid bones (m).
_KNOWN = 0.003
# Largest step, as the linearisation is not trusted farther: of a pose (m, rad), a length (logarithm), a ball (m).
_POSE_REACH, _LENGTH_REACH, _BALL_REACH = 0.4, 0.1, 0.02
# Model errors are correlated between frames: one frame in this many counts as independent for the deviations.
_ALIKE = 4


class Adjusted(NamedTuple):
    """Result of one or several steps.

    Attributes:
        poses: Axis ``frames``.
        covariance: Covariance of the logarithms of the lengths.
        change: Largest change of a length in the last step, as a share of the length.
        clothes: Root mean square of what clothes add to the radii of the body (m).
    """

    shape: Shape
    poses: Pose
    covariance: Float[np.ndarray, "lengths=11 lengths=11"]
    change: float
    clothes: float


class Linear(eqx.Module):
    """One frame linearised: balls and other residuals as functions of the unknowns of pose and body.

    Attributes:
        balls: Derivative of centres and radii by the unknowns.
        rows: Derivative of the residuals by the unknowns.
        apart: Median distance between the outlines and the body (m).
    """

    matrix: Float[Array, "capsules 8 8"]
    vector: Float[Array, "capsules 8"]
    balls: Float[Array, "balls 4 unknowns"]
    residuals: Float[Array, " rows"]
    rows: Float[Array, "rows unknowns"]
    apart: Float[Array, ""]


def bundle_adjust(
    template: Skeleton,
    prior: Prior,
    shape: Shape,
    poses: Pose,
    observed: Observed,
    used: Bool[np.ndarray, " frames"],
    steps: int = 15,
    tolerance: float = 1e-3,
    joints: Float[np.ndarray, "stack joints 3"] | None = None,
    first_scale: float = FIRST_SCALE,
) -> Adjusted:
    """Adjust a body and its poses to the silhouettes of many frames.

    Args:
        template: Skeleton that `shape` is relative to (m).
        prior: Prior of the shape.
        shape: Start of the shape.
        poses: Start of the poses (m, in the world), with the axis ``frames``.
        observed: Outlines and silhouettes, on the device, with the same axis.
        used: Frames to use; the others keep their poses.
        steps: Largest number of steps.
        tolerance: Stop when no length but those of the tips changes by more than this share.
        joints: Known joints in the world (m), of as many frames as `poses` has: from markers or a synthetic scene.
            None where they are not known.
        first_scale: Robust scale of the first step (m), which narrows from there.
    """
    template = single_precision(template)
    known = None if joints is None else jnp.asarray(joints, jnp.float32)
    adjusted = Adjusted(shape, poses, np.diag(np.full(len(LENGTH_NAMES), np.inf)), np.inf, 0.0)
    frames, clothing, weight = np.flatnonzero(used), Clothing(), np.float32(_CONTOURS)
    for scale in np.maximum(SCALE, first_scale * _NARROWING ** np.arange(steps)).astype(np.float32):
        adjusted, apart = _step(
            template, Prior(prior.mean, clothing.precision(prior)), adjusted, observed, frames, known, scale, weight
        )
        if scale == SCALE:
            weight = np.float32(_MEASUREMENTS / max(_DEVIATION, _OF_MEDIAN * apart) ** 2)
        clothing = clothing.given(prior, adjusted.shape.vector)
        adjusted = adjusted._replace(clothes=clothing.thickness)
        if adjusted.change < tolerance and scale == SCALE:
            break
    return adjusted


def bundle_ahead(threads: Executor, template: Skeleton, poses: Pose, observed: Observed) -> None:
    """Begin to compile what `bundle_adjust` needs for arguments like these."""
    template, shape = single_precision((template, Shape.of(np.zeros(len(QUANTITIES)))))
    used = np.ones(len(poses.root), bool)
    linearised.ahead(threads, template, shape, poses, observed, used, None, SCALE, _CONTOURS)
    _turned.ahead(threads, template, shape, poses, np.zeros((len(poses.root), _POSE), np.float32))


def _step(
    template: Skeleton,
    prior: Prior,
    before: Adjusted,
    observed: Observed,
    frames: Int[np.ndarray, " used"],
    joints: Float[Array, "stack joints 3"] | None,
    scale: np.float32,
    weight: np.float32,
) -> tuple[Adjusted, float]:
    start = single_precision(before.shape)
    used = np.isin(np.arange(len(before.poses.root)), frames)
    linear = linearised(template, start, before.poses, observed, used, joints, scale, weight)
    linear = jax.tree.map(lambda a: np.asarray(a)[frames].astype(np.float64), linear)
    vector, count = before.shape.vector, len(before.shape.vector)
    matrix, pull = np.zeros((count, count)), np.zeros(count)
    solved = []
    for row in range(len(frames)):
        inner, gradient = normal_equations(jax.tree.map(lambda a, i=row: a[i], linear))
        own = inner[:_POSE, :_POSE]
        own = own + np.diag(DAMPING + RELATIVE_DAMPING * np.diagonal(own))
        both = np.linalg.solve(own, np.column_stack([inner[:_POSE, _POSE:], gradient[:_POSE]]))
        matrix += inner[_POSE:, _POSE:] - inner[_POSE:, :_POSE] @ both[:, :-1]
        pull += gradient[_POSE:] - inner[_POSE:, :_POSE] @ both[:, -1]
        solved.append(both)
    whole = matrix + prior.precision
    damped = whole + np.diag(RELATIVE_DAMPING * np.diagonal(whole))
    free = np.arange(0 if scale < _LENGTHS_FROM else FLESH_FROM, count)
    change = np.zeros(count)
    change[free] = np.linalg.solve(
        damped[np.ix_(free, free)], (pull - prior.precision @ (vector - prior.mean.vector))[free]
    )
    reach = np.concatenate([np.full(len(LENGTH_NAMES) + 2, _LENGTH_REACH), np.full(count - 13, _BALL_REACH)])
    change = np.clip(change, -reach, reach)
    turns = np.zeros((len(before.poses.root), _POSE), np.float32)
    for frame, both in zip(frames, solved, strict=True):
        turns[frame] = np.clip(both[:, -1] - both[:, :-1] @ change, -_POSE_REACH, _POSE_REACH)
    poses = jax.tree.map(np.asarray, _turned(template, start, before.poses, turns))
    of_lengths = slice(len(LENGTH_NAMES))
    covariance = np.linalg.inv(matrix / _ALIKE + prior.precision)[of_lengths, of_lengths]
    # The tips' lengths are ignored here: they affect little else, and converge last.
    after = Adjusted(Shape.of(vector + change), poses, covariance, float(np.abs(change[:8]).max()), before.clothes)
    return after, float(np.median(linear.apart))


def normal_equations(
    linear: Linear,
) -> tuple[Float[np.ndarray, "unknowns unknowns"], Float[np.ndarray, " unknowns"]]:
    """Matrix and right-hand side of one frame's normal equations: unknowns of the pose, then of the body."""
    first, last = linear.balls[LINKS[:, 0]], linear.balls[LINKS[:, 1]]
    ends = np.concatenate([first[:, :3], last[:, :3], first[:, 3:], last[:, 3:]], 1)  # capsules 8 unknowns
    matrix = np.tensordot(ends, linear.matrix @ ends, ((0, 1), (0, 1))) + linear.rows.T @ linear.rows
    return matrix, np.tensordot(linear.vector, ends, 2) - linear.rows.T @ linear.residuals


@cached_jit
def linearised(
    template: Skeleton,
    shape: Shape,
    poses: Pose,
    stack: Observed,
    used: Bool[Array | np.ndarray, " frames"],
    joints: Float[Array, "stack joints 3"] | None = None,
    scale: Float[Array, ""] | np.float32 = SCALE,
    weight: Float[Array, ""] | np.float32 = _CONTOURS,
) -> Linear:
    """Linearise the frames of a stack that are used, one by one; known joints add residuals. The others are zeros.

    Scale and weight are those of the contours.
    """

    @jax.jit  # so that its shapes and its code come from one trace
    def of(pose: Pose, frame: Int[Array, ""], known: Float[Array, "joints 3"] | None) -> Linear:
        return _linearised(template, shape, pose, stack.of(frame), known, scale, weight)

    def one(given: tuple[tuple[Pose, Int[Array, ""], Float[Array, "joints 3"] | None], Bool[Array, ""]]) -> Linear:
        frame, wanted = given
        shapes = jax.eval_shape(of, *frame)
        nothing = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), shapes)
        return jax.lax.cond(wanted, lambda: of(*frame), lambda: nothing)

    return jax.lax.map(one, ((poses, jnp.arange(len(poses.root), dtype=jnp.int32), joints), jnp.asarray(used)))


def _linearised(
    template: Skeleton,
    shape: Shape,
    pose: Pose,
    observed: Observed,
    joints: Float[Array, "joints 3"] | None,
    scale: Float[Array, ""] | np.float32,
    weight: Float[Array, ""] | np.float32,
) -> Linear:
    body = shaped_body(template, shape)
    placed = place(body.skeleton, pose)
    contours = ContourContact(body=body, weight=weight, scale=scale, inner=1.0)
    quadrics = contour_quadrics(contours, placed, observed)
    quadrics += inside_quadrics(_inside(body, observed, weight), placed, observed)
    fixed = _others(body).correspond(placed, observed)

    def retract(unknowns: Float[Array, " unknowns"]) -> tuple[Float[Array, "balls 4"], Float[Array, " rows"]]:
        body = shaped_body(template, Shape.of(unknowns[_POSE:]))
        placed = place(body.skeleton, _HINGED.nearby(unknowns[:_POSE], pose, body.skeleton))
        centres = jnp.asarray(ball_centres(body, placed.origins, placed.rotations))
        rows = _others(body).residuals(placed, observed, fixed)
        if joints is not None:
            rows["joints"] = (placed.joints - joints) / _KNOWN
        balls = jnp.concatenate([centres, jnp.asarray(body.radii)[:, None]], 1)
        return balls, jnp.concatenate([row.ravel() for row in rows.values()])

    own = jnp.concatenate([jnp.ravel(part) for part in (shape.lengths, shape.fingers, shape.balls)])
    (_, residuals), tangent = jax.linearize(retract, jnp.concatenate([_HINGED.unknowns(body.skeleton), own]))
    balls, rows = jax.vmap(tangent, out_axes=-1)(jnp.eye(_POSE + len(own)))
    apart = jnp.median(jnp.abs(contours.nearest(placed, observed)[0].distance))
    return Linear(quadrics.matrix, quadrics.vector, balls, residuals, rows, apart)


def _inside(body: Body, observed: Observed, weight: Float[Array, ""] | np.float32) -> InsideSilhouettes:
    """The term of the silhouettes for outlines of some weight.

    Of poor masks it counts no more than the outlines do, and no view by itself: each has other holes, and all of them
    together made two bodies with dirty masks 1 to 2 cm too thin all over, and their bones 45 mm wrong instead of 6.
    """
    usual = InsideSilhouettes(body=body, weight=_INSIDE)
    poor = may_err(observed)
    weight = jnp.where(poor, weight * INSIDE_OVER_OUTLINES, usual.weight)
    return replace(usual, weight=weight, single=jnp.where(poor, 0.0, usual.single))


def _others(body: Body) -> Objective:
    """The terms of the objective that do not depend on the silhouettes."""
    terms = {name: term for name, term in volume_objective(body).terms.items() if not isinstance(term, CapsuleTerm)}
    return eqx.tree_at(lambda o: o.terms["rest"].weight, Objective(terms), _REST * terms["rest"].weight)


@cached_jit
def _turned(template: Skeleton, shape: Shape, poses: Pose, unknowns: Float[Array | np.ndarray, "frames n"]) -> Pose:
    skeleton = shaped_body(template, shape).skeleton
    return jax.vmap(lambda pose, own: _HINGED.retract(own, pose, skeleton))(poses, unknowns)
