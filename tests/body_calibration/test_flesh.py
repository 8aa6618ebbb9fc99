"""A calibrated body in a subject's file: kept to the micrometre, and refused in one line where it is wrong."""

import re

import numpy as np
import pytest
from support.people import other_person

from jaxskel import default_adult, make_body
from jaxskel.body import BALL_NAMES
from jaxskel.io.subjects import read_body, read_subject, write_subject


def test_files_without_flesh_have_no_body(tmp_path):
    path = tmp_path / "subject.toml"
    write_subject(path, default_adult())
    assert read_body(path) is None
    assert "flesh" not in path.read_text()


def test_round_trip_keeps_the_body(tmp_path):
    path, body = tmp_path / "subject.toml", other_person()
    write_subject(path, body.skeleton, body)
    kept = read_body(path)
    assert kept is not None
    np.testing.assert_allclose(kept.offsets, body.offsets, atol=1e-6)
    np.testing.assert_allclose(kept.radii, body.radii, atol=1e-6)
    np.testing.assert_array_equal(kept.skeleton.rest_joints, read_subject(path).rest_joints)


def test_a_ball_that_is_not_given_is_the_average(tmp_path):
    path = tmp_path / "subject.toml"
    path.write_text("stature = 1.7\n[flesh]\nl_knee = [0.01, 0, -0.02, 0.07]\n")
    body, average = read_body(path), make_body(default_adult(1.7))
    assert body is not None
    knee = BALL_NAMES.index("l_knee")
    np.testing.assert_allclose([*body.offsets[knee], body.radii[knee]], [0.01, 0, -0.02, 0.07])
    others = np.arange(len(BALL_NAMES)) != knee
    np.testing.assert_allclose(body.offsets[others], average.offsets[others], atol=1e-9)
    np.testing.assert_allclose(body.radii[others], average.radii[others], atol=1e-9)


WRONG = {
    "no table": ("flesh = 3\nstature = 1.7", "flesh", "[flesh]"),
    "no such ball": ("stature = 1.7\n[flesh]\nknee = [0, 0, 0, 0.1]", "knee", "no ball"),
    "no list": ("stature = 1.7\n[flesh]\nnape = 0.1", "nape", "radius in metres"),
    "too short": ("stature = 1.7\n[flesh]\nnape = [0, 0, 0.1]", "nape", "radius in metres"),
    "text": ("stature = 1.7\n[flesh]\nnape = [0, 0, 0, '5 cm']", "nape", "radius in metres"),
    "millimetres": ("stature = 1.7\n[flesh]\nnape = [0, 0, 12, 60]", "nape", "radius in metres"),
    "no radius": ("stature = 1.7\n[flesh]\nnape = [0, 0, 0, 0]", "nape", "radius in metres"),
    "no number": ("stature = 1.7\n[flesh]\nnape = [0, nan, 0, 0.1]", "nape", "radius in metres"),
    "huge": ("stature = 1.7\n[flesh]\nnape = [0, 0, 0, 1" + "0" * 400 + "]", "nape", "radius in metres"),
    "a truth": ("stature = 1.7\n[flesh]\nnape = [0, 0, 0, true]", "nape", "radius in metres"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_flesh_names_file_key_and_remedy(tmp_path, what):
    text, key, remedy = WRONG[what]
    path = tmp_path / "subject.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match="^" + re.escape(f"{path}: key '{key}': ")) as error:
        read_body(path)
    assert "\n" not in str(error.value)
    assert remedy in str(error.value)
