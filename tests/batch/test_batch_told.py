"""Messages of a batch and its summary: names and problems from files are never markup or terminal commands."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console
from support.command_line import jaxskel
from support.listings import tree

from jaxskel.batch import COLUMNS, Finished, Manifest, Outcome, ResultFolder, Source
from jaxskel.batch._manifest import Work, failed
from jaxskel.cli._batch import _problems

NAMES = [
    "plain[red]",
    "x[/b]",
    "[/]",
    "\x1b[2J",
    "bell\x07",
    "a\nb",
    "\u202egpj",
    os.fsdecode(b"\xff\xfe"),
    "a\u2028b",
    "ü",
]


def manifest(name: str) -> Manifest:
    return failed(Work(f"in/{name}", {}, {}, "1"), f"in/{name}: cannot be opened")


def harmless(text: str) -> bool:
    return all(c == "\n" or (c >= " " and c not in "\x7f\u202e\u2028" and not 0xD800 <= ord(c) < 0xE000) for c in text)


def test_a_table_of_problems_shows_names_as_they_are():
    console = Console(record=True, width=200, file=open(os.devnull, "w"))
    console.print(_problems({name: manifest(name) for name in NAMES}))
    shown = console.export_text()
    console.file.close()
    assert harmless(shown)
    for name in NAMES[:3]:
        assert f"in/{name}: cannot be opened" in shown


@pytest.mark.parametrize("name", NAMES)
def test_a_line_of_progress_is_one_line(name):
    line = Finished(Source(name, Path("in", name)), manifest(name)).told(1, 2)
    assert harmless(line)
    assert "\n" not in line


def test_the_summary_shows_all_names_and_writes_them_down(tmp_path):
    out = tmp_path / "out"
    for name in NAMES:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        ResultFolder(out, name).fail(manifest(name))
    done = jaxskel("summary", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert harmless(done.stdout)
    assert (
        done.stdout.splitlines()[-1]
        == f"out/summary.csv: {len(NAMES)} recordings ({len(NAMES)} failed), 0 frames, 0 with a pose"
    )
    with open(out / "summary.csv", newline="", errors="surrogateescape") as file:
        assert {row["name"] for row in csv.DictReader(file)} == set(NAMES)


def test_the_summary_replaces_its_own_table_and_no_other(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    ResultFolder(out, "walk").fail(manifest("walk"))
    for _ in range(2):
        assert jaxskel("summary", "out", cwd=tmp_path).returncode == 0
        assert (out / "summary.csv").read_text().startswith(",".join(COLUMNS))
    for content in ("mine", ""):
        (out / "summary.csv").write_text(content)
        before = tree(tmp_path)
        done = jaxskel("summary", "out", cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr == (
            "jaxskel: out/summary.csv: was not written by jaxskel summary, which would replace it; give another "
            "--output\n"
        )
        assert tree(tmp_path) == before
    assert jaxskel("summary", "out", "-o", "all.csv", cwd=tmp_path).returncode == 0
    before = tree(tmp_path)
    assert jaxskel("summary", "out", "-o", "out/walk.failed.json", cwd=tmp_path).returncode == 2
    assert tree(tmp_path) == before


def test_manifests_of_something_else_are_no_results(tmp_path):
    ResultFolder(tmp_path / "out", "walk").fail(manifest("walk"))
    (tmp_path / "out/app").mkdir()
    (tmp_path / "out/app/manifest.json").write_text('{"name": "an app"}')
    os.mkfifo(tmp_path / "out/app/other.failed.json")
    done = jaxskel("summary", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 recordings (1 failed)" in done.stdout


def test_recordings_without_any_time_are_summed_up(tmp_path):
    nothing = replace(manifest("walk"), outcome=Outcome.NO_POSE, frames=1, seconds={"reconstruct": 0.0})
    ResultFolder(tmp_path / "out", "walk").fail(nothing)
    assert jaxskel("summary", "out", cwd=tmp_path).returncode == 0
    assert nothing.told == "1 frames, 0 with a pose"
