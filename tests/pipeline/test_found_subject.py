"""A subject's flesh around a known skeleton, found from silhouettes."""

from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest
from support.capsule_films import ADULT, BODY, some

from jaxskel import HullSettings, Prepared, Recording, Settings, default_adult, make_body, prepare
from jaxskel._runtime.compile_cache import CachedJit, _plain
from jaxskel.body import BALL_NAMES, Body, flesh_prior, lengths_of, measured_body, place_body
from jaxskel.body_calibration import usual_backpack, usual_hair
from jaxskel.pipeline import reconstruct_batch
from jaxskel.synthetic import camera_ring, demo_motion, render

pytestmark = pytest.mark.slow

# Of the demo motion at 5 frames a second: a walk, waving, a turn, crane stand, crouch, hands on hips.
FRAMES = [7, 18, 35, 43, 50, 55]
# Somebody in thick clothes is searched for a dozen times.
FEW = [7, 43]
BAG = [BALL_NAMES.index(f"{side}_bag_{end}") for side in "lr" for end in ("top", "low")]
HAIR = [BALL_NAMES.index(f"hair_{end}") for end in ("top", "low")]
LIMBS = [i for i, name in enumerate(BALL_NAMES) if name[2:] in ("elbow", "forearm", "knee", "calf")]


def film(body: Body, frames: list[int] = FRAMES) -> Recording:
    cameras = camera_ring(size=(320, 240))
    silhouettes = render(cameras, *place_body(body, some(demo_motion(ADULT), frames)))
    return Recording(cameras, silhouettes, 5.0, "+Z", np.arange(len(frames)), ADULT)


@pytest.fixture(scope="module", params=[0.8, 1.2])
def stout_and_found(request) -> tuple[Body, Body]:
    """A body whose limbs are thinner or thicker than an average adult's, and what `prepare` finds."""
    radii = np.asarray(BODY.radii) * np.where(np.isin(np.arange(len(BALL_NAMES)), LIMBS), request.param, 1.0)
    true = Body(ADULT, BODY.segments, BODY.offsets, radii, BODY.links)
    return true, prepare(film(true), Settings(hull=HullSettings(max_misses=0))).body


def test_flesh_of_the_limbs_comes_near_to_the_true_one(stout_and_found):
    true, found = stout_and_found
    before, after = (np.abs(np.asarray(body.radii) - true.radii)[LIMBS] for body in (BODY, found))
    assert after.mean() < 0.5 * before.mean()


def test_a_known_skeleton_is_kept(stout_and_found):
    _, found = stout_and_found
    np.testing.assert_allclose(found.skeleton.rest_joints, ADULT.rest_joints, atol=1e-4)
    np.testing.assert_allclose(found.skeleton.rest_tips, ADULT.rest_tips, atol=1e-4)


@pytest.mark.parametrize("known", [False, True])
def test_what_is_compiled_ahead_is_all_that_takes_long(monkeypatch, known):
    """Fits, proposals of limbs, adjustments and the refinement are compiled ahead, and nothing is in vain."""
    begun, called = set(), set()

    def key_of(function: CachedJit, args: tuple, kwargs: dict) -> tuple[str, Any]:
        leaves, structure = jax.tree.flatten((args, kwargs))
        return function.__name__, function._key([_plain(leaf) for leaf in leaves], structure)[0]

    def call(function: CachedJit, *args: Any, **kwargs: Any) -> Any:
        called.add(key_of(function, args, kwargs))
        return usual(function, *args, **kwargs)

    def ahead(function: CachedJit, threads: Executor, *args: Any, **kwargs: Any) -> None:
        begun.add(key_of(function, args, kwargs))

    usual = CachedJit.__call__
    monkeypatch.setattr(CachedJit, "__call__", call)
    monkeypatch.setattr(CachedJit, "ahead", ahead)
    monkeypatch.setattr("jaxskel.pipeline._ahead.usable_cores", lambda: 2)
    recording, settings = film(BODY), Settings(hull=HullSettings(max_misses=0), body=BODY if known else None)
    reconstruct_batch(recording, prepare(recording, settings), settings)
    long = {"_fitted", "with_limbs", "_refined", "unexplained_shares"}
    long |= set() if known else {"linearised", "_turned", "_carried"}
    assert {name for name, _ in begun} == long
    assert begun <= called
    # Legs are searched for in doubtful frames only.
    assert {name for name, _ in called - begun} & long <= {"with_limbs"}


