"""`jaxskel doctor`: what is there, what is missing and how to mend it; and `jaxskel` alone says what to do next."""

import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import jax
import pytest
from support.command_line import by_itself, jaxskel

from jaxskel.cli import _doctor, _installed
from jaxskel.live import _cameras_here, cameras_here

NEEDS = [
    "jax>=0.8",
    "numpy>=2.0",
    "winonly>=1; sys_platform == 'nowhere'",
    'ezc3d>=1.5.19; extra == "export"',
    'websockets>=14.2; extra == "live"',
    'python-osc>=1.9; extra == "live"',
    'pytest>=8; extra == "test"',
]


@pytest.fixture
def installed(monkeypatch):
    """Versions that seem to be installed, by name."""
    versions = {"jaxskel": "0.1.0", "jax": "0.9.1", "jaxlib": "0.9.1", "numpy": "2.4", "websockets": "15.0"}

    def version(name: str) -> str:
        if name not in versions:
            raise PackageNotFoundError(name)
        return versions[name]

    class Metadata:
        @staticmethod
        def get_all(key: str) -> list[str]:
            assert key == "Provides-Extra"
            return ["export", "live", "test"]

    for module in (_doctor, _installed):
        monkeypatch.setattr(module, "version", version)
    monkeypatch.setattr(_installed, "requires", lambda name: NEEDS)
    monkeypatch.setattr(_installed, "metadata", lambda name: Metadata)
    monkeypatch.setattr("jaxskel.live.cameras_here", lambda: ["2: 640 x 480 px, 30 fps"])
    return versions


def told(done: subprocess.CompletedProcess) -> dict[str, str]:
    return dict(re.findall(r"^(\w+) {2,}(.*)$", done.stdout, re.M))


def test_it_tells_what_is_there_and_how_to_mend_the_rest(installed, tmp_path):
    done = jaxskel("doctor", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    lines = told(done)
    assert lines["jaxskel"].startswith("0.1.0 in ")
    assert lines["packages"] == "jax 0.9.1, jaxlib 0.9.1, numpy 2.4"
    assert lines["cameras"] == "2: 640 x 480 px, 30 fps"
    assert lines["export"] == 'ezc3d missing; to mend it: python -m pip install "ezc3d>=1.5.19"'
    assert lines["live"].startswith("websockets 15.0, python-osc missing")
    assert lines["live"].endswith('python -m pip install "python-osc>=1.9"')
    assert "test" not in lines
    assert "winonly" not in done.stdout


@pytest.mark.parametrize(("version", "said"), [("1.26.4", "numpy 1.26.4 .*2.0"), (None, "numpy missing")])
def test_what_everything_needs_ends_with_one(installed, tmp_path, version, said):
    installed.pop("numpy")
    if version:
        installed["numpy"] = version
    done = jaxskel("doctor", cwd=tmp_path)
    assert done.returncode == 1
    assert re.search(rf'^jaxskel: {said}.*; to mend it: python -m pip install "numpy>=2.0"$', done.stderr, re.M)


def test_a_device_that_cannot_compute_ends_with_one(installed, tmp_path, monkeypatch):
    def broken() -> None:
        raise RuntimeError("no driver\nof this name")

    monkeypatch.setattr(jax, "devices", broken)
    done = jaxskel("doctor", cwd=tmp_path)
    assert done.returncode == 1
    assert "JAX cannot compute (no driver of this name)" in done.stderr


@pytest.mark.parametrize("missing", [AttributeError, ValueError])
def test_memory_is_left_out_where_the_system_does_not_tell_it(installed, tmp_path, monkeypatch, missing):
    def unknown(name: str) -> int:
        raise missing(name)

    monkeypatch.setattr(os, "sysconf", unknown, raising=False)
    monkeypatch.setattr(_doctor, "_MEMORY_INFO", tmp_path / "none")
    assert "memory" not in told(jaxskel("doctor", cwd=tmp_path))


def test_memory_is_what_the_system_tells(installed, tmp_path, monkeypatch):
    pages = {"SC_PHYS_PAGES": 4_000_000, "SC_PAGE_SIZE": 4000}
    monkeypatch.setattr(os, "sysconf", pages.__getitem__, raising=False)
    (tmp_path / "meminfo").write_text("MemTotal: 1 kB\nMemFree: 2 kB\nMemAvailable:    5000000 kB\n")
    monkeypatch.setattr(_doctor, "_MEMORY_INFO", tmp_path / "meminfo")
    assert told(jaxskel("doctor", cwd=tmp_path))["memory"] == "16.0 GB in all, 5.1 GB free"


def test_here_all_that_the_core_needs_is_there(tmp_path):
    done = by_itself("doctor", cwd=tmp_path, JAXSKEL_NO_CACHE="", XDG_CACHE_HOME=str(tmp_path))
    assert (done.returncode, done.stderr) == (0, "")  # OpenCV's warnings of missing cameras would be there
    lines = told(done)
    assert lines["compiled"].startswith("kept in ")
    assert re.search(r": \d+ files, \d+ MB$", lines["compiled"])
    assert "cpu 0" in lines["devices"]


def test_extras_are_those_of_the_project():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = _installed.packages_of_extras()
    assert list(extras) == sorted(set(project["optional-dependencies"]) - _installed._OF_DEVELOPERS)
    assert [each.name for each in extras["live"]] == ["python-osc", "websockets"]


def test_a_camera_that_hangs_is_waited_for_no_longer_than_said(tmp_path, monkeypatch):
    script = tmp_path / "hangs.py"
    script.write_text(
        "import time\nprint('0: 640 x 480 px, 30 fps', flush=True)\nprint('noise', flush=True)\ntime.sleep(60)"
    )
    monkeypatch.setattr(_cameras_here, "__file__", str(script))
    assert cameras_here(3.0) == ["0: 640 x 480 px, 30 fps"]


def test_looking_for_cameras_loads_opencv_only(tmp_path):
    code = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='__main__'); print('jax' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code, _cameras_here.__file__], capture_output=True, text=True)
    assert done.stdout.split()[-1] == "False"


def test_without_arguments_it_says_in_five_lines_what_to_do_next(tmp_path):
    done = jaxskel(cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 5
    for command in ("demo -o", "check RECORDING", "run RECORDING", "report RECORDING", "--help", "doctor"):
        assert f"jaxskel {command}" in done.stdout


def test_the_shell_can_complete_commands(tmp_path):
    # As the script of this name calls it; the shell asks by these variables.
    code = "import sys; sys.argv[0] = 'jaxskel'; from jaxskel.cli import main; main()"
    asked = {"_JAXSKEL_COMPLETE": "complete_bash", "COMP_WORDS": "jaxskel do", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | asked, capture_output=True, text=True, timeout=120
    )
    assert done.stdout.split() == ["doctor"], done.stderr
