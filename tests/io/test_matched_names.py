"""Matching of views to cameras."""

import pytest

from jaxskel.io.proposals._matched_names import match_names


@pytest.mark.parametrize(
    ("views", "cameras", "matched", "by_order"),
    [
        (["cam01", "cam02"], ["cam_02", "cam_01"], ["cam_01", "cam_02"], False),
        (["Cam 1", "Cam 10"], ["cam10", "cam01"], ["cam01", "cam10"], False),
        (["video_3", "video_4"], ["GoPro4", "GoPro3", "GoPro5"], ["GoPro3", "GoPro4"], False),
        (["left", "right"], ["right", "left"], ["left", "right"], False),
        (["left_mask", "right_mask"], ["cam_right", "cam_left"], ["cam_left", "cam_right"], False),
        (["left", "right"], ["int_0", "int_1"], ["int_0", "int_1"], True),
        (["cam1", "cam2"], ["a", "b"], ["a", "b"], True),
    ],
)
def test_views_go_with_cameras_by_name_then_by_number_then_by_order(views, cameras, matched, by_order):
    match = match_names(views, cameras)
    assert match.cameras == dict(zip(views, matched, strict=True))
    assert match.by_order == by_order
    assert match.without_camera == ()


def test_what_is_left_over_is_named():
    match = match_names(["cam1", "cam2", "cam3", "cam6"], ["Cam_1", "Cam_2", "Cam_3", "Cam_4", "Cam_5"])
    assert match.cameras == {"cam1": "Cam_1", "cam2": "Cam_2", "cam3": "Cam_3"}
    assert (match.without_camera, match.without_view) == (("cam6",), ("Cam_4", "Cam_5"))


@pytest.mark.parametrize("cameras", [["int_0"], ["a", "b", "c"], ["left", "front", "back"]])
def test_names_and_numbers_that_do_not_fit_are_no_guess(cameras):
    with pytest.raises(ValueError, match=f"2 views, left, right, but {len(cameras)} cameras"):
        match_names(["left", "right"], cameras)
