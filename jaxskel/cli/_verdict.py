"""The option to continue in spite of the verdict on a recording."""

from typing import Annotated

import typer

Anyway = Annotated[
    bool,
    typer.Option("--anyway", help="Go on although the views contradict each other so that nothing can come of it."),
]
