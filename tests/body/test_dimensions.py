"""A subject's dimensions as unknowns: what each one changes and does not change, and how the prior holds it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel import default_adult, make_body
from jaxskel.body import (
    FREE_BALLS,
    HEM,
    LENGTH_NAMES,
    MIRROR_JOINTS,
    QUANTITIES,
    Shape,
    Skeleton,
    lengths_of,
    measured_body,
    people_prior,
    shaped_body,
)
from jaxskel.body._human import MIRROR_TIPS
from jaxskel.body._shape import shaped_skeleton

ADULT = default_adult()
SAME = Shape(np.zeros(11), np.zeros(2), np.zeros((len(FREE_BALLS), 4)))


def longer(**shares: float) -> Shape:
    return Shape(np.array([np.log1p(shares.get(name, 0.0)) for name in LENGTH_NAMES]), np.zeros(2), SAME.balls)


def assert_even(skeleton: Skeleton) -> None:
    mirrored = np.array([1, -1, 1])
    for points, other in ((skeleton.rest_joints, MIRROR_JOINTS), (skeleton.rest_tips, MIRROR_TIPS)):
        np.testing.assert_allclose(np.asarray(points)[list(other)] * mirrored, points, atol=1e-6)


def test_lengths_by_name():
    by_name = dict(zip(LENGTH_NAMES, lengths_of(ADULT), strict=True))
    joints = np.asarray(ADULT.rest_joints)
    assert by_name["thigh"] == pytest.approx(np.linalg.norm(joints[10] - joints[9]))
    assert by_name["forearm"] == pytest.approx(np.linalg.norm(joints[8] - joints[7]))
    assert by_name["head_top"] == pytest.approx(np.linalg.norm(ADULT.rest_tips[0] - joints[2]))


def test_no_difference_is_the_average_body():
    body, average = shaped_body(ADULT, SAME), make_body(ADULT)
    np.testing.assert_allclose(body.skeleton.rest_joints, ADULT.rest_joints, atol=1e-6)
    np.testing.assert_allclose(body.skeleton.rest_tips, ADULT.rest_tips, atol=1e-6)
    np.testing.assert_allclose(body.offsets, average.offsets, atol=1e-6)
    np.testing.assert_allclose(body.radii, average.radii, atol=1e-6)


@pytest.mark.parametrize("name", LENGTH_NAMES)
def test_one_length_on_both_sides_and_nothing_else(name):
    skeleton = shaped_skeleton(ADULT, longer(**{name: 0.1}))
    expected = lengths_of(ADULT) * np.where(np.array(LENGTH_NAMES) == name, 1.1, 1.0)
    np.testing.assert_allclose(lengths_of(skeleton), expected, rtol=1e-5)
    assert_even(skeleton)


def test_all_lengths_alike_are_a_scale():
    body, scaled = shaped_body(ADULT, longer(**dict.fromkeys(LENGTH_NAMES, 0.07))), make_body(ADULT.scaled(1.07))
    np.testing.assert_allclose(body.skeleton.rest_joints, scaled.skeleton.rest_joints, atol=1e-5)
    np.testing.assert_allclose(body.offsets, scaled.offsets, atol=1e-5)
    np.testing.assert_allclose(body.radii, scaled.radii, atol=1e-5)


def test_fingers_close_inwards_and_stay_as_long():
    closed = shaped_skeleton(ADULT, Shape(np.zeros(11), people_prior(ADULT, ADULT.stature).mean.fingers, SAME.balls))
    np.testing.assert_allclose(lengths_of(closed), lengths_of(ADULT), rtol=1e-5)
    assert_even(closed)
    # Left fingers point to the right now, and nothing else has moved.
    assert (np.asarray(closed.rest_tips) - np.asarray(closed.rest_joints)[[2, 5, 8, 11, 14]])[1, 1] < -0.05
    np.testing.assert_allclose(closed.rest_joints, ADULT.rest_joints, atol=1e-6)
    np.testing.assert_allclose(np.asarray(closed.rest_tips)[[0, 3, 4]], ADULT.rest_tips[[0, 3, 4]], atol=1e-6)


def test_unknowns_in_a_row_and_back():
    vector = np.random.default_rng(0).normal(size=len(QUANTITIES))
    np.testing.assert_array_equal(Shape.of(vector).vector, vector)


@pytest.mark.slow
def test_derivative_of_a_body_is_that_of_finite_differences():
    vector, direction = np.random.default_rng(1).normal(size=(2, len(QUANTITIES))) * 0.02

    def flat(vector: jax.Array) -> jax.Array:
        body = shaped_body(ADULT, Shape.of(vector))
        return jnp.concatenate([jnp.ravel(body.offsets), jnp.asarray(body.radii), jnp.ravel(body.skeleton.pivots)])

    with jax.enable_x64(True):
        slope = jax.jvp(flat, (jnp.asarray(vector),), (jnp.asarray(direction),))[1]
        ahead, behind = (flat(jnp.asarray(vector + step * direction)) for step in (1e-3, -1e-3))
        np.testing.assert_allclose(slope, (ahead - behind) / 2e-3, atol=1e-6)


def deviation(quantity: str, given: dict[str, float]) -> float:
    """Standard deviation of an unknown, given the values of others."""
    prior, place = people_prior(ADULT, ADULT.stature), QUANTITIES.index(quantity)
    precision = prior.precision + 1e-9 * np.eye(len(QUANTITIES))
    free = [i for i, name in enumerate(QUANTITIES) if name not in given]
    return float(np.sqrt(np.linalg.inv(precision[np.ix_(free, free)])[free.index(place), free.index(place)]))


def test_flesh_tells_where_joints_are():
    # What is known of the flesh around a hip tells its width, given the size.
    size = {"trunk": 0.0, "thigh": 0.0, "shank": 0.0}
    flesh = {name: 0.0 for name in QUANTITIES if name.startswith(("seat ", "waist ", "hip "))}
    assert deviation("hip", size | flesh) < 0.7 * deviation("hip", size)


def test_adults_differ_by_some_per_cent():
    size = {"trunk": 0.0}
    for name in ("neck", "shoulder", "upper_arm", "forearm", "hip", "thigh", "shank", "head_top", "toetip"):
        assert 0.01 < deviation(name, size) < 0.12, name


def test_flesh_is_a_share_of_the_stature_and_lengths_are_not():
    small, tall = (people_prior(ADULT.scaled(size), size * ADULT.stature) for size in (1.0, 1.2))
    np.testing.assert_allclose(tall.mean.lengths, small.mean.lengths)
    np.testing.assert_allclose(tall.mean.balls, 1.2 * small.mean.balls)


@pytest.mark.parametrize("stature", [1.0, 1.3, 1.6, 1.9])
def test_the_prior_of_a_stature_does_not_depend_on_the_template(stature):
    bodies = [measured_body(template, people_prior(template, stature).mean) for template in (ADULT, ADULT.scaled(0.8))]
    for body in bodies:
        assert body.skeleton.stature == pytest.approx(stature, rel=0.04)
    np.testing.assert_allclose(bodies[0].skeleton.rest_joints, bodies[1].skeleton.rest_joints, atol=1e-6)
    np.testing.assert_allclose(bodies[0].radii, bodies[1].radii, atol=1e-6)


def test_children_have_larger_heads_and_shorter_legs():
    child, adult = (
        lengths_of(measured_body(ADULT, people_prior(ADULT, stature).mean).skeleton) / stature
        for stature in (1.2, 1.75)
    )
    assert child[LENGTH_NAMES.index("head_top")] > 1.1 * adult[LENGTH_NAMES.index("head_top")]
    assert child[LENGTH_NAMES.index("thigh")] < adult[LENGTH_NAMES.index("thigh")]


def test_hands_are_half_closed():
    prior = people_prior(ADULT, ADULT.stature)
    skeleton = shaped_skeleton(ADULT, prior.mean)
    tips, hands = np.asarray(skeleton.rest_tips), np.asarray(skeleton.rest_joints)[[5, 8]]
    # Fingers point inwards, and not far.
    assert (tips[1] - hands[0])[1] < -0.05
    assert (tips[2] - hands[1])[1] > 0.05
    assert lengths_of(skeleton)[LENGTH_NAMES.index("fingertip")] < 0.75 * np.linalg.norm(
        ADULT.rest_tips[1] - ADULT.rest_joints[5]
    )


def test_size_is_free_and_proportions_are_not():
    precision = people_prior(ADULT, ADULT.stature).precision
    size = np.concatenate([np.ones(11), np.zeros(len(QUANTITIES) - 11)])
    largest = np.linalg.eigvalsh(precision)[-1]
    np.testing.assert_allclose(precision @ size / largest, 0, atol=1e-9)
    values = np.linalg.eigvalsh(precision)
    assert abs(values[0]) < 1e-9 * largest
    assert values[1] > 0.01
    assert len(precision) == len(QUANTITIES) == 13 + 4 * len(FREE_BALLS)


def test_balls_of_the_middle_stay_there():
    prior = people_prior(ADULT, ADULT.stature)
    for ball in ("nape", "face", "crown"):
        place = QUANTITIES.index(f"{ball} out")
        assert prior.mean.vector[place] == 0
        assert prior.precision[place, place] > 1e9


@pytest.mark.parametrize("stature", [1.2, 1.75])
@pytest.mark.parametrize("what", ["front", "out", "up", "radius"])
def test_the_hem_has_the_flesh_of_calf_and_ankle(stature, what):
    prior = people_prior(ADULT, stature)
    mix = np.zeros(len(QUANTITIES))
    mix[[QUANTITIES.index(f"{ball} {what}") for ball in ("calf", "hem", "ankle")]] = 1 - HEM, -1.0, HEM
    assert mix @ prior.mean.vector == pytest.approx(0.0, abs=1e-9)
    variance = mix @ np.linalg.solve(prior.precision + 1e-9 * np.eye(len(QUANTITIES)), mix)
    assert np.sqrt(variance) == pytest.approx(0.001 * stature, rel=0.02)
