"""Puts scripts, style and data into a page, which then needs no other file."""

import base64
import hashlib
import json
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

from ..._runtime.plain_text import plain


def filled(
    page: str,
    scripts: Sequence[str],
    title: str,
    numbers: dict[str, Any],
    styles: Sequence[str] = ("style.css",),
    **parts: str,
) -> str:
    """A page as text. Its security policy only allows its own script and style, by their hashes.

    Args:
        page: Name of the template in this folder.
        scripts: Names of the scripts in this folder, in order of their dependencies.
        title: Name of what the page shows.
        numbers: Data for the scripts.
        styles: Names of the style sheets in this folder; later ones have precedence.
        parts: HTML for other places of the template.
    """
    folder = files("jaxskel.visualization.report")

    def text(name: str) -> str:
        return folder.joinpath(name).read_text("utf-8")

    script, style = "\n".join(map(text, scripts)), "\n".join(map(text, styles))
    # In JSON "<" only occurs in strings; once escaped, no name can close the script element.
    data = json.dumps(numbers, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return Template(text(page)).substitute(
        title=escape(plain(title)), script=script, style=style, data=data, scene=text("scene.html"),
        script_hash=_hash(script), style_hash=_hash(style), **parts,
    )  # fmt: skip


def _hash(text: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii") + "'"
