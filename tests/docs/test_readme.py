"""The README stays true: its Python runs, its commands are those of CI, its names exist."""

import re
import tomllib
from pathlib import Path

import pytest

from jaxskel.cli._app import app
from jaxskel.io.recordings import _folders as folders
from jaxskel.io.recordings import _view_table, write_recording
from jaxskel.poses import STATUS_NAMES
from jaxskel.synthetic import make_scene

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_python_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    first, second = re.findall(r"```python\n(.*?)```", README, re.S)
    (tmp_path / "demo").mkdir()
    write_recording(tmp_path / "demo" / "scene.npz", make_scene(4))
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(first, names)
    assert "(4, 15, 3)" in capsys.readouterr().out
    assert names["initial"].root.shape == (4, 3)
    exec(second, names)
    assert "'stick'" in capsys.readouterr().out
    for result in (names["refined"], names["free"], names["together"]):
        assert result.joints.shape == (4, 15, 3)
        assert result.finite.all()


def test_keys_of_the_recording_are_those_that_are_read():
    (text,) = re.findall(r"```toml\n(fps.*?)```", README, re.S)
    table = tomllib.loads(text)
    assert set(table) <= set(folders.KEYS)
    assert all(set(view) <= set(_view_table.KEYS) for view in table["views"].values())


def test_every_command_is_in_the_table():
    commands = [command.name or command.callback.__name__.replace("_", "-") for command in app.registered_commands]
    assert [name for name in commands if f"| `jaxskel {name} " not in README] == []


def test_every_status_is_explained():
    missing = [name for name in STATUS_NAMES if f"`{name}`" not in README]
    assert missing == []


def test_pictures_and_files_of_the_readme_exist():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


@pytest.mark.parametrize("pattern", ["'^python -m pip install \\\\. '", "'python -m pytest$'"])
def test_ci_takes_its_commands_from_the_readme(pattern):
    assert f"grep -m1 {pattern}".replace("\\\\", "\\") in (ROOT / ".ci" / "run").read_text()
    line = re.compile(pattern.strip("'").replace("\\\\", "\\"))
    assert any(line.search(row) for row in README.splitlines())
