"""Silhouettes of people in clothes, and of slim bodies, made from recordings whose joints are known."""

import equinox as eqx
import numpy as np
import pytest
from _clothes import GARMENTS, _ankle, with_clothes
from _slim import with_slim_body
from support.spoilt_rigs import masks_of

from jaxskel import JOINT_NAMES, Recording, default_adult
from jaxskel.body import PIVOT_NAMES
from jaxskel.synthetic import make_scene


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(4)


# --- clothes


def test_clothes_add_to_the_silhouettes_and_take_nothing_away(scene):
    before = masks_of(scene)
    dressed = [masks_of(with_clothes(scene, seed)) for seed in (0, 1, 0)]
    for each in dressed:
        assert (each >= before).all()
        assert 1.01 < each.sum() / before.sum() < 2
    np.testing.assert_array_equal(dressed[0], dressed[2])
    assert (dressed[0] != dressed[1]).any()


@pytest.mark.parametrize("garment", GARMENTS)
def test_a_garment_is_near_the_body_and_grows_with_it(scene, garment):
    joints = dict(zip(JOINT_NAMES, np.moveaxis(np.asarray(scene.truth.joints, np.float64), 1, 0), strict=True))
    twice = {name: 2 * points for name, points in joints.items()}
    small, large = (GARMENTS[garment](*given, np.random.default_rng(0)) for given in ((joints, 1.0), (twice, 2.0)))
    body = np.asarray(scene.truth.joints)
    for (start, end, first, last), (other, _, wide, _) in zip(small, large, strict=True):
        np.testing.assert_allclose(other, 2 * start, atol=1e-9)
        assert wide == pytest.approx(2 * first)
        for point in (start, end):
            assert np.linalg.norm(body - point[:, None], axis=-1).min(1).max() < 0.45
        assert 0.04 < min(first, last)


@pytest.mark.parametrize("stature", [1.2, 1.75])
def test_the_ankle_is_where_the_average_adult_has_it(stature):
    adult = default_adult(stature)
    joints = {name: adult.rest_joints[None, number] for number, name in enumerate(JOINT_NAMES)}
    for side in "lr":
        expected = adult.pivots[PIVOT_NAMES.index(f"{side}_ankle")]
        np.testing.assert_allclose(_ankle(joints, side)[0], expected, atol=0.004)


def test_clothes_need_joints(scene):
    with pytest.raises(ValueError, match=r"synthetic: key 'joints'"):
        with_clothes(eqx.tree_at(lambda r: r.truth, scene, None), 0)


# --- slim bodies


def test_a_slim_body_is_inside_the_body_and_grows_with_its_share(scene):
    whole, quarter, half = (masks_of(each) for each in (scene, *(with_slim_body(scene, s) for s in (0.25, 0.5))))
    assert (half >= quarter).all()
    # The shank goes straight to the ball of the foot, in front of the ankle.
    assert (half & ~whole).sum() < 0.07 * half.sum()
    assert 0.1 < quarter.sum() / half.sum() < 0.7
    assert half.sum() < 0.8 * whole.sum()


def test_a_slim_body_needs_joints_and_dimensions(scene):
    for lacking in (lambda r: r.truth, lambda r: r.skeleton):
        with pytest.raises(ValueError, match=r"synthetic: keys 'joints', 'tips', 'rest_joints'"):
            with_slim_body(eqx.tree_at(lacking, scene, None), 0.5)
