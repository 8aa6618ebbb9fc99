"""README and pages stay true: their Python runs, their names, options, files and links exist, CI runs their commands.

What must be explained is looked for on the page that explains it.
"""

import re
import tomllib
from operator import attrgetter
from pathlib import Path

import pytest
import typer
from support.optimisations import optimised

import jaxskel
from jaxskel.cli._app import app
from jaxskel.cli._commands import NAMES, imported
from jaxskel.io.poses import read_poses
from jaxskel.io.recordings import _folders as folders
from jaxskel.io.recordings import _view_table, write_recording
from jaxskel.io.subjects import read_subject
from jaxskel.pipeline import Settings
from jaxskel.poses import STATUS_NAMES
from jaxskel.synthetic import make_scene

ROOT = Path(__file__).parents[2]
PAGES = {path.stem: path for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "notebooks").glob("*.md"))}
TEXTS = {name: path.read_text() for name, path in PAGES.items()}
README, COMMANDS, FORMATS = TEXTS["README"], TEXTS["command_line"], TEXTS["formats"]
BLOCKS = {name: re.findall(r"```python\n(.*?)```", text, re.S) for name, text in TEXTS.items()}
every_page = pytest.mark.parametrize("page", PAGES)


def run_blocks(page: str, names: dict) -> None:
    for block in BLOCKS[page]:
        with optimised("refine" not in block):  # each of these solves runs but once
            exec(block, names)


@pytest.fixture
def beside_a_demo(tmp_path, monkeypatch):
    """A folder such as `jaxskel demo -o demo` is called in."""
    (tmp_path / "demo").mkdir()
    write_recording(tmp_path / "demo" / "scene.npz", make_scene(4))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_python_of_the_readme_runs(beside_a_demo, capsys):
    run_blocks("README", names := {})
    assert "(4, 15, 3)" in capsys.readouterr().out
    assert (read_poses(beside_a_demo / "results" / "poses.npz").joints == names["poses"].joints).all()
    assert (beside_a_demo / "results" / "poses.csv").is_file()


@pytest.mark.slow
def test_python_of_the_objectives_runs(beside_a_demo, capsys):
    run_blocks("objectives", names := {})
    assert names["initial"].root.shape == (4, 3)
    assert "'stick'" in capsys.readouterr().out
    for result in (names["refined"], names["free"], names["together"]):
        assert result.joints.shape == (4, 15, 3)
        assert result.finite.all()
    assert isinstance(names["chosen"], Settings)
    assert names["by_graph"].joints.shape == (4, 15, 3)
    assert names["virtual"].silhouettes.any((2, 3)).all()


def test_python_of_the_cluster_runs(tmp_path, monkeypatch, capsys):
    # A broken recording goes all the way, and is quick.
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "broken.npz").write_text("no archive")
    monkeypatch.chdir(tmp_path)
    run_blocks("cluster", {"__name__": "__main__"})
    assert "broken" in capsys.readouterr().out
    assert (tmp_path / "poses" / "broken.failed.json").is_file()


def test_python_of_the_templates_runs(tmp_path):
    run_blocks("templates", names := {"js": jaxskel})
    assert names["settings"].template.template.name == "human-21"
    # The file that the page shows is one.
    (tmp_path / "arm.toml").write_text(re.search(r"```toml\n(.*?)```", TEXTS["templates"], re.S)[1], encoding="utf-8")
    assert jaxskel.io.read_template(tmp_path / "arm.toml").template.name == "arm"


def test_no_other_page_has_python():
    assert {page for page, blocks in BLOCKS.items() if blocks} == {
        "README", "objectives", "cluster", "templates", "people", "from_pose2sim",
    }  # fmt: skip


def test_python_of_the_people_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_blocks("people", names := {})
    assert [poses.has_pose.sum() for poses in names["poses"].values()] == [4, 4]
    assert list(names["apart"]) == ["person_1", "person_2"]
    # The tables that the page shows are those that are read.
    for text in re.findall(r"```toml\n(.*?)```", TEXTS["people"], re.S):
        assert set(tomllib.loads(text)["people"]) == {"anna", "ben"}


