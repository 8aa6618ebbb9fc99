"""Every reader refuses files that are not regular, in one line and at once, without waiting for data."""

import os
import re
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from jaxskel.camera_calibration.from_boards import some_frames
from jaxskel.io.calibrations import read_calibration
from jaxskel.io.files import is_ours, is_picture, open_regular, read_bounded, read_image
from jaxskel.io.mocap import read_asf_amc, read_bvh
from jaxskel.io.poses import read_poses, read_trc, read_truth
from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording
from jaxskel.io.subjects import read_subject
from jaxskel.io.views import ImageFolder, MaskArchive, Video

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no FIFOs")


@pytest.fixture(autouse=True)
def at_once() -> Iterator[None]:
    """Make a reader that waits fail, so that it does not hang the suite."""

    def late(number: int, frame: object) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, 60)  # seconds; a busy machine is slow
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


def fifo(path: Path) -> None:
    os.mkfifo(path)


def link_to_fifo(path: Path) -> None:
    os.mkfifo(path.with_name("pipe"))
    path.symlink_to("pipe")


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def listening(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end, pytest.MonkeyPatch.context() as at:
        at.chdir(path.parent)  # the path of a socket must be short
        end.bind(path.name)


def folder(path: Path) -> None:
    path.mkdir()


def loop(path: Path) -> None:
    path.symlink_to(path.name)


KINDS = {
    fifo: "a FIFO",
    link_to_fifo: "a FIFO",
    device: "a device",
    listening: "a socket",
    folder: "a folder",
    loop: "cannot be opened",
}

READERS: dict[str, Callable[[Path], object]] = {
    "clip.npz": read_recording,
    "poses.npz": read_poses,
    "truth.npz": read_truth,
    "subject.toml": read_subject,
    "clip.trc": read_trc,
    "clip.bvh": read_bvh,
    "clip.asf": lambda path: read_asf_amc(path, path),
    "clip.avi": Video,
    "board.png": lambda path: list(some_frames(path, 3)),
    "still.png": read_image,
    "masks.npz": lambda path: MaskArchive(path, "cam1"),
    **{
        f"calibration{suffix}": read_calibration
        for suffix in (".toml", ".npz", ".npy", ".json", ".yml", ".xcp", ".qca.txt", ".txt", ".xml")
    },
}


@pytest.mark.parametrize("make", KINDS)
@pytest.mark.parametrize("name", READERS)
def test_every_reader_refuses_it_in_one_line(tmp_path, make, name):
    if make is folder and name in ("clip.npz", "board.png"):
        pytest.skip("may be a folder")
    make(tmp_path / name)
    with pytest.raises(ValueError, match=re.escape(str(tmp_path / name))) as error:
        READERS[name](tmp_path / name)
    if not (make is folder and name.startswith("calibration")):  # a folder may hold one
        assert KINDS[make] in str(error.value)
    assert "\n" not in str(error.value)


RECORDING = """fps = 10
up = "+Z"
calibration = "calibration.toml"
[views.a]
masks = "a"
[views.b]
{}
"""


def write_folder(folder: Path, view: str = 'masks = "b"') -> None:
    (folder / "recording.toml").write_text(RECORDING.format(view))
    for name in "ab":
        (folder / name).mkdir()
        cv2.imwrite(str(folder / name / "0.png"), np.zeros((4, 6), np.uint8))


@pytest.mark.parametrize("make", [fifo, device])
@pytest.mark.parametrize("name", ["recording.toml", "calibration.toml", "b/0.png", "empty.png", "empty.avi"])
def test_in_a_recording_of_a_folder(tmp_path, make, name):
    write_folder(tmp_path, f'images = "b"\nplate = "{name}"' if name.startswith("empty") else 'masks = "b"')
    (tmp_path / name).unlink(missing_ok=True)
    make(tmp_path / name)
    with pytest.raises(ValueError, match=f"{name}: is {KINDS[make]}"):
        read_recording(tmp_path)


@pytest.mark.parametrize("make", [fifo, device])
def test_what_is_looked_at_by_the_way_is_left_out(tmp_path, make):
    for name in ("a.npz", "b.mp4", "c.toml", "d.png"):
        make(tmp_path / name)
    for name in ("a.npz", "c.toml", "d.png"):
        assert not is_ours(tmp_path / name)
        assert not is_picture(tmp_path / name)
    with pytest.raises(ValueError, match="calibration") as error:
        propose_recording(tmp_path)
    assert "\n" not in str(error.value)


def test_a_link_to_a_file_is_a_file(tmp_path):
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to("file")
    assert read_bounded(tmp_path / "link", 7, "a text") == b"content"
    with pytest.raises(ValueError, match="longer than 6 bytes"):
        read_bounded(tmp_path / "link", 6, "a text")


def test_a_file_that_is_exchanged_while_it_is_opened_is_looked_at_again(tmp_path, monkeypatch):
    fifo(tmp_path / "pipe")
    (tmp_path / "file").write_bytes(b"")
    innocent = os.stat(tmp_path / "file")
    monkeypatch.setattr(os, "stat", lambda path: innocent)
    with pytest.raises(ValueError, match="a FIFO"):
        open_regular(tmp_path / "pipe")


def test_images_of_a_folder_are_looked_at_when_they_are_read(tmp_path):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((4, 6), np.uint8))
    fifo(tmp_path / "1.png")
    images = ImageFolder(tmp_path)
    with pytest.raises(ValueError, match=r"1\.png: is a FIFO"):
        images.read(1)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system has no such files")
def test_a_file_of_which_the_system_does_not_know_the_length_is_read_whole():
    assert read_bounded(Path("/proc/self/status"), 1 << 20, "a text").startswith(b"Name:")
