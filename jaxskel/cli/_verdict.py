"""The option to continue in spite of the verdict on a recording."""

from typing import Annotated

import typer

Anyway = Annotated[
    bool,
    typer.Option("--anyway", help="Go on although the views contradict each other too much for poses."),
]
