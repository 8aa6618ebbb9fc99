"""The wheel and the source distribution: all that runs is in them, and little else; metadata say what they are."""

import subprocess
import sys
import tarfile
import tomllib
from email.message import Message
from email.parser import Parser
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGE = {
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "jaxskel").rglob("*")
    if path.is_file() and "__pycache__" not in path.parts
}


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    # As pip does, but with the hatchling that is installed: nothing is downloaded.
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=120)
    return folder


@pytest.fixture(scope="module")
def wheel(built):
    (path,) = built.glob("*.whl")
    with ZipFile(path) as archive:
        yield archive


@pytest.fixture(scope="module")
def metadata(wheel) -> Message:
    return Parser().parsestr(wheel.read(f"jaxskel-{PROJECT['version']}.dist-info/METADATA").decode())


def test_the_wheel_holds_the_package_with_its_data_and_nothing_else(wheel):
    names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == PACKAGE
    assert {Path(name).suffix for name in names} >= {".py", ".csv", ".toml", ".js", ".txt"}


def test_the_wheel_is_for_every_machine(built):
    assert [path.name for path in built.glob("*.whl")] == [f"jaxskel-{PROJECT['version']}-py3-none-any.whl"]


def test_the_source_distribution_holds_what_tests_the_package_and_who_made_it(built):
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert names >= PACKAGE
    assert names >= {
        "README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "CONTRIBUTING.md", "pyproject.toml", "PKG-INFO",
        "tests/conftest.py", "tests/oldest.txt", "benchmarks/accuracy.py", "notebooks/accuracy.md",
    }  # fmt: skip
    tops = {name.partition("/")[0] for name in names}
    assert tops - {"jaxskel", "tests", "benchmarks", "notebooks", ".gitignore"} <= {
        "README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "CONTRIBUTING.md", "pyproject.toml", "PKG-INFO",
    }  # fmt: skip


def test_the_metadata_say_what_the_project_says(metadata, wheel):
    assert (metadata["Name"], metadata["Version"]) == ("jaxskel", PROJECT["version"])
    assert metadata["Requires-Python"] == PROJECT["requires-python"]
    assert metadata["License-Expression"] == "MIT"
    assert set(metadata.get_all("Provides-Extra")) == set(PROJECT["optional-dependencies"])
    pythons = {f"Programming Language :: Python :: 3.{minor}" for minor in (11, 12, 13)}
    assert pythons <= set(metadata.get_all("Classifier"))
    needed = [Requirement(line) for line in metadata.get_all("Requires-Dist")]
    assert {each.name for each in needed if each.marker is None} == {
        Requirement(line).name for line in PROJECT["dependencies"]
    }
    info = f"jaxskel-{PROJECT['version']}.dist-info"
    assert "jaxskel = jaxskel.cli:main" in wheel.read(f"{info}/entry_points.txt").decode()
    assert wheel.read(f"{info}/licenses/LICENSE") == (ROOT / "LICENSE").read_bytes()


def test_the_citation_and_the_changes_are_of_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"\nlicense: {PROJECT['license']}\n" in citation
    # One version after the other, this one first.
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    first = next(line for line in changes if line.startswith("## "))
    assert first.split()[1] == PROJECT["version"].partition(".dev")[0]
