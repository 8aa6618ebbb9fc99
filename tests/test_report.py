"""The report's page as a file: its numbers are the poses, its outlines the silhouettes, its size has a limit."""

import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from unittest.mock import patch

import cv2
import equinox as eqx
import jaxtyping
import numpy as np
import pytest
from reported import FRAMES, LOST, filmed, numbers_in, poses_of, unpacked
from scenes import moved, with_masks

from jaxskel import STATUS_NAMES, Poses, Recording, project, unpack_silhouettes
from jaxskel._recording import rotation_to_z_up
from jaxskel.cli import main
from jaxskel.io import read_recording, write_poses, write_recording
from jaxskel.metrics import LIMBS
from jaxskel.report import write_report
from jaxskel.report._outlines import UNITS, display_scale, outlines
from jaxskel.report._overlays import make_overlays
from jaxskel.synthetic import camera_ring, make_scene


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


def refilled(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A mask at the size of the display: from its outlines, filled as a browser does it, and the mask itself."""
    scale = display_scale(np.array(mask.shape[::-1]))
    width, height = (round(scale * side) for side in mask.shape[::-1])
    # Eight times as fine, so that an outline of whole numbers and the width of a pixel mean what they say.
    fine, lines = np.zeros((8 * height, 8 * width), np.uint8), outlines(mask, scale)
    # In halves, because OpenCV's whole numbers are centres of pixels.
    lines = [(2 * 8 // UNITS * line - 1).astype(np.int32) for line in lines]
    cv2.fillPoly(fine, lines, 1, shift=1)
    cv2.polylines(fine, lines, True, 1, max(1, round(8 * 0.9 * scale) - 1), shift=1)
    # The share of each pixel of the display that the mask covers, in eighths as well.
    rows, columns = (np.floor((np.arange(8 * n) + 0.5) / 8 / scale).astype(int) for n in (height, width))
    true = mask[rows.clip(0, len(mask) - 1)][:, columns.clip(0, mask.shape[1] - 1)]

    def covered(shares: np.ndarray) -> np.ndarray:
        return shares.reshape(height, 8, width, 8).mean((1, 3)) > 0.5

    return covered(fine), covered(true)


@pytest.mark.parametrize("size", [(200, 160), (640, 480), (1601, 1203)])
def test_refilled_outlines_are_the_silhouettes(size):
    scene = filmed() if size == (200, 160) else make_scene(2, cameras=camera_ring(3, size=size))
    for frame in (0, len(scene) - 1):
        for view, mask in enumerate(unpack_silhouettes(scene.silhouettes[frame], size[0])):
            drawn, true = refilled(mask)
            assert (drawn & true).sum() / (drawn | true).sum() >= 0.99, (frame, view)


def test_a_hole_stays_a_hole_and_a_speck_below_a_pixel_of_the_display_is_left_out():
    mask = np.zeros((1000, 1280), bool)
    mask[200:800, 300:900] = True
    mask[400:600, 500:700] = False
    mask[50, 50] = True
    assert display_scale(np.array([1280, 1000])) == 0.5
    found = outlines(mask, 0.5)
    assert len(found) == 2
    # Pixel centre 300 is 300.5 px from the image's corner: 150.25 px of the display, in quarters.
    assert np.concatenate(found).min(axis=0).tolist() == [601, 401]
    assert all(np.abs(np.diff(line, axis=0)).max() <= 127 for line in found)
    drawn, true = refilled(mask)
    assert drawn[100:400, 150:450].sum() == pytest.approx(true[100:400, 150:450].sum(), rel=0.01)
    assert not drawn[210:290, 260:340].any()


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
        # The name of SVG's namespace is no address that anything asks for.
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


@pytest.mark.parametrize("limit", [80_000, 100_000, 200_000])
def test_however_long_the_recording_the_page_keeps_its_limit(recording, poses, tmp_path, limit):
    strides = []
    for times in (1, 4, 16):
        rows = np.tile(np.arange(FRAMES), times)
        index = np.arange(FRAMES * times)
        long = replace(recording, silhouettes=np.asarray(recording.silhouettes)[rows], frame_index=index, truth=None)
        many = replace(
            poses,
            **{k: getattr(poses, k)[rows] for k in ("joints", "tips", "confidence", "side_confidence", "status")},
            frame_index=index,
        )
        assert write_report(tmp_path / "long.html", long, many, limit=limit) <= limit
        numbers = numbers_in((tmp_path / "long.html").read_text("utf-8"))
        assert len(unpacked(numbers["points"], "<i2", -1)) == 60 * len(index)  # the skeleton plays whole
        strides.append(numbers["stride"])
        shown = numbers["shown"]
        assert shown == -(-len(index) // numbers["stride"]) or shown == 0
        drawn = unpacked(numbers["skeletons"], "<i2", shown, 4, 20, 2)
        once = make_overlays(recording, np.arange(FRAMES), np.concatenate([poses.joints, poses.tips], 1), 10**9)
        np.testing.assert_array_equal(drawn, once.skeletons[(numbers["stride"] * np.arange(shown)) % FRAMES])
    assert strides == sorted(strides)
    assert strides[-1] > 1


def test_a_limit_below_the_poses_is_an_error_and_writes_nothing(recording, poses, tmp_path):
    with pytest.raises(ValueError, match="without any silhouette, more than the limit of 0.01 MB"):
        write_report(tmp_path / "small.html", recording, poses, limit=10_000)
    assert list(tmp_path.iterdir()) == []


def test_masks_of_noise_do_not_break_the_limit(recording, poses, tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, recording.silhouettes.shape).astype(np.uint8)
    size = write_report(tmp_path / "noise.html", with_masks(recording, noise), poses, limit=90_000)
    assert size <= 90_000
    assert numbers_in((tmp_path / "noise.html").read_text("utf-8"))["shown"] == 0


def test_poses_of_some_frames_meet_the_silhouettes_of_those(recording, poses, tmp_path):
    some = replace(
        poses,
        **{
            k: getattr(poses, k)[2::3]
            for k in ("joints", "tips", "confidence", "side_confidence", "status", "frame_index")
        },
    )
    write_report(tmp_path / "some.html", recording, some)
    numbers = numbers_in((tmp_path / "some.html").read_text("utf-8"))
    counts = unpacked(numbers["counts"], "<u4", 4, 4)
    lengths = unpacked(numbers["lengths"], "<u4", -1)
    starts, steps = unpacked(numbers["starts"], "<i2", -1, 2), unpacked(numbers["steps"], "i1", -1, 2)
    outline = step = 0
    for frame, row in enumerate((2, 5, 8, 11)):
        for view in range(4):
            mask = unpack_silhouettes(recording.silhouettes[row, view], 200)
            given = outlines(mask, display_scale(recording.cameras.size[view]))
            assert counts[frame, view] == len(given)
            for line in given:
                own = steps[step : step + lengths[outline] - 1]
                np.testing.assert_array_equal(starts[outline] + np.cumsum(np.pad(own, ((1, 0), (0, 0))), 0), line)
                outline, step = outline + 1, step + lengths[outline] - 1
    assert (outline, step) == (len(starts), len(steps))


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
        ({"frame_index": np.arange(FRAMES)}, "frame 0 is not there, .* \\(12 of 12 frames\\)"),
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


def test_silhouettes_are_read_a_frame_at_a_time(recording, poses, tmp_path):
    write_recording(tmp_path / "scene.npz", recording)
    stored = read_recording(tmp_path / "scene.npz", in_memory=0)
    asked = []
    read = type(stored.silhouettes).read
    with patch.object(type(stored.silhouettes), "read", lambda self, rows: asked.append(len(rows)) or read(self, rows)):
        write_report(tmp_path / "report.html", replace(stored, name=recording.name), poses)
    assert asked == [1] * FRAMES
    write_report(tmp_path / "memory.html", replace(recording), poses)
    assert (tmp_path / "memory.html").read_bytes() == (tmp_path / "report.html").read_bytes()
