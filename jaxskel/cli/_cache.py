"""Keeps compiled code on disk, so that from the second run on a command starts in seconds."""

import hashlib
import os
from pathlib import Path

import jax
from platformdirs import user_cache_path

from .._runtime.compile_cache import processor
from .._runtime.private_folders import is_private, make_private, say_shared


def keep_compiled() -> None:
    """Make JAX keep compiled code, unless ``JAX_COMPILATION_CACHE_DIR`` already sets the place.

    If others may write to the folder, nothing is loaded or kept, and a warning says so.
    """
    told = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    if told == "" or (told is not None and "://" in told):  # disabled, or a cloud bucket
        return
    folder = compiled_folder() if told is None else Path(told)
    try:
        make_private(folder)
        shared = not is_private(folder)
    except OSError:  # JAX compiles without a cache
        shared = False
    if shared:
        say_shared(folder)
        jax.config.update("jax_compilation_cache_dir", None)
        os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)  # for the processes of --jobs
    if shared or told is not None:
        return
    for option, value in _options().items():
        jax.config.update(option, value)
        os.environ[option.upper()] = str(value)  # for the processes of --jobs


def forget_compiled() -> bool:
    """Undo what `keep_compiled` set for child processes, and return whether it had set anything.

    On another machine the folder may be different.
    """
    ours = {option.upper(): str(value) for option, value in _options().items()}
    if any(os.environ.get(name) != value for name, value in ours.items()):
        return False
    for name in ours:
        del os.environ[name]
    return True


def _options() -> dict[str, str | float]:
    """Options of JAX. All functions are kept, since the many small ones add up."""
    return {
        "jax_compilation_cache_dir": str(compiled_folder()),
        "jax_persistent_cache_min_compile_time_secs": 0.0,
        "jax_persistent_cache_min_entry_size_bytes": -1,
    }


def compiled_folder() -> Path:
    """The user's cache folder, one part for each kind of processor, since differing cluster nodes may share it."""
    kind = hashlib.sha256(processor().encode()).hexdigest()[:12]
    return user_cache_path("jaxskel") / "compiled" / kind
