"""Every command shows names from files and wrong numbers literally and in one line."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from support.command_line import by_itself, jaxskel
from support.own_outputs import CAMERAS, MINE
from support.poses import moving

from jaxskel import Recording, pack_silhouettes
from jaxskel._runtime.plain_text import plain
from jaxskel.camera_calibration.from_boards import BoardCalibration
from jaxskel.camera_calibration.from_silhouettes import RefinedCameras
from jaxskel.cli import _calibrate_cameras, _check, _refine_cameras
from jaxskel.cli._say import cell, say, warn
from jaxskel.io.poses import write_poses, write_trc
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.poses import score, score_table
from jaxskel.verdict import Verdict

NAMES = {
    "[red]x": "[red]x",
    "x[/b]": "x[/b]",
    ":smiley:": ":smiley:",
    "[link=http://a.b]c[/link]": "[link=http://a.b]c[/link]",
    "a\\[bold]": "a\\[bold]",
    "\x1b[2Ja": "\ufffd[2Ja",
    "a\rb\nc\td\x07": "a\ufffdb\ufffdc\ufffdd\ufffd",
    "\x9b31ma\x85": "\ufffd31ma\ufffd",
    "\u202egnp.exe\u2066": "\ufffdgnp.exe\ufffd",
    "ok\udcff": "ok\ufffd",
    "Zoë 王 \u200d": "Zoë 王 \u200d",
}


def shown(thing: object) -> str:
    """As a terminal shows it, wide enough for a line."""
    console = Console(file=io.StringIO(), width=400, force_terminal=True, color_system=None)
    console.print(thing)
    return console.file.getvalue()


@pytest.mark.parametrize(("name", "wanted"), NAMES.items())
def test_names_are_shown_as_they_stand(capsys, name, wanted):
    assert plain(name) == plain(plain(name)) == wanted
    assert shown(cell(name)) == f"{wanted}\n"
    say(name)
    warn(name)
    assert tuple(capsys.readouterr()) == (f"{wanted}\n", f"jaxskel: {wanted}\n")


@pytest.mark.parametrize(("name", "wanted"), NAMES.items())
def test_in_every_table(name, wanted):
    cameras = replace(CAMERAS, names=(name, "b", "c"))
    figures = np.ones(3)
    board = BoardCalibration(cameras, figures, figures, (), None)
    zeros = np.zeros((3, 3))
    refined = RefinedCameras(cameras, zeros, zeros, figures, figures, figures > 0, True, np.arange(1))
    truth = np.ones((2, 15, 3))
    tables = (
        _calibrate_cameras._table(board),
        _refine_cameras.refinement_table(refined),
        _check._table(
            cameras.names, np.ones((1, 3)), np.zeros((1, 3)), np.zeros((1, 3), bool), Verdict((), figures, None, 1)
        ),
        score_table({name: score(truth, truth)}),
    )
    for table in tables:
        assert wanted in shown(table)
        assert "\x1b" not in shown(table)


@pytest.mark.parametrize("name", ["\x1b[31mred", "[/b]", "ok\udcff"])
def test_in_errors_and_last_lines(tmp_path, name):
    poses, truth = tmp_path / name / "poses.npz", tmp_path / name / "none.npz"
    write_poses(tmp_path / name, moving(2))
    done = jaxskel("evaluate", poses, truth, cwd=tmp_path)
    assert done.returncode == 2
    assert f"{plain(name)}/none.npz: cannot be opened" in done.stderr
    done = jaxskel("evaluate", poses, poses, "-o", tmp_path / name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"{plain(name)}/score.json" in done.stdout
    assert plain(name) in done.stdout.replace("\n", "")
    assert jaxskel("run", tmp_path / "x", name, cwd=tmp_path).stderr.count("\x1b") == 0


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_terminal_without_the_letters_is_no_reason_to_fail(tmp_path, encoding):
    folder = tmp_path / "ok\udcff Zoë 王"
    write_poses(folder, moving(2))
    done = by_itself("export", folder / "poses.npz", folder / "a.trc", cwd=tmp_path, PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    assert "a.trc: 2 frames" in done.stdout
    assert (folder / "a.trc").exists()
    done = by_itself("export", folder / "none.npz", folder / "a.trc", cwd=tmp_path, PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_a_name_that_is_no_utf_8_can_be_written(tmp_path):
    write_trc(tmp_path / "ok\udcff.trc", moving(2))
    assert "ok\ufffd.trc".encode() in (tmp_path / "ok\udcff.trc").read_bytes()


def test_the_page_of_a_recording_whose_name_is_no_utf_8(tmp_path):
    from jaxskel.visualization.report import write_report

    masks = np.zeros((2, 3, 24, 32), bool)
    cameras = replace(CAMERAS, names=("\x1b\u202e", "b", "c"))
    recording = Recording(cameras, pack_silhouettes(masks), 29.97, "+Z", np.arange(2), name="ok\udcff")
    write_report(tmp_path / "ok\udcff.html", recording, moving(2))
    page = (tmp_path / "ok\udcff.html").read_text("utf-8")
    assert "<h1>ok\ufffd</h1>" in page
    assert "\x1b" not in page
    assert "\u202e" not in page
    assert "\\u202e" not in page


@pytest.mark.parametrize("point", [0x110000, 0x7FFFFFFF, 0xFFFFFFFF, 0xD800, 0xDFFF])
@pytest.mark.parametrize("key", ["camera_names", "up", "fps", "size"])
def test_invalid_text_is_refused(tmp_path, point, key):
    masks = np.zeros((2, 3, 24, 32), bool)
    write_recording(tmp_path / "a.npz", Recording(CAMERAS, pack_silhouettes(masks), 5.0, "+Z", np.arange(2)))
    with np.load(tmp_path / "a.npz") as file:
        arrays = dict(file)
    spoilt = np.array(["abc"] * 3 if key == "camera_names" else ["a"])
    spoilt.view(np.uint32)[0] = point
    arrays[key] = spoilt
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(ValueError, match=f"a.npz: key '{key}'") as error:
        read_recording(tmp_path / "a.npz")
    assert "\n" not in str(error.value)


SCENE, POSES = "scene.npz", "out/poses.npz"
NUMBERS = {
    ("run", SCENE, "-o", "new"): {
        "--spacing": ("nan", "inf", "0", "-1", "1e-9", "1e9", "abc"), "--smooth": ("nan", "inf", "0", "-1", "1e-9"),
        "--jobs": ("0", "-1", "10000", "9" * 400, "1.5"), "--max-misses": ("-1", "1000000", "9" * 400),
    },
    ("check", SCENE): {"--spacing": ("nan", "0"), "--max-misses": ("-1", "1000000")},
    ("view", SCENE, "--save", "new.rrd"): {"--spacing": ("nan", "0"), "--frames": ("5:1", "nan", "0:9", "9" * 5000)},
    ("report", SCENE, POSES, "-o", "new.html"): {"--limit": ("nan", "inf", "-inf", "-1", "1e300")},
    ("calibrate-body", SCENE, "-o", "new.toml"): {"--frames": ("0", "-1"), "--spacing": ("nan",)},
    ("refine-cameras", SCENE, "-o", "new.toml"): {
        "--rotation": ("nan", "inf", "0", "-1", "1e9"), "--shift": ("nan", "inf", "0", "-1", "1e9"), "--frames": ("0",),
    },
    ("calibrate-cameras", "a=a", "b=b", "--board", "9x6", "--intrinsics", "c.toml"): {
        "--square": ("nan", "inf", "0", "-1", "1e9", "1e-9"),
    },
    ("calibrate-cameras", "a=a", "b=b", "--square", "0.1", "--intrinsics", "c.toml"): {
        "--board": ("0x0", "9x", "x", "9x100000000", "-9x6", f"9x{'9' * 400}"),
    },
    ("demo", "-o", "new"): {"--frames": ("0", "-1", "1000000000"), "--cameras": ("0", "2", "1000000")},
    ("init", "rec"): {"--fps": ("nan", "inf", "0", "-1")},
}  # fmt: skip
CASES = [
    (command, option, value) for command, each in NUMBERS.items() for option, some in each.items() for value in some
]


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("numbers")
    masks = np.zeros((2, 3, 24, 32), bool)
    write_recording(place / SCENE, Recording(CAMERAS, pack_silhouettes(masks), 5.0, "+Z", np.arange(2)))
    write_poses(place / "out", moving(2))
    (place / "rec").mkdir()
    (place / "a").write_bytes(MINE)
    return place


@pytest.mark.parametrize(("command", "option", "value"), CASES, ids=lambda value: str(value)[:20])
def test_invalid_numbers_are_refused_by_the_options_name(place, command, option, value):
    if command[0] == "view":
        pytest.importorskip("rerun")
    before = sorted(path.name for path in place.iterdir())
    done = jaxskel(*command, option, value, cwd=place)
    assert done.returncode == 2, done.stdout
    assert option in done.stderr
    assert done.stderr.count("\n") == 1
    assert sorted(path.name for path in place.iterdir()) == before


@pytest.mark.parametrize("box", ["nan 0 0 1 1 1", "0 0 0 1 1 inf", "1 1 1 0 0 0", "0 0 0 1 1 0", "0 0 0 1e9 1 1"])
def test_invalid_boxes_are_refused(place, box):
    done = jaxskel("run", SCENE, "-o", "new", "--box", *box.split(), cwd=place)
    assert (done.returncode, "--box" in done.stderr, done.stderr.count("\n")) == (2, True, 1), done.stderr
