"""`jaxskel view` on the command line."""

import sys
from dataclasses import replace
from unittest.mock import patch

import pytest
from support.command_line import jaxskel
from support.report_page import filmed
from support.rerun_files import read

from jaxskel.io.poses import write_poses
from jaxskel.io.recordings import write_recording

EMPTY = 7


@pytest.fixture(scope="module")
def folder(recording, poses, tmp_path_factory):
    folder = tmp_path_factory.mktemp("command")
    write_recording(folder / "scene.npz", recording)
    write_poses(folder, poses)
    write_poses(folder / "other", replace(poses, fps=7.0))
    return folder


def test_the_command_writes_a_file(view, folder):
    done = jaxskel("view", "scene.npz", "poses.npz", "--frames", "3:6", "--save", "out/a.rrd", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("out/a.rrd: 3 frames, 4 views, with poses, 0.")
    assert sorted(read(folder / "out" / "a.rrd")["/status", "text"]) == [103, 104, 105]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("scene.npz", "--save", "a.html"), "jaxskel: a.html: the view is written to a file; give a name that ends"),
        (("scene.npz", "--save", "no.rrd", "--frames", "5:2"), "jaxskel: --frames 5:2: give A:B with 0 <= A < B <= 12"),
        (("scene.npz", "--save", "no.rrd", "--frames", "5:99"), "jaxskel: --frames 5:99: give A:B"),
        (("scene.npz", "--save", "no.rrd", "--frames", "5"), "jaxskel: --frames 5: give A:B"),
        (("scene.npz", "other/poses.npz", "--save", "no.rrd"), "jaxskel: scene: frames per second 5.0 but"),
    ],
)
def test_wrong_input_of_the_command_is_one_line(view, folder, arguments, why):
    done = jaxskel("view", *arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[-1].startswith(why)
    assert not (folder / "no.rrd").exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there always is a display")
def test_without_a_display_the_command_says_how_to_go_on(view, folder, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    done = jaxskel("view", "scene.npz", cwd=folder)
    assert done.returncode == 2
    assert "give --save FILE.rrd" in done.stderr
    with pytest.raises(OSError, match="no display"):
        view.show_view(filmed())


def test_without_the_viewers_package_the_command_says_how_to_get_it(folder):
    ours = {name: None for name in sys.modules if name.startswith("jaxskel.visualization.viewer")}
    with patch.dict(sys.modules):
        for name in ours:
            del sys.modules[name]
        sys.modules["rerun"] = None
        done = jaxskel("view", "scene.npz", "--save", "a.rrd", cwd=folder)
    assert done.returncode == 2
    assert done.stderr.strip() == 'jaxskel: the 3D view needs rerun, which is missing: pip install "jaxskel[view]"'
