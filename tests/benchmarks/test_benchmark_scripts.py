"""The scripts of the benchmarks run and check what they are given."""

import json
import sys
from collections.abc import Callable
from functools import partial

import _runs
import accuracy
import cv2
import figures
import pytest
import speed
from _condition import Condition
from support.benchmark_runs import benchmark
from support.measured_runs import run_of_truth

from jaxskel import Recording, Settings, paper_settings, prepare
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import camera_ring, make_scene

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def no_body_is_looked_for(monkeypatch):
    """An average adult will do for scripts that only have to run."""
    monkeypatch.setattr(_runs, "prepare", partial(prepare, calibrate=False))


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(4)


@pytest.mark.parametrize("script", [accuracy, speed, figures])
def test_help_tells_the_command(script, monkeypatch, capsys):
    with pytest.raises(SystemExit) as end:
        run(script.main, monkeypatch, "--help")
    assert end.value.code == 0
    assert f"python benchmarks/{script.__name__}.py" in capsys.readouterr().out


def test_a_script_runs_by_its_path_from_any_folder(tmp_path):
    done = benchmark("speed.py", "--help", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "python benchmarks/speed.py" in done.stdout


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--cameras", "0,x"], "commas"),
        (["--step", "0"], "from 1 on"),
        (["--bones", "5"], "0.05 for 5 %"),
        (["--dirty", "-1"], "--dirty"),
    ],
)
def test_options_are_checked(options, complaint, monkeypatch, capsys):
    with pytest.raises(SystemExit) as end:
        run(accuracy.main, monkeypatch, "scene.npz", *options)
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err


def run(main: Callable[[], None], monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    """Run a script in this process, so that the scripts share what they compile."""
    monkeypatch.setattr(sys, "argv", ["benchmark", *map(str, arguments)])
    main()


def test_scripts_run_on_four_frames(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    # Eight of nine cameras: what eight views are reconstructed by is compiled once for all scripts.
    write_recording(tmp_path / "scene.npz", make_scene(4, cameras=camera_ring(9)))
    condition = ["--cameras", "0,1,2,3,4,5,6,7", "--step", "2"]
    run(accuracy.main, monkeypatch, "scene.npz", *condition, "--output", "all.json")
    rows, trust, within = (
        [line for line in part.splitlines() if line.startswith("|")] for part in capsys.readouterr().out.split("\n\n")
    )
    assert len(rows) == 4
    assert len(trust) == 5
    assert [row.split("|")[1].strip() for row in within[2:]] == ["all", "hands", "feet"]
    assert len({row.count("|") for row in rows}) == 1
    assert rows[2].startswith("| scene, cameras 0 1 2 3 4 5 6 7, 1 frame in 2 | 2 | 0 |")
    assert rows[3].startswith("| **all**, cameras 0 1 2 3 4 5 6 7, 1 frame in 2 | 2 | 0 |")
    written = json.loads((tmp_path / "all.json").read_text())
    assert written["condition"] == "cameras 0 1 2 3 4 5 6 7, 1 frame in 2"
    assert set(written["accuracy"]) == {"scene", "all"}
    run(accuracy.main, monkeypatch, "scene.npz", *condition, "--alone")
    assert "| **all**, cameras 0 1 2 3 4 5 6 7, 1 frame in 2, each frame alone | 2 | 0 |" in capsys.readouterr().out


def test_statures_are_counted():
    counted = accuracy.statures([1.0, 1.03, 0.9])
    assert counted == "stature: 33.3 % within 2.5 %, 66.7 % within 5 %, at most 10.0 % off (of 3)"


def test_figures_go_on_where_they_were_cut_off(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "clips" / "13_18_male.npz", scene)
    write_recording(tmp_path / "clips" / "scene.npz", scene[:2])
    clips, presets = ["clips/13_18_male.npz", "clips/scene.npz"], ["--presets", "paper,default"]
    done = []
    reconstruct_run = figures.reconstruct_run

    def cut_off(recording, settings, label):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append((recording.name, label.split()[-1]))
        return reconstruct_run(recording, settings, label)

    monkeypatch.setattr(figures, "reconstruct_run", cut_off)
    with pytest.raises(KeyboardInterrupt):
        run(figures.main, monkeypatch, *clips, *presets, "-o", "out")
    assert not (tmp_path / "out" / "table1.md").exists()
    first, done[:] = list(done), []
    run(figures.main, monkeypatch, *clips, *presets, "-o", "out")
    assert sorted(first + done) == [
        (name, preset) for name in ("13_18_male", "scene") for preset in ("default", "paper")
    ]
    assert len(done) == 1

    table = (tmp_path / "out" / "table1.md").read_text(encoding="utf-8")
    assert table in capsys.readouterr().out
    assert "| 13_18_male | 4 | 2999 | 1.2 / 1.4 / 5.4 / 4.3 |" in table
    assert "versions" not in table
    written = json.loads((tmp_path / "out" / "table1.json").read_text())
    assert written["paper"]["all"]["frames"] == 19856
    assert {preset: by["all"]["frames"] for preset, by in written["sets"]["clips"].items()} == {
        "paper": 6,
        "default": 6,
    }
    for name in ("boxplots.png", "threshold.png", "hand_distance.png"):
        picture = cv2.imread(str(tmp_path / "out" / name))
        assert picture is not None
        assert picture.std() > 5


def test_what_is_kept_is_used_only_for_what_it_was_made_from(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "clips" / "scene.npz", scene)
    source = _runs.made_from(tmp_path / "clips" / "scene.npz", Condition(), paper_settings())
    _runs.write_run(tmp_path / "out/runs/clips/scene.paper.npz", run_of_truth(scene), source)
    source = _runs.made_from(tmp_path / "clips" / "scene.npz", Condition(), Settings())
    _runs.write_run(tmp_path / "out/runs/clips/scene.default.npz", run_of_truth(scene, code="b"), source)
    run(figures.main, monkeypatch, "clips/scene.npz", "--presets", "paper,default", "-o", "out")
    table = capsys.readouterr().out
    assert "no hand_distance.png" in table
    assert "2 versions of the code (a, b)" in table
    with pytest.raises(ValueError, match="another condition"):
        run(figures.main, monkeypatch, "clips/scene.npz", "--presets", "paper,default", "-o", "out", "--step", "2")


def test_presets_are_checked(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        run(figures.main, monkeypatch, "scene.npz", "-o", "out", "--presets", "paper,good")
    assert end.value.code == 2
    assert "give some of paper,followed,default,tracked" in capsys.readouterr().err
