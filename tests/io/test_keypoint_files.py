"""Keypoints of other tools: matching to cameras and frames, gaps, people, lens distortion, damaged files."""

import json
import re
from pathlib import Path

import jaxtyping
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.files import a_recording

from jaxskel import Recording, make_cameras
from jaxskel.body import KeypointSet
from jaxskel.cameras import project
from jaxskel.io.keypoints import parse_people, read_keypoints, undistort_keypoints

TWO = KeypointSet("two", ("a", "b"), ({}, {}))
PATH = Path("cam01/7.json")


def people(*persons: list[float]) -> str:
    return json.dumps({"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": each} for each in persons]})


@pytest.fixture
def recording() -> Recording:
    """Two cameras with names of a calibration, frames 7, 8 and 9."""
    found = a_recording()
    cameras = found.cameras[:2]
    named = make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, names=("cam_1", "Cam02"))
    silhouettes = np.repeat(found.silhouettes[:1, :2], 3, 0)
    return Recording(named, silhouettes, 30.0, "+Z", np.array([7, 8, 9]))


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_cameras_frames_and_the_surest_person_are_found(tmp_path, recording):
    folder = write(
        tmp_path,
        {
            "cam01_json/cam01.0007.json": people([1, 2, 0.5, 3, 4, 0.25], [5, 6, 0.9, 7, 8, 0.9]),
            "cam01_json/cam01.0008.json": people([1, 2, 0.5, 3, 4, 0.0], []),
            "cam01_json/cam01.0100.json": "not read",
            "cam01_json/del_000000_7.json": people(),  # nobody, so it does not matter that it is of the same frame
            "CAM_2_pose/walk_000000000009_keypoints.json": people([1, 2, 1, 3, 4, 1], [9, 9, 2, 0, 0, 0]),
            "CAM_2_pose/notes.txt": "",
        },
    )
    found = read_keypoints(folder, recording, TWO)
    expected = np.full((3, 2, 2, 3), np.nan)
    expected[0, 0] = [[5, 6, 0.9], [7, 8, 0.9]]
    expected[1, 0, 0] = [1, 2, 0.5]
    expected[2, 1] = [[1, 2, 1], [3, 4, 1]]
    np.testing.assert_array_equal(found, expected)


GOOD = people([1, 2, 1, 3, 4, 1])


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({}, r"has no folders; give one for each camera, such as cam_1"),
        ({"cam3/7.json": GOOD}, r"cam3: is of no camera, or of several; name it as one of cam_1, Cam02, or remove it"),
        ({"cam1/7.json": GOOD, "cam01_json/7.json": GOOD}, "is of cam_1, as cam01_json is; keep one"),
        ({"cam1/100.json": GOOD, "cam1/12.json": GOOD}, "cam1: files are 12 to 100, but the rec.* are 7 to 9"),
        ({"cam1/a.json": GOOD}, "cam1: files are not there, but"),
        ({"cam1/a_7.json": GOOD, "cam1/b_07.json": GOOD}, "b_07.json: is of the same frame as a_7.json"),
        ({"cam1/7.json": "{"}, "7.json: is not JSON"),
        ({"cam1/8.json": people([1, 2, 1])}, r"8.json: key .people\[0\].*: holds 3 numbers, but 2 keypoints"),
    ],
)  # fmt: skip
def test_wrong_folders_are_refused_in_one_line(tmp_path, recording, files, message):
    with pytest.raises(ValueError, match=message) as told:
        read_keypoints(write(tmp_path, files), recording, TWO)
    assert "\n" not in str(told.value)


