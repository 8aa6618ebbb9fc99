"""Running cameras: what each sees at one time is a frame, and nobody waits for one that stops."""

import re
import time

import numpy as np
import pytest
from support.capture_rigs import CAMERAS, FPS, mask_of, write_rig

from jaxskel import read_recording, unpack_silhouettes
from jaxskel.io.recordings import has_cameras, read_rig
from jaxskel.live import Captures, Taken, WallClock


def taken(folder, takes: float = 0.0, seconds: float | None = None) -> tuple[list[Taken], list[str]]:
    """All frames of a rig, each of which is worked on for a while (s), and what was told."""
    told, found = [], []
    for frame in Captures(read_rig(folder), told.append, seconds).frames(WallClock()):
        found.append(frame)
        time.sleep(takes)
    return found, told


def same(packed: np.ndarray, camera: int, frame: int) -> bool:
    """Whether a silhouette is the block's, up to what cleaning changes at corners."""
    return (unpack_silhouettes(packed[camera], 64) != mask_of(camera, frame)).sum() <= 8


def shown(packed: np.ndarray, camera: int) -> int | None:
    """Which frame of a film a silhouette shows."""
    return next((frame for frame in range(24) if same(packed, camera, frame)), None)


def test_films_run_at_their_own_rate_and_end(tmp_path):
    start = time.monotonic()
    frames, told = taken(write_rig(tmp_path / "rig"))
    passed = time.monotonic() - start
    assert passed > 11 / FPS
    assert [frame.number for frame in frames] == sorted({frame.number for frame in frames})
    assert 6 <= len(frames) <= 12  # a busy machine may drop some
    for frame in frames:
        views = [shown(frame.silhouettes, camera) for camera in range(3)]
        assert None not in views
        assert max(views) - min(views) <= 1
    assert told == []


def test_frames_that_nobody_had_time_for_are_counted(tmp_path):
    frames, _ = taken(write_rig(tmp_path / "rig", 24), takes=0.2)
    numbers = [frame.number for frame in frames]
    assert len(frames) <= 13  # 24 frames take 1 s, in which there is time for five; some wait at the end
    assert numbers[-1] + 1 - len(frames) >= 8
    for frame in frames:  # numbers that did not count the lost ones would be 8 behind; a busy machine may be 3 behind
        assert [shown(frame.silhouettes, camera) for camera in range(3)] == pytest.approx([frame.number] * 3, abs=3)


def test_a_camera_that_ends_is_a_black_view_and_is_told(tmp_path):
    frames, told = taken(write_rig(tmp_path / "rig", (12, 4, 12)))
    assert told == [f"view {CAMERAS.names[1]}: the camera gives no more images; the view is black"]
    assert frames[0].silhouettes[1].any()
    assert not frames[-1].silhouettes[1].any()
    assert frames[-1].silhouettes[0].any()


def test_it_ends_with_its_time(tmp_path):
    frames, _ = taken(write_rig(tmp_path / "rig"), seconds=3 / FPS)
    assert 2 <= frames[-1].number <= 6  # a busy machine may be late


def test_a_colour_is_learned_from_the_first_images(tmp_path):
    folder = write_rig(tmp_path / "rig", 5, "backdrop = [30, 200, 40]")
    frames, _ = taken(folder)
    # Nothing is of that green: all of each image is the person.
    assert unpack_silhouettes(frames[0].silhouettes, 64).mean() > 0.95


def test_only_live_reads_cameras(tmp_path):
    folder = write_rig(tmp_path / "rig")
    assert has_cameras(folder)
    assert has_cameras(folder / "recording.toml")
    with pytest.raises(ValueError, match="a camera, which only `jaxskel live` reads"):
        read_recording(folder)
    text = (folder / "recording.toml").read_text()
    (folder / "recording.toml").write_text(re.sub(r"file://\S*/", "", text))
    assert not has_cameras(folder)
    assert len(read_recording(folder)) == 12
    assert not has_cameras(tmp_path / "none.npz")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: s.replace('plate = "empty.png"', "median = true", 1), "median': is known only after the recording"),
        (lambda s: s.replace('plate = "empty.png"', "offset = 3", 1), "offset': cameras are read as they run"),
        (lambda s: s.replace("fps", "frames = [0, 3]\nfps", 1), "frames': cameras have no first and last frame"),
        (lambda s: s.replace("file://", "file:///nowhere"), "views.*images': .*No such file"),
        (
            lambda s: re.sub(r"file://[^\"]*", "rtsp://127.0.0.1:9/none", s),
            "rtsp://127.0.0.1:9/none.* cannot be opened",
        ),
        (lambda s: re.sub(r'"file://[^"]*"', "99", s), "99 cannot be opened"),
        (lambda s: s.replace("images", "masks", 1), "masks': a camera gives colour images"),
    ],
)
def test_what_a_rig_cannot_have_is_named(tmp_path, change, told):
    file = write_rig(tmp_path / "rig", 3) / "recording.toml"
    file.write_text(change(file.read_text()))
    with pytest.raises(ValueError, match=told) as error:
        read_rig(file)
    assert str(error.value).startswith(str(tmp_path))
    assert "\n" not in str(error.value)


def test_a_plate_of_another_size_is_named_before_the_session(tmp_path):
    import cv2

    folder = write_rig(tmp_path / "rig", 3)
    cv2.imwrite(str(folder / "empty.png"), np.zeros((24, 32, 3), np.uint8))
    with pytest.raises(ValueError, match=f"view {CAMERAS.names[0]}: the image is 64 x 48 px but the background"):
        Captures(read_rig(folder), print)