def test_keys_of_the_recording_are_those_that_are_read():
    (text,) = re.findall(r"```toml\n(fps.*?)```", FORMATS, re.S)
    table = tomllib.loads(text)
    assert set(table) <= set(folders.KEYS)
    assert all(set(view) <= set(_view_table.KEYS) for view in table["views"].values())
    assert [key for key in (*folders.KEYS, *_view_table.KEYS) if not re.search(rf"\b{key}\b", FORMATS)] == []


def test_the_subject_is_read(tmp_path):
    (text,) = re.findall(r"```toml\n(stature.*?)```", FORMATS, re.S)
    (tmp_path / "subject.toml").write_text(text)
    assert read_subject(tmp_path / "subject.toml").bone_lengths.shape == (14,)


@pytest.mark.parametrize("name", NAMES)
def test_every_command_is_in_the_table_and_all_its_options_on_the_page(name):
    assert re.search(rf"^\| `jaxskel {name}[ `]", README, re.M)
    (section,) = re.findall(rf"^## {name}\n(.*?)(?=^## )", COMMANDS, re.S | re.M)
    assert re.search(rf"`jaxskel {name}[ `]", section)
    options = {option for each in imported(name).params for option in each.opts if option.startswith("-")} - {"--help"}
    table = "".join(row.split(" | ")[0] for row in section.splitlines() if row.startswith("| `-"))
    assert set(re.findall(r"`(--?[\w-]+)`", table)) == options


@every_page
def test_every_option_exists(page):
    every = [each for command in (typer.main.get_command(app), *map(imported, NAMES)) for each in command.params]
    options = {option for each in every for option in each.opts}
    called = re.findall(r"\bjaxskel [a-z-]+ [^`\n]*", TEXTS[page])
    assert {option for line in called for option in re.findall(r"(?<!\S)--[a-z-]+", line)} <= options


def test_every_status_is_explained():
    missing = [name for name in STATUS_NAMES if f"| `{name}` |" not in TEXTS["conventions"]]
    assert missing == []


@every_page
def test_names_of_a_page_exist(page):
    for name in re.findall(r"(?<![\w./])(?:js|jaxskel)((?:\.[A-Za-z_]\w*)+)(?![\w/])", TEXTS[page]):
        attrgetter(name[1:])(jaxskel)


@every_page
def test_pictures_and_files_of_a_page_exist(page):
    for target in re.findall(r"\]\(([^)]+)\)", TEXTS[page]):
        file, _, heading = target.partition("#")
        if file.startswith("https://"):
            continue
        path = PAGES[page].parent / file if file else PAGES[page]
        assert path.exists(), target
        if heading:
            assert heading in headings(path.read_text()), target


def headings(text: str) -> set[str]:
    """The headings of a page, as links name them."""
    lines = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", text, flags=re.S), re.M)
    return {re.sub(r"[^\w -]", "", line.lower()).replace(" ", "-") for line in lines}


@every_page
def test_files_of_the_package_that_a_page_names_exist(page):
    for name in re.findall(r"(?<![\w./])(?:jaxskel|tests|benchmarks)/[\w./*]*\w", TEXTS[page]):
        assert list(ROOT.glob(name)), name


def test_the_readme_is_short():
    assert len(README.encode()) <= 7000


@pytest.mark.parametrize("pattern", ["'^python -m pip install \\\\. '", "'python -m pytest$'"])
def test_ci_takes_its_commands_from_the_readme(pattern):
    assert f"grep -m1 {pattern}".replace("\\\\", "\\") in (ROOT / ".ci" / "run").read_text()
    line = re.compile(pattern.strip("'").replace("\\\\", "\\"))
    assert any(line.search(row) for row in README.splitlines())
