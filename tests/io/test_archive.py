"""Archives that are truncated, inconsistent or not archives: refused in one line, and never executed."""

import io
import os
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.files import CAMS, HEIGHT, a_recording, arrays_of, recording_file, refused

from jaxskel.io.poses import read_poses, read_truth
from jaxskel.io.recordings import read_recording, write_recording


@pytest.fixture
def clip(tmp_path):
    return recording_file(tmp_path)


NOT_ARCHIVES = {
    "empty": b"",
    "text": b"frame,joint\n1,2\n",
    "npy": b"\x93NUMPY\x01\x00",
    "pickle": pickle.dumps({"K": 1}),
    "empty zip": b"PK\x05\x06" + bytes(18),
}


@pytest.mark.parametrize("what", NOT_ARCHIVES)
@pytest.mark.parametrize("read", [read_recording, read_poses, read_truth])
def test_not_an_archive(tmp_path, read, what):
    path = tmp_path / "clip.npz"
    path.write_bytes(NOT_ARCHIVES[what])
    refused(read, path)


@pytest.mark.parametrize("read", [read_recording, read_poses, read_truth])
def test_no_file(tmp_path, read):
    refused(read, tmp_path / "none.npz", "check the path")
    refused(read, tmp_path, "jaxskel init" if read is read_recording else "check the path")


def test_truncated_archive(clip):
    clip.write_bytes(clip.read_bytes()[:-30])
    refused(read_recording, clip, "truncated")


def npy(shape: tuple[int, ...], content: bytes) -> bytes:
    """An array of bytes whose header claims a shape."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "|u1", "fortran_order": False, "shape": shape})
    return file.getvalue() + content


def replace_member(path: Path, key: str, content: bytes) -> None:
    with zipfile.ZipFile(path) as old:
        members = {name: old.read(name) for name in old.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name, data in (members | {f"{key}.npy": content}).items():
            new.writestr(name, data)


@pytest.mark.parametrize("frames", [3, 10**9, 10**30])
def test_header_that_claims_more_than_is_there(clip, frames):
    replace_member(clip, "silhouettes", npy((frames, CAMS, HEIGHT, 3), bytes(2 * CAMS * HEIGHT * 3)))
    refused(read_recording, clip, f"key 'silhouettes': claims shape ({frames}, ", "but holds 216 bytes")


@pytest.mark.parametrize("size", [10**9, 2**40])
def test_directory_that_claims_more_than_is_there(clip, size):
    # The array header and the zip directory agree on a size that the compressed bytes cannot hold.
    frames = size // (CAMS * HEIGHT * 3)
    header = npy((frames, CAMS, HEIGHT, 3), b"")
    replace_member(clip, "silhouettes", header)
    claimed = len(header) + frames * CAMS * HEIGHT * 3
    with zipfile.ZipFile(clip, "a") as archive:
        archive.getinfo("silhouettes.npy").file_size = claimed
        archive._didModify = True  # write the directory again, with the wrong size
    refused(read_recording, clip, f"key 'silhouettes': claims {claimed} bytes that the file cannot hold")


def test_directory_that_claims_more_than_the_file_is_long(clip):
    np.savez(clip, **arrays_of(clip))  # stored uncompressed: both sizes of a member are the same
    with zipfile.ZipFile(clip, "a") as archive:
        member = archive.getinfo("K.npy")
        member.file_size = member.compress_size = 10**9
        archive._didModify = True
    refused(read_recording, clip, "key 'K': claims 1000000000 bytes that the file cannot hold")


def test_member_that_is_no_array(clip):
    replace_member(clip, "K", b"not an array")
    refused(read_recording, clip, "key 'K': is not a NumPy array")


class Bomb:
    """Unpickling this makes a folder."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


def test_pickles_are_never_run(clip, tmp_path):
    trap = tmp_path / "sprung"
    held = io.BytesIO()
    np.save(held, np.array([Bomb(str(trap))], object))
    for content in (held.getvalue(), pickle.dumps(Bomb(str(trap)))):
        for key in ("K", "camera_names", "joints"):
            write_recording(clip, a_recording())
            replace_member(clip, key, content)
            for read in (read_recording, read_truth):
                if (read, key) == (read_truth, "K") or (read, key) == (read_truth, "camera_names"):
                    continue  # not read, so not refused
                refused(read, clip, f"key '{key}'")
    assert not trap.exists()


def test_broken_write_leaves_the_old_file(clip, monkeypatch):
    before = clip.read_bytes()
    folder = sorted(clip.parent.iterdir())

    def broken(file, **arrays):
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", broken)
    with pytest.raises(OSError, match="disk full"):
        write_recording(clip, a_recording())
    assert clip.read_bytes() == before
    assert sorted(clip.parent.iterdir()) == folder
