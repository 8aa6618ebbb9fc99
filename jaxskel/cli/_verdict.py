"""The verdict on a recording before a command works on it."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from .._recording import Recording
from ..verdict import Severity, judge

Anyway = Annotated[
    bool,
    typer.Option("--anyway", help="Go on although the views contradict each other so that nothing can come of it."),
]


def check_views(source: Path, recording: Recording, anyway: bool) -> None:
    """Look at a few frames; say what is doubtful on standard error.

    Raises:
        ValueError: Nothing can come of it, and nobody said to go on all the same.
    """
    verdict = judge(recording)
    for finding in verdict.findings:
        if finding.severity is Severity.HOPELESS and not anyway:
            raise ValueError(f"{source}: {finding.told}; jaxskel check draws it, --anyway goes on")
    for finding in verdict.findings:
        print(f"jaxskel: {source}: {finding.told}", file=sys.stderr)
