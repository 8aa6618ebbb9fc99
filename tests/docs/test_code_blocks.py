"""Every code block of every page is one that a shell, Python or a reader takes; those of clusters run as printed.

Python runs in `test_readme.py` and `test_from_pose2sim.py`; this file has the rest.
"""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from support.command_line import jaxskel

from jaxskel.cli._commands import imported
from jaxskel.io.recordings import _folders, _rig, _view_table, has_cameras

ROOT = Path(__file__).parents[2]
TEXTS = {
    path.stem: path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "notebooks").glob("*.md")))
}
# Language, page and text of each block; what has no language is a drawing of a folder.
BLOCKS = [
    (language, page, block)
    for page, text in TEXTS.items()
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```$", text, re.S | re.M)
]


def of(*languages: str) -> list:
    return [pytest.param(*each, id=f"{each[1]}-{i}") for i, each in enumerate(BLOCKS) if each[0] in languages]


def commands_in(block: str) -> list[list[str]]:
    """The words of each call of jaxskel, wherever it stands in a line."""
    # What Snakemake puts in place of braces is a word.
    plain = re.sub(r"\{wildcards\.i\}/\{SHARDS\}", "3/100", re.sub(r"\{threads\}", "2", block)).replace(
        "{input:q}", "a.npz"
    )
    found = []
    for line in plain.replace('"$SLURM_ARRAY_TASK_ID/100"', "1/100").splitlines():
        for call in re.findall(r"(?:^|&& |exec |^\s*\")(jaxskel .*?)(?= && |\"$|$)", line):
            found.append(shlex.split(call, comments=True)[1:])
    return found


def test_every_block_is_in_a_language_that_is_checked():
    assert {language for language, _, _ in BLOCKS} == {"", "bash", "python", "toml", "snakemake"}


@pytest.mark.parametrize(("language", "page", "block"), of("bash"))
def test_a_shell_takes_it(language, page, block):
    done = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("language", "page", "block"), of("bash", "snakemake"))
def test_its_commands_take_their_arguments(language, page, block):
    calls = commands_in(block)
    assert len(calls) == len(re.findall(r"\bjaxskel [a-z]", block))
    for name, *arguments in calls:
        imported(name).make_context(name, arguments)


def test_wrong_arguments_would_be_told():
    command = imported("run")
    for wrong in (["a"], ["a", "-o", "b", "--trak"], ["a", "-o", "b", "--jobs", "many"]):
        with pytest.raises(Exception, match=r"Missing|No such option|valid integer"):
            command.make_context("run", wrong)


@pytest.mark.parametrize(("language", "page", "block"), of("python"))
def test_python_takes_it(language, page, block):
    compile(block, page, "exec")


@pytest.mark.parametrize(("language", "page", "block"), of("toml"))
def test_it_is_toml(language, page, block):
    assert tomllib.loads(block)


@pytest.mark.parametrize("page", TEXTS)
def test_extras_that_are_installed_exist(page):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = re.findall(r"(?:jaxskel|install (?:-e )?\"?\.)\[([\w,-]+)\]", TEXTS[page])
    assert {extra for names in named for extra in names.split(",")} <= set(project["optional-dependencies"])


def test_running_cameras_are_described_as_they_are_read(tmp_path):
    (block,) = [block for _, _, block in BLOCKS if "rtsp://" in block]
    (tmp_path / "recording.toml").write_text(block)
    assert has_cameras(tmp_path)
    table = tomllib.loads(block)
    assert set(table) <= set(_folders.KEYS)
    assert all(set(view) <= set(_view_table.KEYS) - set(_rig._REFUSED) for view in table["views"].values())


@pytest.fixture
def recordings(tmp_path):
    """A folder with a recording that cannot be read: it goes all the way, and is quick."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "broken.npz").write_text("no archive")
    return tmp_path


def test_commands_of_one_machine_run(recordings):
    (block,) = [block for _, page, block in BLOCKS if page == "cluster" and "--jobs 8" in block]
    batch, summary = (jaxskel(*words, cwd=recordings) for words in commands_in(block))
    assert (batch.returncode, summary.returncode) == (1, 0)  # a failure is told
    assert "broken" in batch.stdout
    assert "broken" in summary.stdout


def test_the_slurm_script_runs(recordings):
    """As the first task of its array, by a shell: to that, Slurm's options are comments."""
    (script,) = [block for _, _, block in BLOCKS if block.startswith("#!/bin/bash\n#SBATCH")]
    known = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "JAXSKEL_NO_CACHE": "1"}
    done = subprocess.run(
        ["bash"], input=script, cwd=recordings, env=known | {"SLURM_ARRAY_TASK_ID": "1"}, capture_output=True, text=True
    )
    assert done.returncode == 1, done.stderr
    assert (recordings / "poses" / "broken.failed.json").is_file()
