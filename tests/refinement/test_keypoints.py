"""Keypoints: a projection computed by hand, gaps, what is not seen, and worlds with another axis up."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from support.observed_person import ADULT, CAMERAS, observe, standing
from support.phantoms import pose_of

from jaxskel import make_cameras
from jaxskel.body import COCO_17, KeypointSet, keypoint_set
from jaxskel.cameras import project
from jaxskel.recording import UP_AXES, rotation_to_z_up
from jaxskel.refinement.terms import GemanMcClure, Huber, Objective, PlacedBody, keypoints_term, place

WRISTS = KeypointSet("wrists", ("l", "r", "ear"), ({"l_wrist": 1.0}, {"r_wrist": 1.0}, {}))
BODY = place(ADULT, standing())
# In front, at x = -3 m, looking along +x: right in the image is -y, down is -z.
FRONT = make_cameras(
    np.array([[[100.0, 0, 50], [0, 100, 50], [0, 0, 1]]]), np.array([[[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]]),
    np.array([[0.0, 0, 3]]), (100, 100),
)  # fmt: skip


def seen_by(cameras, keypoints, body=BODY) -> np.ndarray:
    """Exact keypoints (cams, keypoints, 3) with full confidence."""
    points = keypoints.shares @ np.concatenate([body.joints, body.tips, body.origins[13:]])
    u, v, _ = project(cameras, points)
    return np.array(np.stack([u, v, np.ones_like(u)], -1))


def with_keypoints(array, **others):
    return observe(standing()).with_data(keypoints=array, **others)


@eqx.filter_jit
def rows_of(term, body, observed):
    return term.residual(body, observed, term.correspond(body, observed))


def test_a_distance_in_pixels_is_one_in_standard_deviations_at_the_keypoint():
    seen = seen_by(FRONT, WRISTS)
    wrist = BODY.origins[13]
    by_hand = 50 - 100 * wrist[1] / (wrist[0] + 3), 50 - 100 * wrist[2] / (wrist[0] + 3)
    np.testing.assert_allclose(seen[0, 0, :2], by_hand, rtol=1e-5)
    seen[0, 0, 0] += 2.0
    term = keypoints_term(FRONT, WRISTS, noise=0.1, loss=Huber(1e3))
    rows = rows_of(term, BODY, with_keypoints(seen))
    off = -2.0 * (wrist[0] + 3) / 100 / 0.1
    np.testing.assert_allclose(rows, [[off, 0], [0, 0], [0, 0]], atol=1e-3)
    # A confidence scales the cost; by Geman-McClure the cost of a distance d is d^2 / (1 + d^2 / 9).
    seen[0, 0, 2] = 0.25
    np.testing.assert_allclose((rows_of(term, BODY, with_keypoints(seen)) ** 2).sum(), off**2 / 4, rtol=1e-3)
    objective = Objective({"keypoints": keypoints_term(FRONT, WRISTS, noise=0.1, weight=2.0)})
    cost = objective.costs(BODY, with_keypoints(seen))["keypoints"]
    np.testing.assert_allclose(cost, 2 * 0.25 * off**2 / (1 + off**2 / 9), rtol=1e-3)


@pytest.mark.parametrize("gap", [(np.nan, np.nan, np.nan), (np.nan, 3.0, 1.0), (3.0, 3.0, np.nan), (3.0, 3.0, 0.0)])
def test_gaps_cost_nothing_and_leave_the_others(gap):
    wrong, lacking = seen_by(CAMERAS, COCO_17), seen_by(CAMERAS, COCO_17)
    wrong[:, :, 0] += 3.0
    lacking[:] = wrong
    lacking[2, 5:9] = gap
    term = keypoints_term(CAMERAS, COCO_17)
    rows, fewer = (np.array(rows_of(term, BODY, with_keypoints(a))).reshape(8, 17, 3) for a in (wrong, lacking))
    assert (np.abs(rows[2, 5:9]).max(-1) > 0.1).all()
    assert (fewer[2, 5:9] == 0).all()
    rows[2, 5:9] = 0
    np.testing.assert_array_equal(fewer, rows)
    assert (rows[:, :5] == 0).all()  # nose, eyes and ears


def test_what_is_behind_a_camera_or_far_outside_gives_finite_gradients():
    term, seen = keypoints_term(FRONT, WRISTS), seen_by(FRONT, WRISTS)
    observed = with_keypoints(seen)

    def cost(shift):
        moved = place(ADULT, pose_of(2))
        shifted = (points + shift[None] for points in (moved.joints, moved.tips, moved.origins))
        joints, tips, origins = shifted
        body = PlacedBody(joints, tips, moved.rotations, origins)
        return term.cost(body, observed)

    behind, at_lens, beside, near = (
        jax.jit(jax.value_and_grad(cost))(jnp.array(shift))
        for shift in ([-5.0, 0, 0], [-3.0, 0, 0], [-2.85, 80.0, 0], [0.1, 0.05, 0])
    )
    assert behind[0] == 0
    assert (behind[1] == 0).all()
    for value, gradient in (at_lens, beside, near):
        assert np.isfinite(value)
        assert np.isfinite(gradient).all()
    assert np.abs(beside[1]).max() < 1e-2  # an outlier
    assert np.abs(near[1]).max() > 0.05


@pytest.mark.parametrize("up", UP_AXES)
def test_poses_are_refined_in_a_world_with_z_up(up):
    cameras = CAMERAS.rotated(rotation_to_z_up(up).T)  # of a recording with this axis up
    seen = seen_by(CAMERAS, COCO_17)
    rows = rows_of(keypoints_term(cameras, COCO_17, up=up), BODY, with_keypoints(seen))
    np.testing.assert_allclose(rows, 0, atol=1e-3)


def test_wrong_data_and_arguments_are_refused_in_one_line(monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    wrong: list[Any] = [None, "COCO"]
    term = keypoints_term(CAMERAS, COCO_17, name="hands")
    for observed, message in (
        (with_keypoints(np.zeros((8, 17, 3))), r"observed: has no data 'hands'; give observed.with_data\(hands="),
        (
            observe(standing()).with_data(hands=np.zeros((8, 16, 3))),
            r"hands: has shape \(8, 16, 3\).*give \(8, 17, 3\)",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            term.cost(BODY, observed)
    for make, message in (
        (lambda: keypoints_term(wrong[0], COCO_17), "cameras: is a NoneType; give the recording's cameras"),
        (lambda: keypoints_term(CAMERAS, keypoint_set=wrong[1]), "keypoint_set: is a str; give a KeypointSet"),
        (lambda: keypoints_term(CAMERAS, COCO_17, up="z"), "up axis 'z'"),
        (lambda: KeypointSet("x", ("a",), ()), "points: 0 for 1 names"),
        (lambda: KeypointSet("x", ("a",), ({"wrist": 1.0},)), "points: a has 'wrist'; give some of pelvis, neck"),
        (lambda: KeypointSet("x", ("a",), ({"neck": 0.5},)), "points: shares of a sum up to 0.5"),
        (lambda: keypoint_set("x", "a b", a="belly"), "a: is 'belly'; give one of pelvis, spine"),
    ):
        with pytest.raises(ValueError, match=message):
            make()


def test_weights_noise_and_scales_are_arrays():
    terms = [
        keypoints_term(CAMERAS, COCO_17, weight=w, noise=n, loss=GemanMcClure(s))
        for w, n, s in ((1, 1, 1), (2, 0.1, 3))
    ]
    first, second = (Objective({"keypoints": term}) for term in terms)
    assert jax.tree.structure(first) == jax.tree.structure(second)
    kinds = [[(a.shape, a.dtype) for a in jax.tree.leaves(objective)] for objective in (first, second)]
    assert kinds[0] == kinds[1]
