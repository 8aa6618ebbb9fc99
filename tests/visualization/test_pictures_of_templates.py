"""Pictures of other skeletons than the paper's human: report, live page, viewer, drawings."""

from dataclasses import replace

import numpy as np
import pytest
from support.live_sessions import step_of
from support.report_page import FRAMES, numbers_in, unpacked
from support.rerun_files import read
from support.templates import ANIMAL, HAND, acting, animal, hand

from jaxskel import Poses, Truth, default_adult
from jaxskel.body import HUMAN_15
from jaxskel.visualization import colours_of, draw_skeleton, drawn_bones, node_labels, thickness
from jaxskel.visualization.figures import telling_frame
from jaxskel.visualization.report import live_page, write_report


@pytest.fixture(scope="module", params=[hand(), animal()], ids=["hand", "animal"])
def other(request, recording) -> Poses:
    """Poses of all frames of the recording; the silhouettes are a human's."""
    poses = acting(request.param, FRAMES, without=(2,))
    return replace(poses, fps=recording.fps, up=recording.up, frame_index=recording.frame_index)


def test_a_report_has_the_points_of_the_template(tmp_path, recording, other):
    template = other.template
    truth = Truth(other.joints + 0.01, None, template)
    write_report(tmp_path / "report.html", replace(recording, truth=truth), other)
    page = (tmp_path / "report.html").read_text()
    numbers = numbers_in(page)
    assert numbers["joints"] == list(template.joint_names)
    assert numbers["tips"] == list(template.tip_names)
    assert numbers["parents"] == template.point_parents.tolist()
    assert numbers["truth_joints"] == list(range(len(template.joint_names)))
    steps = unpacked(numbers["points"], "<i2", FRAMES, len(template.point_names), 3)
    found = np.array(numbers["origin"]) + numbers["step"] * steps[0]
    np.testing.assert_allclose(found, np.concatenate([other.joints[0], other.tips[0]]), atol=numbers["step"])
    assert f"{template.joint_names[0]} to {template.joint_names[1]}" in page
    assert "Hand and foot turn" not in page
    assert ("atlas" in template.pivot_names) == ("Bones that end in head turn" in page)
    assert f"all {len(template.joint_names)} right" in page
    # Bones of a hand are thinner than those of a human.
    assert 0 < numbers["bone"] < (0.015 if template == HAND else 0.1)


def test_a_report_scores_by_name_and_shows_what_truth_there_is(tmp_path, recording, other):
    write_report(tmp_path / "report.html", recording, other)
    page, common = (tmp_path / "report.html").read_text(), set(HUMAN_15.joint_names) & set(other.template.joint_names)
    numbers = numbers_in(page)
    assert {numbers["joints"][joint] for joint in numbers["truth_joints"]} == common
    assert ("Not scored, because only one has it: chest, neck" in page) == (other.template == ANIMAL)
    assert ("<h2>Score" in page) == bool(common)
    steps = unpacked(numbers["truth"], "<i2", FRAMES, len(other.template.point_names), 3)
    for i, name in enumerate(numbers["joints"]):
        assert (steps[0, i, 0] == numbers["unseen"]) == (name not in common)


def test_the_live_page_shows_the_subject(recording, other):
    page = live_page(recording, other.skeleton, ("127.0.0.1:8000",))
    assert numbers_in(page.html)["joints"] == list(other.template.joint_names)
    assert "wrist" in page.html or "chest" in page.html
    assert '"number":100' in page.message(step_of(other, 0), "told")
    assert numbers_in(live_page(recording, None, ("127.0.0.1:8000",)).html)["bone"] == 0.045


def test_the_view_shows_bones_by_their_names(view, recording, other, tmp_path):
    view.save_view(tmp_path / "a.rrd", recording, other, frames=slice(0, 1))
    found = read(tmp_path / "a.rrd")
    assert found["/world/skeleton/joints", "labels"][100] == list(other.template.point_names)
    assert len(found["/world/skeleton/bones", "strips"][100]) == len(other.template.point_names) - 1
    assert max(found["/world/skeleton/joints", "radii"][100]) < (0.006 if other.template == HAND else 0.04)


def test_bones_are_drawn_over_an_image(recording, other):
    image = np.zeros((160, 200, 3), np.uint8)
    joints = other.joints[0].astype(np.float64) + recording.truth.joints[0, 0] - other.joints[0, 0]
    draw_skeleton(image, recording.cameras, 1, joints, other.template)
    assert image.any()


def test_sides_have_their_colours_and_bones_their_ends():
    colours, names = colours_of(ANIMAL), ANIMAL.point_names
    assert (colours[names.index("l_knee")] == colours[names.index("l_hindpaw")]).all()
    assert (colours[names.index("l_knee")] != colours[names.index("r_knee")]).any()
    assert len(np.unique(colours_of(HAND), axis=0)) == 1
    assert [names[i] for i in drawn_bones(ANIMAL)[2]] == ["l_elbow", "chest"]
    assert node_labels(ANIMAL)[:2] == ("head", "left elbow")
    assert node_labels(HUMAN_15) == (
        "head", "left hand", "right hand", "left foot", "right foot", "pelvis", "neck"
    )  # fmt: skip
    adult = default_adult()
    assert thickness(HUMAN_15, np.concatenate([adult.rest_joints, adult.rest_tips])[None]) == 1.0


def test_the_telling_frame_has_every_tip_far_from_the_trunk():
    poses = acting(hand(), without=(3,))
    ends = [poses.template.tip_parents[tip] for tip in range(3)]
    away = np.linalg.norm(poses.joints[:, ends] - poses.joints[:, :1], axis=-1).min(1)
    assert telling_frame(poses) == np.nanargmax(away)
