"""The command line's entry point and its exit codes: 0 done, 1 done but without a single pose, 2 wrong input."""

import gc
import io
import sys
from importlib.metadata import version
from typing import Annotated, Any

import typer

from .._runtime.cores import one_solver_thread
from ._commands import NAMES, Commands, described
from ._say import warn

app = typer.Typer(
    cls=Commands,
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    help="3D human skeletons from calibrated multi-view silhouettes.",
)
for name in NAMES:
    app.command(name)(described(name))

_FIRST_STEPS = """\
What to do next:
  jaxskel demo -o demo                  see it work, on a scene that it makes
  jaxskel check RECORDING               do the views of a recording agree? Then: jaxskel run RECORDING -o results
  jaxskel report RECORDING POSES.npz    see the poses in a browser
  jaxskel --help                        all commands; jaxskel doctor: what is installed here, what is missing"""


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"jaxskel {version('jaxskel')}")
        raise typer.Exit


@app.callback()
def _top(
    context: typer.Context,
    _: Annotated[bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Version.")] = False,
    no_cache: Annotated[
        bool, typer.Option("--no-cache", envvar="JAXSKEL_NO_CACHE", help="Do not keep compiled code for the next run.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(_FIRST_STEPS)
    elif not no_cache:
        from .._runtime.kept_programs import keep_compiled  # imports JAX, which help and version do without

        keep_compiled()


# Base class of all errors in options and arguments; typer has no public name for it.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]


def main() -> None:
    """Run the command line; wrong input gives one line on standard error and exit code 2."""
    # Tracing makes millions of objects that live on, and by default the collector looks through them again and again:
    # before the first pose of `run` 46.3 s passed so where nothing was compiled yet, and 42.3 s pass now (two cores).
    gc.set_threshold(100_000, 20, 10)
    one_solver_thread()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # escape characters that the terminal cannot show
    try:
        code = app(standalone_mode=False)
    except _UsageError as error:
        warn(_usage(error))
        sys.exit(2)
    except (ValueError, OSError, MemoryError) as error:
        warn(_one_line(error))
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        warn("interrupted")
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        name = error.filename if isinstance(error.filename, str) else str(error.filename)
        return " ".join(f"{name}: {error.strerror}".split())
    return " ".join(str(error).split()) or type(error).__name__


def _usage(error: Any) -> str:
    """Describe an error in an option or argument, and point to the help."""
    command = error.ctx.command_path if error.ctx is not None else "jaxskel"
    return f"{' '.join(error.format_message().split()).rstrip('.')}; see {command} --help"
