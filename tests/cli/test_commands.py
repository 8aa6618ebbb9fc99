"""Commands are imported when they are called; before, what is said of them is what their functions say."""

import inspect
from importlib import import_module

import pytest
import typer
from support.command_line import jaxskel

from jaxskel.cli._app import app
from jaxskel.cli._commands import NAMES, described, imported


@pytest.mark.parametrize("name", NAMES)
def test_a_command_is_described_by_the_docstring_of_its_function(name):
    function = name.replace("-", "_")
    command = getattr(import_module(f"jaxskel.cli._{function}"), function)
    assert described(name).__doc__ == inspect.getdoc(command)


@pytest.mark.parametrize("name", NAMES)
def test_help_of_all_and_help_of_one_begin_alike(name):
    of_all = typer.main.get_command(app).commands[name]  # pyright: ignore[reportAttributeAccessIssue]
    assert imported(name).help == of_all.help
    assert imported(name).name == name


def test_a_misspelt_command_is_told_the_right_one(tmp_path):
    done = jaxskel("calibrate-camera", cwd=tmp_path)
    assert done.returncode == 2
    assert "calibrate-cameras" in done.stderr


def test_options_of_a_command_are_those_of_its_function(tmp_path):
    done = jaxskel("export", "--help", cwd=tmp_path)
    assert done.returncode == 0
    assert "--keypoints" in done.stdout
