"""The verdict before any pose: good recordings pass, spoilt ones are named with their cause and the guilty view."""

from dataclasses import replace

import numpy as np
import pytest
from support.spoilt_rigs import (
    bumped,
    exchanged,
    good,
    inverted_extrinsics,
    late,
    masks_of,
    moved_image,
    with_cameras,
    with_masks,
    with_view,
)

from jaxskel.cameras import TURNS, ImageChange, upright, with_images_changed
from jaxskel.verdict import Severity, judge

pytestmark = pytest.mark.slow

GUILTY = 2


@pytest.fixture(scope="module")
def recording():
    return good()


@pytest.fixture(scope="module")
def few(recording):
    """Every tenth frame: faults of images or cameras show in four frames as well as in eight."""
    return recording[::10]


# Spoilt in one view: how, and a word of the cause.
ONE_VIEW = {
    "turned": (lambda r: with_view(r, GUILTY, lambda m: m[:, ::-1, ::-1]), "turned by 180 degrees"),
    "mirrored": (lambda r: with_view(r, GUILTY, lambda m: m[:, :, ::-1]), "mirrored"),
    "flipped": (lambda r: with_view(r, GUILTY, lambda m: m[:, ::-1]), "flipped"),
    "inverted": (lambda r: with_view(r, GUILTY, lambda m: ~m), "inverted"),
    "late": (lambda r: late(r, GUILTY, 3), "3 frames too late"),
    "resized": (lambda r: with_view(r, GUILTY, lambda m: moved_image(m, 0, 0, 0.75)), "resized"),
    "cropped": (lambda r: with_view(r, GUILTY, lambda m: moved_image(m, 0, -20)), "cut"),
    "bumped across": (lambda r: bumped(r, GUILTY, (0.0, 3.0, 0.0)), "moved"),
    "bumped down": (lambda r: bumped(r, GUILTY, (3.0, 0.0, 0.0)), "moved"),
}


@pytest.mark.parametrize("kind", ONE_VIEW)
def test_one_spoilt_view_is_named_with_its_cause(few, kind):
    spoil, word = ONE_VIEW[kind]
    # Only who moves shows that a view is late: the person waves first, and begins to walk then.
    (finding,) = judge(spoil(good(frames=60) if kind == "late" else few), thorough=True).findings
    assert finding.views == (few.cameras.names[GUILTY],)
    assert word in finding.told
    assert finding.severity is Severity.DOUBT  # five views are left


# Spoilt in all views: how, and a word of the cause.
ALL_VIEWS = {
    "turned": (lambda r: with_masks(r, masks_of(r)[..., ::-1, ::-1]), "turned by 180 degrees"),
    "mirrored": (lambda r: with_masks(r, masks_of(r)[..., ::-1]), "mirrored"),
    "resized": (
        lambda r: with_masks(
            r, np.stack([moved_image(m, 0, 0, 0.75) for m in masks_of(r).swapaxes(0, 1)], 1)
        ),
        "resized",
    ),
    "other order": (lambda r: with_masks(r, np.roll(masks_of(r), 1, 1)), "another order"),
    "camera to world": (inverted_extrinsics, "from the camera to the world"),
    "inverted": (lambda r: with_masks(r, ~masks_of(r)), "inverted"),
    "centimetres": (lambda r: with_cameras(r, t=100 * np.asarray(r.cameras.t)), "centimetres taken for metres"),
    "divided twice": (lambda r: with_cameras(r, t=0.001 * np.asarray(r.cameras.t)), "metres taken for millimetres"),
}  # fmt: skip


@pytest.mark.parametrize("kind", ALL_VIEWS)
def test_what_is_wrong_with_all_views_is_hopeless_and_named(few, kind):
    spoil, word = ALL_VIEWS[kind]
    verdict = judge(spoil(few))
    assert verdict.is_hopeless
    assert word in verdict.findings[0].told


def test_a_film_that_stands_still_is_named(recording):
    frozen = with_view(recording, GUILTY, lambda m: np.repeat(m[:1], len(m), 0))
    findings = judge(frozen).findings
    assert any(f.views == (recording.cameras.names[GUILTY],) and "same silhouette" in f.told for f in findings)


def test_of_five_mirrored_views_four_agree_but_all_are_named():
    recording = good(5)[::10]  # who stands still and is symmetric looks the same in a mirror
    (finding,) = judge(with_masks(recording, masks_of(recording)[..., ::-1])).findings
    assert finding.severity is Severity.HOPELESS
    assert "every view is mirrored" in finding.told


