"""C3D, read by the library that laboratories use and by another one."""

import sys
import warnings
from unittest.mock import patch

import numpy as np
import pytest
from support.poses import POINT_NAMES, moving, points, posed

from jaxskel.io.poses import with_up, write_c3d
from jaxskel.io.poses._markers import to_markers
from jaxskel.recording import UP_AXES

ezc3d = pytest.importorskip("ezc3d")
TENTH_OF_MM = 1e-4


@pytest.mark.parametrize("fps", [5.0, 29.97, 120.0])
@pytest.mark.parametrize("frames", [1, 30])
def test_ezc3d_finds_the_same_points_rate_unit_and_first_frame(tmp_path, fps, frames):
    poses = moving(frames, fps, up="+Y", without=(0, 7, 29) if frames > 1 else (), start=100)
    file = ezc3d.c3d(str(write_c3d(tmp_path / "new" / "my poses.c3d", poses)))
    parameters = file["parameters"]["POINT"]
    assert parameters["LABELS"]["value"] == list(POINT_NAMES)
    assert parameters["UNITS"]["value"] == ["mm"]
    assert parameters["RATE"]["value"][0] == pytest.approx(fps, rel=1e-6)
    header = file["header"]["points"]
    assert (header["first_frame"], header["last_frame"]) == (100, 100 + frames - 1)
    found = file["data"]["points"][:3].transpose(2, 1, 0) / 1000
    np.testing.assert_allclose(found, points(poses, "+Z"), atol=TENTH_OF_MM)
    residuals = file["data"]["meta_points"]["residuals"][0].T
    np.testing.assert_array_equal(residuals == -1, np.repeat(~poses.has_pose[:, None], 20, 1))
    assert (residuals[poses.has_pose] == 0).all()


def test_another_reader_finds_the_same_points(tmp_path):
    reading = pytest.importorskip("c3d")
    poses = moving(20, 29.97, without=(4,), start=7)
    path = write_c3d(tmp_path / "poses.c3d", poses)
    with open(path, "rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns that there are no analog data
        reader = reading.Reader(file)
        # The format counts frames from 1.
        assert (reader.first_frame, reader.last_frame) == (8, 27)
        assert reader.point_rate == pytest.approx(29.97)
        assert [label.strip() for label in reader.point_labels] == list(POINT_NAMES)
        found = np.array([data for _, data, _ in reader.read_frames()])
    seen = found[..., 3] != -1
    np.testing.assert_array_equal(seen, np.repeat(poses.has_pose[:, None], 20, 1))
    np.testing.assert_allclose(found[seen][:, :3] / 1000, points(poses, "+Z")[seen], atol=TENTH_OF_MM)


@pytest.mark.parametrize("up", UP_AXES)
def test_the_up_axis_is_stated_and_true(tmp_path, up):
    poses = moving(2, up="-X")
    file = ezc3d.c3d(str(write_c3d(tmp_path / "poses.c3d", poses, up=up)))
    parameters = file["parameters"]["POINT"]
    assert parameters["Y_SCREEN"]["value"] == [up]
    across = parameters["X_SCREEN"]["value"][0]
    assert across in UP_AXES
    assert across[1] != up[1]
    assert all(f"{up} up" in text for text in parameters["DESCRIPTIONS"]["value"])
    found = file["data"]["points"][:3].transpose(2, 1, 0) / 1000
    np.testing.assert_allclose(found, to_markers(with_up(poses, up)).positions, atol=TENTH_OF_MM)


@pytest.mark.parametrize(("start", "stated"), [(0, 0), (65533, 65533), (65534, 0), (-3, 0)])
def test_a_first_frame_that_the_format_cannot_say_is_left_out(tmp_path, start, stated):
    file = ezc3d.c3d(str(write_c3d(tmp_path / "poses.c3d", moving(2, start=start))))
    header = file["header"]["points"]
    assert (header["first_frame"], header["last_frame"]) == (stated, stated + 1)
    assert file["data"]["points"].shape == (4, 20, 2)


def test_more_frames_than_the_format_can_count_are_refused(tmp_path):
    poses = moving(1)
    joints, tips = (np.repeat(part, 65536, 0) for part in (poses.joints, poses.tips))
    with pytest.raises(ValueError, match=r"poses\.c3d: 65536 frames; a C3D holds 65535 at most"):
        write_c3d(tmp_path / "poses.c3d", posed(joints, tips, 25.0, "+Z"))
    assert not list(tmp_path.iterdir())
    file = ezc3d.c3d(str(write_c3d(tmp_path / "poses.c3d", posed(joints[1:], tips[1:], 25.0, "+Z"))))
    assert file["data"]["points"].shape == (4, 20, 65535)


def test_without_ezc3d_it_says_how_to_get_it_and_writes_nothing(tmp_path):
    with patch.dict(sys.modules, {"ezc3d": None}), pytest.raises(ImportError, match=r'pip install "jaxskel\[export\]"'):
        write_c3d(tmp_path / "poses.c3d", moving(1))
    assert not list(tmp_path.iterdir())
