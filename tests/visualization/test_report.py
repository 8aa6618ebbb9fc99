"""The report's page as a file: its numbers are the poses, its outlines the silhouettes, its size has a limit."""

import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from importlib.resources import files
from unittest.mock import patch

import equinox as eqx
import jaxtyping
import numpy as np
import pytest
from support.recordings import moved
from support.report_page import FRAMES, LOST, filmed, numbers_in, poses_of, unpacked

from jaxskel import Poses, Recording
from jaxskel.cameras import project
from jaxskel.cli._app import main
from jaxskel.io.poses import write_poses
from jaxskel.io.recordings import write_recording
from jaxskel.poses import LIMBS, STATUS_NAMES
from jaxskel.recording import rotation_to_z_up
from jaxskel.visualization import LEFT, RIGHT
from jaxskel.visualization.report import write_report
from jaxskel.visualization.report._outlines import UNITS


@pytest.fixture(scope="module")
def recording() -> Recording:
    return filmed()


@pytest.fixture(scope="module")
def poses(recording) -> Poses:
    return poses_of(recording)


@pytest.fixture(scope="module")
def page(recording, poses, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    size = write_report(path, recording, poses)
    assert size == path.stat().st_size
    return path.read_text("utf-8")


def points_in(numbers: dict, key: str = "points") -> np.ndarray:
    steps = unpacked(numbers[key], "<i2", numbers["frames"], 20, 3)
    return np.where(steps == numbers["unseen"], np.nan, np.array(numbers["origin"]) + numbers["step"] * steps)


def test_the_numbers_of_the_page_are_the_poses(page, poses, recording):
    numbers = numbers_in(page)
    shown = points_in(numbers)
    assert np.isnan(shown[LOST]).all()
    given = np.concatenate([poses.joints, poses.tips], axis=1)
    assert np.nanmax(np.abs(shown - given)) <= numbers["step"] / 2 + 1e-6
    assert numbers["step"] == 1e-4  # nobody walks farther than 6.5 m here
    np.testing.assert_array_equal(np.isnan(shown), np.isnan(given))
    confidence = unpacked(numbers["confidence"], "u1", FRAMES, 15) / 255
    assert np.abs(confidence - poses.confidence).max() <= 0.5 / 255 + 1e-6
    sides = unpacked(numbers["side_confidence"], "u1", FRAMES) / 255
    assert np.abs(sides - poses.side_confidence).max() <= 0.5 / 255 + 1e-6
    assert [numbers["statuses"][s] for s in unpacked(numbers["status"], "u1", FRAMES)] == [
        STATUS_NAMES[s] for s in poses.status
    ]
    assert unpacked(numbers["frame_index"], "<f8", FRAMES).tolist() == list(range(100, 100 + FRAMES))
    assert np.nanmax(np.abs(points_in(numbers, "truth")[:, :15] - recording.truth.joints)) <= numbers["step"] / 2 + 1e-6


def test_the_views_show_the_projection_with_the_lens(page, poses, recording):
    numbers = numbers_in(page)
    drawn = unpacked(numbers["skeletons"], "<i2", FRAMES, 4, 20, 2)
    assert (drawn[LOST] == numbers["unseen"]).all()
    straight = eqx.tree_at(lambda c: c.dist, recording.cameras, np.zeros((4, 8)))
    for frame in (0, FRAMES - 1):
        u, v, _ = project(recording.cameras, np.float64(poses.joints[frame]))
        scale = np.array([view["scale"] for view in numbers["views"]])[:, None, None]
        assert np.abs(drawn[frame, :, :15] / scale - 0.5 - np.stack([u, v], -1)).max() <= 0.5 / UNITS + 1e-6
    # The lens of the first view does show.
    bent, unbent = (
        np.array(project(cameras, np.float64(poses.joints[0]))[:2]) for cameras in (recording.cameras, straight)
    )
    assert np.abs(bent - unbent)[:, 0].max() > 2 / UNITS


def test_a_world_with_another_up_axis_looks_the_same(recording, poses, tmp_path):
    turn = rotation_to_z_up("-Y").T  # from z up to -Y up
    other = moved(recording, turn, np.zeros(3), "-Y")
    truth = eqx.tree_at(lambda t: (t.joints, t.tips), recording.truth, (recording.truth.joints @ turn.T,) * 1 + (None,))
    other = eqx.tree_at(lambda r: (r.frame_index, r.truth), other, (recording.frame_index, truth))
    turned = replace(
        poses, joints=poses.joints @ turn.T.astype(np.float32), tips=poses.tips @ turn.T.astype(np.float32), up="-Y"
    )
    write_report(tmp_path / "a.html", recording, poses)
    write_report(tmp_path / "b.html", other, turned)
    mine, theirs = (numbers_in((tmp_path / name).read_text("utf-8")) for name in ("a.html", "b.html"))
    np.testing.assert_allclose(points_in(mine), points_in(theirs), atol=1.1e-4)
    np.testing.assert_allclose(mine["cameras"], theirs["cameras"], atol=1e-4)
    assert (mine["up"], theirs["up"]) == ("+Z", "-Y")


def test_steps_grow_where_people_walk_far(recording, poses, tmp_path):
    far = poses.joints.copy()
    far[-1, :, 0] += 60
    write_report(tmp_path / "far.html", recording, replace(poses, joints=far))
    numbers = numbers_in((tmp_path / "far.html").read_text("utf-8"))
    shown = points_in(numbers)
    assert 1e-4 < numbers["step"] < 1.1e-3
    assert np.nanmax(np.abs(shown[:, :15] - far)) <= numbers["step"] / 2 + 1e-5


@pytest.mark.parametrize(
    "name", ["</script><script>alert(1)</script>", "<!--<script>", "a & b \"c\" 'd' $title ${data}"]
)
def test_no_name_can_break_the_page(recording, poses, tmp_path, name):
    cameras = replace(recording.cameras, names=(name, "b", "c", "d"))
    named = eqx.tree_at(lambda r: (r.name, r.cameras), recording, (name, cameras))
    write_report(tmp_path / "named.html", named, poses)
    page = (tmp_path / "named.html").read_text("utf-8")
    numbers = numbers_in(page)
    assert (numbers["name"], numbers["views"][0]["name"]) == (name, name)
    assert page.count("<script") == page.count("</script>") == 2
    assert "<!--" not in page
    assert "alert(1)</script><" not in page


def test_nothing_of_the_page_is_fetched(page):
    assert "default-src 'none'" in page
    assert "unsafe" not in page
    for words in ("src=", "href=", "@import", "url(", "fetch(", "XMLHttpRequest", "http://", "https://"):
        # The name of SVG's namespace is not fetched.
        assert words not in page.replace("http://www.w3.org/2000/svg", ""), words


def test_score_only_where_there_is_truth(page, recording, poses, tmp_path):
    assert "<h2>Score</h2>" in page
    assert all(limb in page for limb in LIMBS)
    unknown = eqx.tree_at(lambda r: r.truth.joints, recording, np.full((FRAMES, 15, 3), np.nan))
    for without in (replace(recording, truth=None), unknown):
        write_report(tmp_path / "without.html", without, poses)
        text = (tmp_path / "without.html").read_text("utf-8")
        assert "<h2>Score</h2>" not in text
        assert numbers_in(text)["truth"] is None


def test_bone_lengths_of_the_page(page, recording, poses):
    there = poses.joints[poses.has_pose].astype(float)
    thigh = np.median(1000 * np.linalg.norm(there[:, 10] - there[:, 9], axis=1))
    own = 1000 * recording.skeleton.bone_lengths[9]
    row = page[page.index("l_hip to l_knee") :].split("</tr>")[0]
    assert f"<td>{thigh:.0f}</td>" in row
    assert row.endswith(f"<td>{own:.0f}</td>")


def test_no_pose_at_all_is_a_page_too(recording, poses, tmp_path):
    nothing = replace(
        poses, joints=np.full_like(poses.joints, np.nan), tips=np.full_like(poses.tips, np.nan),
        status=np.full(FRAMES, STATUS_NAMES.index("no_hull")),
    )  # fmt: skip
    write_report(tmp_path / "none.html", recording, nothing)
    assert "No frame has a pose." in (tmp_path / "none.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"up": "+Y"}, "up \\+Z but the poses have \\+Y"),
        ({"fps": 7.0}, "frames per second 5.0 but the poses have 7.0"),
        ({"frame_index": np.arange(FRAMES)}, "frame 0 is missing, .* \\(12 of 12 frames are missing\\)"),
    ],
)
def test_poses_of_another_recording_are_refused(recording, poses, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        write_report(tmp_path / "no.html", recording, replace(poses, **change))
    assert list(tmp_path.iterdir()) == []


def test_the_command(recording, poses, tmp_path, monkeypatch):
    write_recording(tmp_path / "scene.npz", recording)
    write_poses(tmp_path, poses)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("JAXSKEL_NO_CACHE", "1")
    for arguments, code, line in (
        (["scene.npz", "poses.npz", "-o", "out/page.html"], 0, "out/page.html: 12 frames, 4 views, 0.1 MB"),
        (["scene.npz", "poses.npz", "-o", "out"], 2, "jaxskel: out: the output must be a file"),
        (["scene.npz", "poses.npz", "--limit", "0.01"], 2, "jaxskel: report: 12 frames take 0.0"),
        (["poses.npz", "poses.npz"], 2, "jaxskel: poses.npz: "),
    ):
        out, err, ended = io.StringIO(), io.StringIO(), 0
        # As for a user, shapes are not checked.
        unchecked = patch.object(jaxtyping.config, "jaxtyping_disable", True)
        command = patch("sys.argv", ["jaxskel", "report", *arguments])
        with unchecked, command, redirect_stdout(out), redirect_stderr(err):
            try:
                main()
            except SystemExit as end:
                ended = end.code or 0
        assert ended == code, err.getvalue()
        said = out.getvalue() if code == 0 else err.getvalue().splitlines()[-1]
        assert said.startswith(line)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "poses.csv", "poses.npz", "scene.npz"]


