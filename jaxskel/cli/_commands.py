"""The commands by name, each in a module of its own that is imported when it is called.

Modules of commands import JAX and most of the package, which takes seconds. Help, completion and errors in a command's
name need only what stands in its docstring.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

NAMES = (
    "demo", "init", "run", "live", "batch", "summary", "evaluate", "check", "calibrate-cameras", "calibrate-body",
    "refine-cameras", "export", "report", "view", "doctor",
)  # fmt: skip
"""Names of all commands, in the order of the help. `calibrate-body` is the function `calibrate_body` of
`_calibrate_body.py`, and so on."""


class Commands(TyperGroup):
    """Commands that are imported when they are called; until then, functions of [`described`][] stand for them."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Import the command that the arguments name."""
        name, command, rest = super().resolve_command(ctx, args)
        return name, command if command is None or name is None else imported(name), rest


def imported(name: str) -> Any:
    """The command of a name, as typer makes it of its function."""
    function = _function(name)
    alone = typer.Typer(add_completion=False)
    alone.command(name)(getattr(import_module(f"._{function}", __package__), function))
    return get_command(alone)


def described(name: str) -> Callable[[], None]:
    """A function without arguments that has the docstring of a command's function, which is read from its file."""
    function = _function(name)
    tree = ast.parse((Path(__file__).parent / f"_{function}.py").read_text(encoding="utf-8"))

    def stand_in() -> None: ...

    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == function:
            stand_in.__doc__ = ast.get_docstring(node)
    return stand_in


def _function(name: str) -> str:
    return name.replace("-", "_")
