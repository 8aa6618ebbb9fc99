"""`keep_compiled` for Python: the folder that is asked for, for this process and those that it starts."""

import os
import subprocess
import sys
from pathlib import Path

CODE = (
    "import os, sys, jax, jaxskel as js\n"
    "js.keep_compiled(*sys.argv[1:])\n"
    "print(jax.config.jax_compilation_cache_dir)\n"
    "print(os.environ.get('JAX_COMPILATION_CACHE_DIR'))\n"
)


def told(*arguments: str, **environment: str) -> list[str]:
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "XDG_CACHE"))}
    command = [sys.executable, "-c", CODE, *arguments]
    done = subprocess.run(command, env=clean | environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_programs_are_kept_in_the_folder_that_is_given(tmp_path: Path):
    place = tmp_path / "kept"
    assert told(str(place)) == [str(place), str(place)]
    assert place.stat().st_mode & 0o077 == 0  # nobody else's programs are loaded


def test_without_a_folder_they_are_where_the_command_line_keeps_them(tmp_path: Path):
    here, child = told(XDG_CACHE_HOME=str(tmp_path))
    assert here == child
    assert Path(here).parent == tmp_path / "jaxskel" / "compiled"


def test_a_folder_that_is_given_counts_more_than_the_environment(tmp_path: Path):
    place = str(tmp_path / "mine")
    assert told(place, JAX_COMPILATION_CACHE_DIR=str(tmp_path / "other")) == [place, place]
