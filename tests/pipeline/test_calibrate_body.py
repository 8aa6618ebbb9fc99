"""Calibration of a body from silhouettes alone: a person of known proportions is filmed and has to be found again."""

import equinox as eqx
import jax
import numpy as np
import pytest
from population import measured
from support.people import ADULT, film_person, other_person
from support.shared_data import SEQUENCE, eight_views, needs

from jaxskel import (
    HullSettings,
    Pose,
    Settings,
    Truth,
    calibrate_body,
    default_adult,
    make_body,
    paper_settings,
    read_recording,
)
from jaxskel._math.rotations import turn_about
from jaxskel.body import BALL_NAMES, LENGTH_NAMES, QUANTITIES, SEGMENT_NAMES, Shape, lengths_of, place_joints
from jaxskel.io.recordings import write_recording
from jaxskel.io.subjects import read_body, read_subject, write_subject
from jaxskel.pipeline import STAGES
from jaxskel.pipeline._calibrate_body import _look, _turning

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def filmed():
    return film_person(other_person(), 16)[0]


@pytest.fixture(scope="module")
def stages() -> list[str]:
    return []


@pytest.fixture(scope="module")
def found(filmed, stages):
    return calibrate_body(filmed, Settings(hull=HullSettings(max_misses=0)), on_stage=stages.append)


def test_lengths_of_another_person_are_found(found):
    true, usual = lengths_of(other_person().skeleton), lengths_of(default_adult(other_person().skeleton.stature))
    measured = np.array([found.lengths[name].length for name in LENGTH_NAMES])
    off, before = np.abs(measured / true - 1), np.abs(usual / true - 1)
    bones = slice(0, 8)
    assert off[bones].max() < 0.05
    assert off[bones].mean() < 0.3 * before[bones].mean()
    np.testing.assert_allclose(lengths_of(found.skeleton), measured, atol=1e-5)
    deviations = np.array([each.deviation for each in found.lengths.values()])
    assert (deviations > 0).all()
    assert (deviations / measured).max() < 0.3


@pytest.mark.parametrize("size", [0.85, 1.15])
def test_the_size_of_the_template_does_not_count(filmed, size):
    template, _ = _look(filmed, Settings(hull=HullSettings(max_misses=0)), ADULT.scaled(size), 16)
    np.testing.assert_allclose(template.rest_joints, ADULT.scaled(template.stature / ADULT.stature).rest_joints)
    assert template.stature == pytest.approx(other_person().skeleton.stature, rel=0.04)


def test_the_body_explains_the_outlines(found):
    # The cost of a well explained frame is of the order of ten, and this person is made of the same capsules.
    assert found.costs.low <= found.costs.typical < 10
    assert found.frames == 12 or found.frames == 13


def test_stages_are_told_in_order(found, stages):
    # Searches and adjustments take turns until nothing changes any more.
    assert tuple(dict.fromkeys(stages)) == STAGES


def test_a_subjects_file_keeps_lengths_and_body(found, tmp_path):
    path = tmp_path / "subject.toml"
    write_subject(path, found.skeleton, found.body)
    np.testing.assert_allclose(lengths_of(read_subject(path)), lengths_of(found.skeleton), atol=1e-5)
    body = read_body(path)
    assert body is not None
    np.testing.assert_allclose(body.offsets, found.body.offsets, atol=1e-6)
    np.testing.assert_allclose(body.radii, found.body.radii, atol=1e-6)


def poses_with(segment: str, axis: tuple[float, float, float], angles: list[float]) -> Pose:
    """Poses at rest except for one segment, which is rotated about an axis."""
    rotations = np.tile(np.eye(3), (len(angles), 17, 1, 1))
    about = np.repeat(np.array([axis]), len(angles), 0)
    rotations[:, SEGMENT_NAMES.index(segment)] = turn_about(about, np.array(angles))
    return Pose(np.zeros((len(angles), 3)), rotations)


def test_a_bone_turns_by_the_angle_between_its_directions():
    shank = ADULT.rest_joints[11] - ADULT.rest_joints[10]
    poses = poses_with("l_shank", (0.0, 1.0, 0.0), [0.0, 0.5] * 8)
    flat = np.hypot(shank[0], shank[2]) / np.linalg.norm(shank)
    assert _turning(poses, ADULT, "shank") == pytest.approx(0.5 * flat, abs=0.03)
    assert _turning(poses, ADULT, "thigh") == pytest.approx(0.0, abs=1e-6)


def test_a_bone_that_turns_about_itself_shows_nothing():
    along = ADULT.rest_joints[4] - ADULT.rest_joints[3]
    poses = poses_with("l_upper_arm", tuple(along / np.linalg.norm(along)), [0.0, 1.0, -1.0] * 4)
    assert _turning(poses, ADULT, "upper_arm") < 1e-6


def test_too_few_frames_are_refused(filmed):
    with pytest.raises(ValueError, match=r"measured: 4 of 4 frames .* give 8 or more"):
        calibrate_body(filmed[:4], Settings(hull=HullSettings(max_misses=0)))


def test_settings_without_a_search_are_refused(filmed):
    with pytest.raises(ValueError, match="no search"):
        calibrate_body(filmed, paper_settings())


@needs(SEQUENCE)
def test_a_realistic_body_from_a_template_that_is_too_tall():
    recording = eight_views(read_recording(SEQUENCE)[::5])
    true = recording.skeleton
    assert true is not None
    found = calibrate_body(recording, skeleton=default_adult(1.08 * true.stature), frames=8)
    off = np.abs(found.skeleton.bone_lengths / true.bone_lengths - 1)
    assert off.max() < 0.06
    assert jax.tree.all(jax.tree.map(lambda a: bool(np.isfinite(a).all()), found.body))


def test_flesh_around_known_joints_is_measured(tmp_path):
    # A person made of the body's own capsules, so that the calibration must find exactly these.
    recording, motion = film_person(other_person(), 10)
    joints, tips = (np.asarray(a, np.float64) for a in place_joints(other_person().skeleton, motion))
    known = eqx.tree_at(lambda r: r.truth, recording, Truth(joints, tips))
    path = tmp_path / "person.npz"
    write_recording(path, known)
    vector = measured(path)
    shape, height = Shape.of(vector), other_person().skeleton.stature
    expected = lengths_of(other_person().skeleton) / lengths_of(default_adult(height))
    np.testing.assert_allclose(np.exp(shape.lengths)[:8], expected[:8], rtol=1e-3)
    own, average = np.asarray(other_person().radii), np.asarray(make_body(default_adult(height)).radii)
    for name in ("waist", "chest", "seat", "hip", "knee", "calf", "crown"):
        # Images are coarse: a pixel is 12 mm wide.
        ball = BALL_NAMES.index(name if name in BALL_NAMES else f"l_{name}")
        radius = average[ball] + height * vector[QUANTITIES.index(f"{name} radius")]
        assert radius == pytest.approx(own[ball], abs=0.005), name


def test_people_without_known_joints_cannot_be_measured(filmed, tmp_path):
    path = tmp_path / "person.npz"
    write_recording(path, eqx.tree_at(lambda r: r.truth, filmed, None, is_leaf=lambda leaf: leaf is None))
    with pytest.raises(ValueError, match=r"person\.npz: keys 'rest_joints', 'joints'"):
        measured(path)
