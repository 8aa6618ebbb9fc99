"""Bundle adjustment: its derivatives by finite differences, and a known body that it has to find again."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.people import ADULT, film_person, other_person
from support.phantoms import ideal_graph

from jaxskel import Pose
from jaxskel._runtime.batching import filled, on_device, single_precision, take
from jaxskel.body import (
    BALL_NAMES,
    LENGTH_NAMES,
    LINKS,
    QUANTITIES,
    Body,
    Prior,
    Shape,
    ball_centres,
    lengths_of,
    people_prior,
    place_joints,
    shaped_body,
)
from jaxskel.body_calibration import bundle_adjust
from jaxskel.body_calibration._bundle_adjustment import linearised
from jaxskel.body_calibration._shape_quadrics import contour_quadrics, inside_quadrics
from jaxskel.outlines import contours, silhouette_distances
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import ContourContact, InsideSilhouettes, Observed, place

pytestmark = pytest.mark.slow

FRAMES = 16
HINGED = HingedLimbs()
PRIOR = people_prior(ADULT, ADULT.stature)
BONES = slice(0, 8)
# Flesh shows the positions of necks and palms less accurately.
SEEN = [LENGTH_NAMES.index(name) for name in ("shoulder", "upper_arm", "thigh", "shank")]


class Scene(NamedTuple):
    body: Body
    truth: Pose
    observed: Observed


@pytest.fixture(scope="module")
def scene() -> Scene:
    body = other_person()
    recording, motion = film_person(body, FRAMES)
    lost = np.zeros((FRAMES, len(recording.cameras)), bool)
    seen = recording.silhouettes[:], recording.cameras, lost
    graph = ideal_graph(ADULT, Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1))))
    stack = jax.tree.map(lambda a: np.repeat(np.asarray(a)[None], FRAMES, 0), graph)
    observed = Observed(stack.paths, stack.found, stack.inner, contours(*seen), silhouette_distances(*seen))
    return Scene(body, motion, observed)


def doubled(tree):
    """All numbers in float64."""
    return jax.tree.map(lambda a: jnp.asarray(a, None if np.asarray(a).dtype.kind in "bi" else jnp.float64), tree)


@pytest.mark.parametrize("kind", ["contours", "inside"])
def test_quadrics_have_the_slope_of_finite_differences(scene, kind):
    # A wrong pose, so that residuals are not zero; weights are frozen, as in a step.
    observed = jax.tree.map(lambda a: np.asarray(a)[0], scene.observed)
    pose = jax.tree.map(lambda a: np.asarray(a)[0], scene.truth)
    pose = Pose(pose.root + np.array([0.02, 0.01, -0.015]), pose.rotations)
    rng = np.random.default_rng(0)
    shift, growth = rng.normal(size=3), rng.normal(size=len(BALL_NAMES))
    with jax.enable_x64(True):
        observed, body = (doubled(tree) for tree in (observed, scene.body))

        def far(step: float) -> tuple[jax.Array, jax.Array]:
            grown = eqx.tree_at(lambda b: b.radii, body, body.radii + step * growth)
            placed = place(body.skeleton, Pose(pose.root + step * shift, pose.rotations))
            if kind == "contours":
                near, weight = ContourContact(body=grown).nearest(placed, observed)
                return near.distance, weight
            term = InsideSilhouettes(body=grown)
            points, radii, _ = term.points(placed)
            out, _, weight = term.depths(points, radii, observed)
            return out, weight

        placed, weight = place(body.skeleton, pose), far(0.0)[1]
        if kind == "contours":
            quadrics = contour_quadrics(ContourContact(body=body), placed, observed)
        else:
            quadrics = inside_quadrics(InsideSilhouettes(body=body), placed, observed)
        ahead, behind = ((weight * far(step)[0] ** 2).sum() for step in (1e-5, -1e-5))
        change = np.concatenate([np.tile(shift, (len(LINKS), 2)), growth[LINKS]], 1)
        slope = -2 * quadrics.vector * change
        # The linear distance leaves out what a taper does, see `capsule_distance`.
        np.testing.assert_allclose((ahead - behind) / 2e-5, slope.sum(), atol=0.05 * np.abs(slope).sum())
        np.testing.assert_allclose(quadrics.squared, (weight * far(0.0)[0] ** 2).sum(), rtol=1e-6)


def test_balls_move_with_the_unknowns_as_finite_differences_say(scene):
    shape = single_precision(Shape.of(0.05 * np.random.default_rng(1).normal(size=len(QUANTITIES))))
    poses = take(scene.truth, np.array([3]))
    used = np.ones(1, bool)
    linear = linearised(single_precision(ADULT), shape, single_precision(poses), on_device(scene.observed), used)
    direction = np.random.default_rng(2).normal(size=42 + len(QUANTITIES))
    with jax.enable_x64(True):
        pose = jax.tree.map(lambda a: jnp.asarray(a[0], jnp.float64), poses)

        @jax.jit
        def balls(step: jax.Array) -> jax.Array:
            body = shaped_body(ADULT, Shape.of(jnp.asarray(shape.vector, jnp.float64) + step * direction[42:]))
            placed = place(body.skeleton, HINGED.retract(jnp.asarray(step * direction[:42]), pose, body.skeleton))
            centres = ball_centres(body, placed.origins, placed.rotations)
            return jnp.concatenate([centres, jnp.asarray(body.radii)[:, None]], 1)

        expected = np.asarray(balls(1e-4) - balls(-1e-4)) / 2e-4
    np.testing.assert_allclose(np.asarray(linear.balls[0]) @ direction, expected, atol=1e-3)


def test_another_persons_lengths_are_found(scene):
    used = np.ones(FRAMES, bool)
    start = filled(scene.truth)
    stack = on_device(scene.observed)
    found = bundle_adjust(ADULT, PRIOR, PRIOR.mean, start, stack, used)
    true, usual = lengths_of(scene.body.skeleton), lengths_of(ADULT)
    lengths = lengths_of(shaped_body(ADULT, found.shape).skeleton)
    off, before = np.abs(lengths / true - 1), np.abs(usual / true - 1)
    assert off[SEEN].max() < 0.03
    assert off[BONES].max() < 0.04
    assert off[BONES].mean() < 0.3 * before[BONES].mean()


def test_frames_that_do_not_count_keep_their_poses_and_say_nothing(scene):
    used = np.arange(FRAMES) < 10
    poses = filled(scene.truth)
    wrong = Pose(
        np.where(np.arange(len(poses.root))[:, None] < 10, poses.root, poses.root + np.float32(0.3)), poses.rotations
    )
    one, other = (
        bundle_adjust(ADULT, PRIOR, PRIOR.mean, start, on_device(scene.observed), used, steps=2)
        for start in (poses, wrong)
    )
    np.testing.assert_allclose(other.shape.lengths, one.shape.lengths, atol=1e-5)
    np.testing.assert_allclose(other.poses.root[10:], wrong.root[10:], atol=1e-6)
    assert np.abs(one.poses.root[:10] - poses.root[:10]).max() > 1e-4


def test_joints_that_are_known_hold_the_poses(scene):
    # Starts with errors larger than outlines could correct in a few steps, and known lengths.
    lengths = np.log(lengths_of(scene.body.skeleton) / lengths_of(ADULT))
    precision = PRIOR.precision + np.diag(np.r_[np.full(11, 1e10), np.zeros(len(QUANTITIES) - 11)])
    prior = Prior(Shape(lengths, PRIOR.mean.fingers, PRIOR.mean.balls), precision)
    joints = np.asarray(place_joints(single_precision(scene.body.skeleton), single_precision(scene.truth))[0])
    away = filled(Pose(scene.truth.root + np.array([0.25, 0.0, 0.1]), scene.truth.rotations))
    used, stack = np.ones(FRAMES, bool), on_device(scene.observed)
    found = bundle_adjust(ADULT, prior, prior.mean, away, stack, used, steps=6, tolerance=0.0, joints=filled(joints))
    skeleton = single_precision(shaped_body(ADULT, found.shape).skeleton)
    np.testing.assert_allclose(lengths_of(skeleton)[:8], lengths_of(scene.body.skeleton)[:8], rtol=1e-3)
    off = np.linalg.norm(np.asarray(place_joints(skeleton, take(found.poses, np.arange(FRAMES)))[0]) - joints, axis=-1)
    assert np.median(off) < 0.005
    assert off.max() < 0.03
