"""Prints messages; names from files are never interpreted as markup or as terminal commands."""

import sys

from rich.text import Text

from .._runtime.plain_text import plain


def say(line: str) -> None:
    """Print a line."""
    print(plain(line), flush=True)


def warn(line: str) -> None:
    """Print a line on standard error, after the command's name."""
    print(f"jaxskel: {plain(line)}", file=sys.stderr, flush=True)


def cell(text: str) -> Text:
    """A table cell that shows text literally: in plain strings, rich interprets brackets as markup."""
    return Text(plain(text))
