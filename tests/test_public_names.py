"""What a face exports is documented: a text, shapes of the arrays that it gives, the errors that it raises."""

import ast
from collections.abc import Iterator
from pathlib import Path

HOUSE = Path(__file__).parents[1] / "jaxskel"
# A stub beside a face, if there is one, says what the face imports.
TREES = {
    path: ast.parse((stub if (stub := path.with_suffix(".pyi")).exists() else path).read_bytes())
    for path in sorted(HOUSE.rglob("*.py"))
}
# Without its shape, the type of an array tells little.
SHAPELESS = {"np.ndarray", "Array", "jax.Array", "ArrayLike"}

Documented = ast.FunctionDef | ast.ClassDef


def file_of(face: Path, node: ast.ImportFrom) -> Path:
    """The file that a face imports from."""
    base = face.parents[node.level - 1].joinpath(*(node.module or "").split("."))
    return base / "__init__.py" if base.is_dir() else base.with_suffix(".py")


def exported() -> set[tuple[Path, str]]:
    """File and name of all that faces import. A face that imports from another one's room repeats its names."""
    return {
        (file_of(face, node), alias.name)
        for face, tree in TREES.items()
        if face.name == "__init__.py"
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def public() -> dict[str, Documented]:
    """Functions and classes that faces export, and the methods of these classes without an underscore."""
    found = {}
    for path, name in sorted(exported()):
        for node in TREES[path].body:
            if isinstance(node, Documented) and node.name == name:
                found[f"{path.relative_to(HOUSE)}: {name}"] = node
                methods = node.body if isinstance(node, ast.ClassDef) else []
                found |= {
                    f"{path.relative_to(HOUSE)}: {name}.{method.name}": method
                    for method in methods
                    if isinstance(method, ast.FunctionDef) and not method.name.startswith("_")
                }
    return found


PUBLIC = public()
FUNCTIONS = {name: node for name, node in PUBLIC.items() if isinstance(node, ast.FunctionDef)}


def reached(node: ast.AST) -> Iterator[ast.AST]:
    """All parts of a function that raise to its caller: neither functions within it nor what it catches itself."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(child, ast.Try):
            guarded = [] if child.handlers else child.body
            for part in (*guarded, *child.handlers, *child.orelse, *child.finalbody):
                yield from reached(part)
                yield part
            continue
        yield child
        yield from reached(child)


def raises(function: ast.FunctionDef) -> bool:
    """Whether it raises an error of its own; a method that a class leaves open raises NotImplementedError."""
    errors = [node.exc for node in reached(function) if isinstance(node, ast.Raise) and node.exc]
    return any("NotImplementedError" not in ast.unparse(error) for error in errors)


def text_of(node: Documented) -> str:
    return ast.get_docstring(node) or ""


def test_there_are_many():
    # Three whose place is known: a function, a class, a method; and hundreds of others.
    assert {"hull/_carve.py: carve", "poses/_poses.py: Poses", "recording/_recording.py: Recording.named"} <= set(
        PUBLIC
    )
    assert len(PUBLIC) > 700


def test_each_has_a_text_that_begins_with_a_sentence():
    assert [name for name, node in PUBLIC.items() if text_of(node).partition("\n")[0][-1:] not in (".", "?", ":")] == []


def test_errors_are_documented_where_they_are_raised():
    assert [name for name, node in FUNCTIONS.items() if raises(node) and "Raises:" not in text_of(node)] == []


def test_errors_are_found_but_for_those_that_are_caught():
    (function,) = ast.parse(
        "def f():\n try:\n  raise ValueError\n except ValueError:\n  pass\n def g():\n  raise ValueError\n"
    ).body
    assert isinstance(function, ast.FunctionDef)
    assert not raises(function)
    (function,) = ast.parse("def f():\n try:\n  pass\n except OSError as error:\n  raise ValueError from error\n").body
    assert isinstance(function, ast.FunctionDef)
    assert raises(function)


def without_shapes(annotation: ast.expr | None) -> set[str]:
    """Types of arrays in a signature that are not within one of jaxtyping, which gives their shape."""
    if annotation is None:
        return set()
    if isinstance(annotation, ast.Subscript) and isinstance(annotation.slice, ast.Tuple):
        last = annotation.slice.elts[-1]
        if isinstance(last, ast.Constant) and isinstance(last.value, str):
            return set()
    if isinstance(annotation, ast.Attribute | ast.Name):
        return {ast.unparse(annotation)} & SHAPELESS
    return set().union(
        *(without_shapes(part) for part in ast.iter_child_nodes(annotation) if isinstance(part, ast.expr))
    )


def test_arrays_that_are_returned_have_shapes():
    assert [name for name, node in FUNCTIONS.items() if node.returns is None] == []
    assert {name: found for name, node in FUNCTIONS.items() if (found := without_shapes(node.returns))} == {}


def test_arrays_without_shapes_are_found():
    def found(text: str) -> set[str]:
        node = ast.parse(f"x: {text}").body[0]
        assert isinstance(node, ast.AnnAssign)
        return without_shapes(node.annotation)

    assert found('tuple[Float[np.ndarray, "3"], dict[str, int]]') == set()
    assert found("dict[str, np.ndarray]") == {"np.ndarray"}
    assert found('tuple[Float[Array, "n"], Array]') == {"Array"}
