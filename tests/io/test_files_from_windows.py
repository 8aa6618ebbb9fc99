"""Files from other systems: ends of lines, a mark at the beginning, backslashes in paths; and folders with any name."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from support.recording_folders import FRAMES, a_recording, write_folder

from jaxskel import default_adult
from jaxskel.batch import find_sources
from jaxskel.io.files import named_path
from jaxskel.io.recordings import input_paths, read_recording
from jaxskel.io.subjects import read_subject, write_subject


def as_from_windows(file: Path) -> None:
    """Write a TOML file again as a person on Windows would: paths in single quotes have backslashes."""
    text = re.sub(r'"(\w+)/([^"]+)"', r"'\1\\\2'", file.read_text())
    file.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "Größe von Jürgen, 3. Versuch").mkdir()
    return tmp_path / "Größe von Jürgen, 3. Versuch"


@pytest.mark.parametrize("kind", ["folders", "archive", "video", "plate"])
def test_a_recording_from_windows_is_the_same(folder, kind):
    write_folder(folder, kind)
    (folder / "rig").mkdir()
    (folder / "calibration.toml").rename(folder / "rig" / "cameras.toml")
    file = folder / "recording.toml"
    file.write_text(file.read_text().replace('"calibration.toml"', '"rig/cameras.toml"'))
    inputs = list(input_paths(folder).values())
    as_from_windows(folder / "rig" / "cameras.toml")
    as_from_windows(file)
    assert b"'rig\\cameras.toml'" in file.read_bytes()
    read = read_recording(folder)
    np.testing.assert_array_equal(read.silhouettes[:], a_recording().silhouettes)
    assert len(read) == FRAMES
    # A batch looks at these for changes.
    assert list(input_paths(folder).values()) == inputs


def test_a_subject_from_windows_is_the_same(folder):
    write_subject(folder / "subject.toml", default_adult().scaled(0.9))
    wanted = read_subject(folder / "subject.toml")
    as_from_windows(folder / "subject.toml")
    np.testing.assert_array_equal(read_subject(folder / "subject.toml").bone_lengths, wanted.bone_lengths)


def test_a_list_of_recordings_from_windows_is_the_same(tmp_path, folder):
    write_folder(folder)
    (tmp_path / "list.txt").write_bytes("\ufeffGröße von Jürgen, 3. Versuch\\\r\n".encode())
    (source,) = find_sources([str(tmp_path / "list.txt")])
    assert source.path.samefile(folder)


@pytest.mark.skipif(os.name == "nt", reason="a backslash is no letter of a name there")
def test_a_name_with_a_backslash_is_taken_as_it_is_where_it_exists(tmp_path):
    (tmp_path / "a\\b").touch()
    assert named_path(tmp_path, "a\\b") == tmp_path / "a\\b"
    assert named_path(tmp_path, "a\\c") == tmp_path / "a" / "c"
    assert named_path(tmp_path, "a/c") == tmp_path / "a" / "c"