def test_several_faults_at_once_are_reported(few):
    spoilt = with_view(exchanged(few, 0, 3), 1, lambda m: m[:, :, ::-1])
    (finding,) = judge(spoilt).findings
    assert "no single view explains it" in finding.told or len(finding.views) > 1


def test_exchanged_views_are_both_named(few):
    (finding,) = judge(exchanged(few, 1, 4)).findings
    assert finding.views == (few.cameras.names[1], few.cameras.names[4])
    assert "exchanged" in finding.told


@pytest.mark.parametrize("up", ["-Z", "+X", "-Y"])
def test_an_up_axis_that_the_cameras_contradict_is_doubted_with_the_right_one(few, up):
    (finding,) = judge(replace(few, up=up)).findings
    assert finding.severity is Severity.DOUBT
    assert 'up = "+Z"' in finding.told


def test_cameras_whose_images_are_known_to_be_turned_stand_as_they_did_before(few):
    cameras, turn = few.cameras, ImageChange(turn=180)
    sizes = [(float(w), float(h)) for w, h in cameras.size]
    turned = with_images_changed(cameras, [turn] * len(cameras), sizes, cameras.size)
    images = replace(with_masks(few, masks_of(few)[..., ::-1, ::-1]), cameras=turned)
    (finding,) = judge(images).findings
    assert 'up = "-Z"' in finding.told
    known = replace(images, turns=np.full(len(cameras), 180))
    assert judge(known).findings == ()
    assert np.array_equal(known[:3].turns, known.turns)
    (finding,) = judge(replace(known, up="+X")).findings
    assert "the cameras stand upright" in finding.told


@pytest.mark.parametrize("turn", TURNS)
def test_up_before_images_were_turned_is_up_as_they_were_calibrated(recording, turn):
    cameras = recording.cameras
    sizes = [(float(w), float(h)) for w, h in cameras.size]
    turned = with_images_changed(cameras, [ImageChange(turn=turn)] * len(cameras), sizes, cameras.size)
    found = upright(turned, np.full(len(cameras), turn))
    np.testing.assert_allclose(found, upright(cameras), atol=1e-12)


@pytest.mark.parametrize("cameras", [3, 4, 8])
def test_a_good_recording_has_no_findings_whatever_its_unit(cameras):
    recording = good(cameras, 12)[::3]
    verdict = judge(recording, thorough=True)
    assert verdict.findings == ()
    assert verdict.misfit is not None
    assert verdict.misfit.max() < 0.002  # m
    # Misfits are relative to the person: another unit changes nothing but the plausibility of the sizes.
    in_feet = judge(with_cameras(recording, t=np.asarray(recording.cameras.t) / 0.3048))
    assert in_feet.misfit is not None
    np.testing.assert_allclose(in_feet.misfit * 0.3048, verdict.misfit, atol=5e-4)
    assert [finding.severity for finding in in_feet.findings] == [Severity.HOPELESS]
    assert "feet" in in_feet.findings[0].told


def test_holes_in_every_view_are_no_reason_to_refuse(few):
    masks = masks_of(few)
    rng = np.random.default_rng(0)
    for frame in masks:
        for view in frame:
            v, u = np.argwhere(view)[rng.integers(view.sum())]
            view[max(v - 6, 0) : v + 7, max(u - 6, 0) : u + 7] = False
    verdict = judge(with_masks(few, masks))
    assert not verdict.is_hopeless


def test_nobody_to_see_is_no_contradiction(recording):
    verdict = judge(with_masks(recording, np.zeros_like(masks_of(recording))))
    assert (verdict.findings, verdict.frames) == ((), 0)
    masks = masks_of(recording)
    masks[:, 1:] = False
    assert judge(with_masks(recording, masks)).findings == ()


def test_somebody_who_comes_by_for_a_moment_is_found():
    recording = good(4, 3)
    masks = np.zeros((300, *masks_of(recording).shape[1:]), bool)
    masks[150:153] = masks_of(with_view(recording, GUILTY, lambda m: m[:, ::-1]))
    verdict = judge(replace(with_masks(recording, masks), frame_index=np.arange(300)))
    assert verdict.frames == 3
    assert [finding.views for finding in verdict.findings] == [(recording.cameras.names[GUILTY],)]


def test_one_frame_is_enough(recording):
    assert judge(recording[5:6], thorough=True).findings == ()
    (finding,) = judge(with_view(recording[5:6], GUILTY, lambda m: m[:, :, ::-1])).findings
    assert finding.views == (recording.cameras.names[GUILTY],)
