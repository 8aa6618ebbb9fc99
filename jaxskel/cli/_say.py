"""What commands print: names come from files, and are never taken for markup or for a terminal's commands."""

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
    """A table's cell that shows a text as it stands: rich takes brackets in a plain one for markup."""
    return Text(plain(text))