def test_left_mirrors_right(stout_and_found):
    _, found = stout_and_found
    for ball, name in enumerate(BALL_NAMES):
        other = BALL_NAMES.index({"l_": "r_"}.get(name[:2], name[:2]) + name[2:])
        np.testing.assert_allclose(found.radii[other], found.radii[ball], atol=1e-6)
        if other != ball:
            np.testing.assert_allclose(found.offsets[other], found.offsets[ball] * [1, -1, 1], atol=1e-5)


def in_a_coat() -> Body:
    """An adult whose trunk and limbs are 4 cm thicker than they should be."""
    parts = ("chest", "waist", "seat", "girdle", "shoulder", "elbow", "forearm", "hip", "knee", "calf")
    worn = np.array([name.removeprefix("l_").removeprefix("r_") in parts for name in BALL_NAMES])
    return Body(ADULT, BODY.segments, BODY.offsets, np.asarray(BODY.radii) + np.where(worn, 0.04, 0.0), BODY.links)


def found_in(body: Body) -> Prepared:
    """What `prepare` finds of a body whose dimensions are unknown."""
    return prepare(replace(film(body, FEW), skeleton=None), Settings(hull=HullSettings(max_misses=0)))


@pytest.fixture(scope="module")
def in_thick_clothes() -> Prepared:
    return found_in(in_a_coat())


def test_thick_clothes_do_not_make_a_person_tall(in_thick_clothes):
    assert in_thick_clothes.skeleton.stature == pytest.approx(ADULT.stature, rel=0.03)


def test_it_is_told_that_something_is_worn(in_thick_clothes):
    assert 0.02 < in_thick_clothes.clothes < 0.06


def test_a_backpack_that_a_coat_hides_is_tried(in_thick_clothes, monkeypatch):
    """Also where the hull behind the body in its thick coat shows none."""
    coat = in_a_coat()
    luggage, offsets, radii = usual_backpack(ADULT), np.array(coat.offsets), np.array(coat.radii)
    offsets[BAG] = np.concatenate([luggage.ends, luggage.ends * [1, -1, 1]])
    radii[BAG] = luggage.radius
    monkeypatch.setattr("jaxskel.pipeline._subject.find_luggage", lambda *_: None)
    found = found_in(Body(ADULT, coat.segments, offsets, radii, coat.links))
    np.testing.assert_allclose(found.body.radii[BAG], luggage.radius, atol=0.04)
    assert found.skeleton.stature == pytest.approx(ADULT.stature, rel=0.03)
    assert np.asarray(in_thick_clothes.body.radii)[BAG].max() < 0.03


def test_long_hair_over_a_coat_is_found(in_thick_clothes):
    coat, hair = in_a_coat(), usual_hair(ADULT)
    offsets, radii = np.array(coat.offsets), np.array(coat.radii)
    # Longer than usual, and farther behind.
    offsets[HAIR], radii[HAIR] = hair.ends + [[-0.02, 0.0, 0.0], [-0.06, 0.0, -0.04]], hair.radius
    found = found_in(Body(ADULT, coat.segments, offsets, radii, coat.links))
    np.testing.assert_allclose(found.body.radii[HAIR], hair.radius, atol=0.04)
    np.testing.assert_allclose(found.body.offsets[HAIR], offsets[HAIR], atol=0.08)
    assert found.skeleton.stature == pytest.approx(ADULT.stature, rel=0.03)
    assert np.asarray(in_thick_clothes.body.radii)[HAIR].max() < 0.03


def test_the_prior_of_flesh_keeps_lengths_and_grows_with_the_body():
    small, tall = (flesh_prior(default_adult(stature)) for stature in (1.55, 1.86))
    for prior in (small, tall):
        np.testing.assert_array_equal(prior.mean.lengths, 0.0)
        assert np.linalg.eigvalsh(prior.precision).min() > 0
    # Not exactly: joint centres are known to 2 mm, however tall a person is.
    np.testing.assert_allclose(tall.mean.balls, 1.2 * np.asarray(small.mean.balls), atol=4e-3)
    body = measured_body(ADULT, flesh_prior(ADULT).mean)
    np.testing.assert_allclose(lengths_of(body.skeleton), lengths_of(ADULT), rtol=1e-5)
    # A body as adults are is not far from the one that `make_body` draws.
    assert np.abs(np.asarray(body.radii) - make_body(ADULT).radii).max() < 0.03
    jax.tree.map(np.testing.assert_array_equal, body.segments, BODY.segments)
