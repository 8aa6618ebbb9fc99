"""The laws of the house: data flows one way, rooms meet at their faces, and no file or room is too large."""

import ast
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1] / "jaxskel"
TESTS = Path(__file__).parent
FILES = sorted(HOUSE.rglob("*.py"))
ROOMS = sorted({path.parent for path in FILES} - {HOUSE})
# Rooms without a face: all rooms may import their files directly.
OPEN = ("jaxskel._math", "jaxskel._runtime")
MOST_LINES = 300


def name_of(path: Path) -> str:
    return ".".join(("jaxskel", *path.relative_to(HOUSE).with_suffix("").parts)).removesuffix(".__init__")


def room_of(path: Path) -> str:
    return ".".join(("jaxskel", *path.parent.relative_to(HOUSE).parts))


MODULES = {name_of(path): path for path in FILES}


@cache
def tree_of(path: Path) -> ast.Module:
    """The code of a file; of a face whose names are imported at their first use, the stub that says from where."""
    stub = path.with_suffix(".pyi")
    return ast.parse((stub if stub.exists() else path).read_bytes())


def imports_of(path: Path) -> list[tuple[str, str]]:
    """Module and name of everything of the package that a file imports, also inside functions."""
    found, package = [], room_of(path).split(".")
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *(node.module or "").split(".")]).strip(".")
            if module.partition(".")[0] == "jaxskel":
                found += [(module, alias.name) for alias in node.names]
    return found


def target_of(module: str, name: str) -> str:
    """The module that an import loads: a name may be a module itself."""
    return f"{module}.{name}" if f"{module}.{name}" in MODULES else module


def test_every_import_is_found():
    assert [(path, each) for path in FILES for each in imports_of(path) if each[0] not in MODULES] == []


def test_a_room_imports_another_by_its_face_only():
    wrong = []
    for path in FILES:
        for module, name in imports_of(path):
            target = target_of(module, name)
            there = target if MODULES[target].name == "__init__.py" else target.rpartition(".")[0]
            if there == room_of(path) or target.startswith(OPEN):
                continue
            private = [part for part in (*target.split("."), name) if part.startswith("_") and part != "__version__"]
            # A face imports what is in its own rooms.
            if private and not (path.name == "__init__.py" and there.startswith(room_of(path) + ".")):
                wrong.append(f"{path.relative_to(HOUSE)}: {module}.{name}")
    assert wrong == []


def test_rooms_import_each_other_in_one_direction():
    arrows: dict[str, set[str]] = {}
    for path in FILES:
        if path.name == "__init__.py":
            continue
        for module, name in imports_of(path):
            target = target_of(module, name)
            there = target if MODULES[target].name == "__init__.py" else target.rpartition(".")[0]
            if there not in (room_of(path), "jaxskel"):
                arrows.setdefault(room_of(path), set()).add(there)
    done: set[str] = set()

    def walk(room: str, way: tuple[str, ...]) -> None:
        assert room not in way, f"a circle: {' -> '.join((*way[way.index(room) :], room))}"
        if room not in done:
            for other in sorted(arrows.get(room, ())):
                walk(other, (*way, room))
            done.add(room)

    for room in sorted(arrows):
        walk(room, ())
    assert len(done) > 20


def test_files_of_a_room_import_each_other_in_one_direction():
    arrows = {
        name: {target_of(*each) for each in imports_of(path)} - {name}
        for name, path in MODULES.items()
        if path.name != "__init__.py"
    }
    done: set[str] = set()

    def walk(module: str, way: tuple[str, ...]) -> None:
        assert module not in way, f"a circle: {' -> '.join((*way[way.index(module) :], module))}"
        if module not in done:
            for other in sorted(arrows.get(module, ())):
                walk(other, (*way, module))
            done.add(module)

    for module in sorted(arrows):
        walk(module, ())


@pytest.mark.parametrize("room", ROOMS, ids=room_of)
def test_a_face_says_what_it_is(room):
    face = room / "__init__.py"
    if not face.exists() or name_of(face) in OPEN:
        return
    documentation = ast.get_docstring(ast.parse(face.read_bytes())) or ""
    assert documentation.partition("\n")[0].endswith((".", "?", "`"))
    # A face holds names, not code.
    body = [node for node in tree_of(face).body if not isinstance(node, ast.Expr)]
    assert all(isinstance(node, ast.Import | ast.ImportFrom) for node in body)


def test_fields_are_described_where_help_shows_them():
    """A text below a field is seen by nobody who asks `help`; it belongs under Attributes in the class."""
    below = [
        f"{name_of(path)}: {before.target.id}"
        for path in FILES
        for node in ast.walk(ast.parse(path.read_bytes()))
        if isinstance(node, ast.ClassDef)
        for before, text in pairwise(node.body)
        if isinstance(before, ast.AnnAssign) and isinstance(before.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    ]
    assert below == []


def test_no_file_and_no_room_is_too_large():
    lines = {path: path.read_bytes().count(b"\n") for path in [*FILES, *TESTS.rglob("*.py")]}
    assert {str(path): count for path, count in lines.items() if count > MOST_LINES} == {}
    total = sum(lines[path] for path in FILES)
    rooms = {room_of(room / "x"): sum(lines[path] for path in FILES if path.parent == room) for room in ROOMS}
    assert {room: count for room, count in rooms.items() if count > total / 4} == {}


def test_tests_mirror_the_rooms():
    rooms = {path.name for path in HOUSE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    folders = {path.parent.name for path in TESTS.glob("*/*.py")}
    assert folders - rooms == {"support", "benchmarks", "docs"}
    # The recording is tested by what reads and writes it.
    assert rooms - folders <= {"recording"}


def test_about_forty_names_at_the_top():
    names = [name for module, name in imports_of(HOUSE / "__init__.py") if target_of(module, name) == module]
    assert 30 <= len(names) <= 50


def loaded_by(code: str, *names: str) -> list[str]:
    """Which of some modules a process loads that runs some code."""
    code += f"\nimport sys; print([name for name in {names} if name in sys.modules])"
    lines = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()
    return ast.literal_eval(lines[-1])


@pytest.mark.parametrize("module", ["jaxskel.pipeline", "jaxskel.visualization.report"])
def test_what_draws_is_loaded_only_where_something_is_drawn(module):
    assert loaded_by(f"import {module}", "matplotlib", "rerun", "typer") == []


@pytest.mark.parametrize("code", ["import jaxskel.io", "from jaxskel.cli import main"])
def test_names_are_imported_at_their_first_use(code):
    assert loaded_by(code, "jax", "numpy", "cv2") == []


def test_every_name_of_a_face_can_be_imported():
    """In one process for each face, in which nothing else has imported anything yet."""
    stubs = sorted(HOUSE.rglob("*.pyi"))
    assert [stub.name for stub in stubs] == ["__init__.pyi"] * 2
    for stub in stubs:
        names = [alias.name for node in ast.parse(stub.read_bytes()).body for alias in getattr(node, "names", [])]
        face = name_of(stub)
        code = f"import {face} as face; assert sorted({names}) == dir(face); [getattr(face, name) for name in {names}]"
        # What draws is loaded only where something is drawn.
        assert loaded_by(code, "jax", "matplotlib", "rerun", "typer") == ["jax"]
