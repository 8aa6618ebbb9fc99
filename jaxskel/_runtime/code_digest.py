"""Digest of the package's definitions, independent of the files they are in."""

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
_IMPORTS = (ast.Import, ast.ImportFrom)


@cache
def digest_of_definitions() -> str:
    """Digest of all definitions of this package, in hexadecimal digits.

    File names, imports, comments and docstrings do not count, because they do not change what the code computes.
    """
    return digest_of_sources(path.read_bytes() for path in Path(__file__).parents[1].rglob("*.py"))


def digest_of_sources(sources: Iterable[bytes]) -> str:
    """Digest of the definitions in some source files, in any order."""
    found: set[str] = set()
    for source in sources:
        for statement in ast.parse(source).body:
            if not isinstance(statement, _IMPORTS) and not _is_text(statement):
                found.add(ast.dump(_undocumented(statement)))
    return hashlib.sha256("\n".join(sorted(found)).encode()).hexdigest()


def _undocumented(tree: ast.AST) -> ast.AST:
    """The tree without docstrings, strings after fields, and imports inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, _DOCUMENTED):
            node.body = [each for each in node.body if not (isinstance(each, _IMPORTS) or _is_text(each))]
    return tree


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
