"""The commands, and how they end: 0 done, 1 done but without a single pose, 2 wrong input."""

import sys
from importlib.metadata import version
from typing import Annotated

import typer

from ._batch import batch
from ._cache import keep_compiled
from ._calibrate_body import calibrate_body
from ._calibrate_cameras import calibrate_cameras
from ._check import check
from ._demo import demo
from ._evaluate import evaluate
from ._export import export
from ._init import init
from ._refine_cameras import refine_cameras
from ._report import report
from ._run import run
from ._summary import summary
from ._view import view

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="3D human skeletons from calibrated multi-view silhouettes.",
)
app.command()(demo)
app.command()(init)
app.command()(run)
app.command()(batch)
app.command()(summary)
app.command()(evaluate)
app.command()(check)
app.command()(calibrate_cameras)
app.command()(calibrate_body)
app.command()(refine_cameras)
app.command()(export)
app.command()(report)
app.command()(view)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"jaxskel {version('jaxskel')}")
        raise typer.Exit


@app.callback()
def _top(
    _: Annotated[bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Version.")] = False,
    no_cache: Annotated[
        bool, typer.Option("--no-cache", envvar="JAXSKEL_NO_CACHE", help="Do not keep compiled code for the next run.")
    ] = False,
) -> None:
    if not no_cache:
        keep_compiled()


def main() -> None:
    """Run the command line; wrong input is one line on standard error and exit code 2."""
    try:
        app()
    except (ValueError, OSError, MemoryError) as error:
        print(f"jaxskel: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("jaxskel: interrupted", file=sys.stderr)
        sys.exit(130)
