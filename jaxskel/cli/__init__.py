"""The command line: one command a file; nothing here that a notebook could not call."""

from ._app import main as main
