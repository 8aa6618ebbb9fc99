"""The command line, in this process or in a separate one."""

import io
import os
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

import jaxtyping

from jaxskel.cli._app import main


def jaxskel(*arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    """In this process, which has compiled everything already; as for a user, shapes are not checked."""
    command = ["jaxskel", *map(str, arguments)]
    out, err, code = io.StringIO(), io.StringIO(), 0
    unchecked = patch.object(jaxtyping.config, "jaxtyping_disable", True)
    # Code compiled with the tests' checks of shapes must not get into the user's cache.
    uncached = patch.dict("os.environ", JAXSKEL_NO_CACHE="1")
    with unchecked, uncached, chdir(cwd), patch("sys.argv", command), redirect_stdout(out), redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    return subprocess.CompletedProcess(command, code, out.getvalue(), err.getvalue())


def by_itself(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess:
    """Run in a separate process, as for a user."""
    command = [sys.executable, "-m", "jaxskel", *map(str, arguments)]
    known = os.environ | {"JAXSKEL_NO_CACHE": "1"} | environment
    known.pop("JAX_COMPILATION_CACHE_DIR", None)
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, env=known)
