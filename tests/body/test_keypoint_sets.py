"""Keypoint sets: the meaning of names, and the documented places of some keypoints in each set."""

import numpy as np
import pytest

from jaxskel.body import (
    BODY_25,
    BODY_25B,
    COCO_17,
    H36M_17,
    HALPE_26,
    POINT_NAMES,
    KeypointSet,
    keypoint_set,
)

# Places as in the documentation of each: left and right wrist, right ankle, right hip.
PLACES = [
    (COCO_17, 17, (9, 10, 16, 12)),
    (BODY_25, 25, (7, 4, 11, 9)),
    (BODY_25B, 25, (9, 10, 16, 12)),
    (HALPE_26, 26, (9, 10, 16, 12)),
    (H36M_17, 17, (13, 16, 3, 1)),
]


@pytest.mark.parametrize(("keypoints", "count", "places"), PLACES, ids=lambda value: getattr(value, "name", None))
def test_keypoints_stand_in_their_place_and_are_means(keypoints: KeypointSet, count, places):
    assert len(keypoints) == count
    wanted = ("l_wrist", "r_wrist", "r_ankle", "r_hip")
    assert [keypoints.points[place] for place in places] == [{name: 1.0} for name in wanted]
    sums = keypoints.shares.sum(1)
    np.testing.assert_allclose(sums, [1.0 if points else 0.0 for points in keypoints.points])
    # Sides stay on their side: an L or R at the beginning of a name is that of its points.
    for name, points in zip(keypoints.names, keypoints.points, strict=True):
        sides = {point[:2] for point in points}
        if name[0] in "LR" and points:
            assert sides == {name[0].lower() + "_"}
        else:
            assert ("l_" in sides) == ("r_" in sides)
    lacking = [name for name, points in zip(keypoints.names, keypoints.points, strict=True) if not points]
    assert all(any(part in name for part in ("Nose", "Eye", "Ear", "SmallToe", "Heel")) for name in lacking)


def test_names_of_other_tools_have_the_same_meaning():
    kinds = (
        keypoint_set("x", "LKnee l_knee left_knee Left_Knee RBigToe right_big_toe tail"),
        keypoint_set("y", ["LKnee"]),
    )
    assert [dict(points) for points in kinds[0].points[:4]] == [{"l_knee": 1.0}] * 4
    assert kinds[0].points[4] == kinds[0].points[5] == {"r_foot": 0.4, "r_toetip": 0.6}
    assert kinds[0].points[6] == {}
    assert keypoint_set("z", "root", root="pelvis").shares[0, POINT_NAMES.index("pelvis")] == 1