def test_no_folder_is_refused(tmp_path, recording):
    with pytest.raises(ValueError, match="nowhere: cannot be opened as a folder"):
        read_keypoints(tmp_path / "nowhere", recording, TWO)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "key 'people': is missing or no list"),
        ('{"people": 3}', "key 'people': is missing or no list"),
        ('{"people": [3]}', r"pose_keypoints_2d': is missing or no list"),
        ('{"people": [{"pose_keypoints_2d": [1, 2, true, 3, 4, 5]}]}', "holds something else than numbers"),
        ('{"people": [{"pose_keypoints_2d": [1, 2, "1", 3, 4, 5]}]}', "holds something else than numbers"),
        ('{"people": [{"pose_keypoints_2d": [1e7, 2, 1, 3, 4, 5]}]}', r"holds a number beyond 1e\+06"),
        ('{"people": [{"pose_keypoints_2d": [1, 2, Infinity, 3, 4, 5]}]}', r"holds a number beyond 1e\+06"),
        ('{"people": [{"pose_keypoints_2d": [1, 2, 1, 3, 4, 1' + "0" * 400 + "]}]}", r"holds a number beyond 1e\+06"),
        ("[" * 10_000, "lists within lists|not JSON"),
        ("[" * 30_000, "more than 20000 lists"),
        ("\x00", "is not JSON"),
    ],
)
def test_other_content_is_refused_in_one_line(text, message):
    with pytest.raises(ValueError, match=message) as told:
        parse_people(PATH, text.encode(), 2)
    assert re.match(rf"{PATH}: [^\n]*\Z", str(told.value))


VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3)
PERSON = st.fixed_dictionaries({}, optional={"pose_keypoints_2d": st.lists(VALUES, max_size=7) | VALUES})
TABLES = st.fixed_dictionaries({}, optional={"people": st.lists(PERSON | VALUES, max_size=3) | VALUES}) | VALUES


@given(st.binary(max_size=60) | TABLES.map(lambda table: json.dumps(table).encode()))
def test_any_content_is_read_or_refused_in_one_line(content):
    try:
        found = parse_people(PATH, content, 2)
    except ValueError as error:
        refusal = str(error)
    else:
        refusal = None
        assert found.shape[1:] == (2, 3)
        missing = np.isnan(found)
        assert (missing.all(-1) == missing.any(-1)).all()
        assert (found[~missing.any(-1)][:, 2] > 0).all()
        assert (np.abs(found[~missing]) <= 1e6).all()
    assert refusal is None or re.match(rf"{PATH}: [^\n]*\Z", refusal)


@given(st.lists(st.lists(st.floats(0.01, 1e6), min_size=6, max_size=6), max_size=3))
def test_what_is_written_is_read(persons):
    found = parse_people(PATH, people(*persons).encode(), 2)
    np.testing.assert_array_equal(found, np.array(persons).reshape(-1, 2, 3))


@pytest.mark.parametrize("fisheye", [False, True])
def test_undistorted_points_are_those_of_a_pinhole(fisheye, monkeypatch):
    K = np.array([[500.0, 3, 320], [0, 510, 240], [0, 0, 1]])
    pose = {"R": np.tile(np.eye(3), (2, 1, 1)), "t": np.zeros((2, 3)), "size": (640, 480)}
    dist = np.array([[0.1, -0.02, 0.003, 0.001]]) if not fisheye else np.array([[0.05, -0.01, 0.002, 0.0]])
    bent = make_cameras(np.stack([K, K]), dist=np.tile(dist, (2, 1)), fisheye=fisheye, **pose)
    straight = make_cameras(np.stack([K, K]), **pose)
    points = np.random.default_rng(0).uniform([-0.6, -0.4, 1], [0.6, 0.4, 3], (20, 3))
    images = [
        np.stack([*project(cameras, points)[:2], np.full((2, 20), 0.5)], -1)[None] for cameras in (bent, straight)
    ]
    images[0][0, 1, 4] = images[1][0, 1, 4] = np.nan
    assert np.nanmax(np.abs(images[0] - images[1])) > 1
    np.testing.assert_allclose(undistort_keypoints(images[0], bent), images[1], atol=1e-4)
    np.testing.assert_array_equal(undistort_keypoints(images[0], straight), images[0])
    # No ray of the lens gets there.
    images[0][0, 0, 0, :2] = 1e5
    lost = undistort_keypoints(images[0], bent)[0, 0, 0]
    assert np.isnan(lost).all() or np.isfinite(lost).all()
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    with pytest.raises(ValueError, match=r"keypoints: have shape \(1, 2, 20, 2\); give \(frames, 2, keypoints, 3\)"):
        undistort_keypoints(images[0][..., :2], bent)
