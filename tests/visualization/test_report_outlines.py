"""Outlines in the report are the silhouettes, of as many frames as its limit of bytes has room for."""

from dataclasses import replace
from unittest.mock import patch

import cv2
import numpy as np
import pytest
from support.recordings import with_masks
from support.report_page import FRAMES, filmed, numbers_in, poses_of, unpacked

from jaxskel import Poses, Recording, unpack_silhouettes
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.synthetic import camera_ring, make_scene
from jaxskel.visualization.report import write_report
from jaxskel.visualization.report._outlines import UNITS, display_scale, outlines
from jaxskel.visualization.report._overlays import make_overlays


@pytest.fixture(scope="module")
def recording() -> Recording:
    return filmed()


@pytest.fixture(scope="module")
def poses(recording) -> Poses:
    return poses_of(recording)


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
            assert (drawn & true).sum() / (drawn | true).sum() > 0.985, (frame, view)


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


@pytest.mark.parametrize("more", [40_000, 60_000, 160_000])
def test_however_long_the_recording_the_page_keeps_its_limit(recording, poses, tmp_path, more):
    # More than the short recording takes; the poses of the longest take 35 kB more.
    limit, strides = write_report(tmp_path / "short.html", recording, poses) + more, []
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
        shown = numbers["shown"]
        strides.append(numbers["stride"] if shown else np.inf)
        assert shown == -(-len(index) // numbers["stride"]) or shown == 0
        drawn = unpacked(numbers["skeletons"], "<i2", shown, 4, 20, 2)
        once = make_overlays(recording, np.arange(FRAMES), np.concatenate([poses.joints, poses.tips], 1)[None], 10**9)
        np.testing.assert_array_equal(drawn, once.skeletons[0, (numbers["stride"] * np.arange(shown)) % FRAMES])
    assert strides == sorted(strides)
    assert strides[-1] > 1


def test_a_limit_below_the_poses_is_an_error_and_writes_nothing(recording, poses, tmp_path):
    with pytest.raises(ValueError, match="without any silhouette, more than the limit of 0.01 MB"):
        write_report(tmp_path / "small.html", recording, poses, limit=10_000)
    assert list(tmp_path.iterdir()) == []


def test_masks_of_noise_do_not_break_the_limit(recording, poses, tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, recording.silhouettes.shape).astype(np.uint8)
    limit = write_report(tmp_path / "clean.html", recording, poses)
    assert write_report(tmp_path / "noise.html", with_masks(recording, noise), poses, limit=limit) <= limit
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