def test_the_page_has_the_colours_of_the_other_pictures():
    style = files("jaxskel.visualization.report").joinpath("style.css").read_text(encoding="utf-8")
    for name, colour in (("left", LEFT), ("right", RIGHT)):
        assert f"--{name}: #{bytes(colour).hex()};" in style


def test_covariances_are_in_the_page(recording, poses, tmp_path):
    rng = np.random.default_rng(0)
    factors = rng.normal(scale=0.03, size=(FRAMES, 15, 3, 3))
    covariance = factors @ np.swapaxes(factors, -1, -2) + 1e-4 * np.eye(3)
    covariance[LOST] = np.nan
    write_report(tmp_path / "spread.html", recording, replace(poses, covariance=covariance.astype(np.float32)))
    numbers = numbers_in((tmp_path / "spread.html").read_text("utf-8"))
    lower = numbers["spread_step"] * unpacked(numbers["spread"], "<i2", FRAMES, 15, 6)
    found = np.zeros((FRAMES, 15, 3, 3))
    found[..., *np.tril_indices(3)] = lower
    assert (found[LOST] == 0).all()
    rest = np.arange(FRAMES) != LOST
    turn = rotation_to_z_up(poses.up)
    wanted = turn @ covariance[rest] @ turn.T
    # Half a step of 0.1 mm in each factor of up to some decimetres.
    np.testing.assert_allclose((found @ np.swapaxes(found, -1, -2))[rest], wanted, atol=5e-5)


def test_without_covariances_the_page_says_nothing_of_them(page):
    assert numbers_in(page)["spread"] is None
