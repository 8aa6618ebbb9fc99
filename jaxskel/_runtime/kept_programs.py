"""Keeps compiled programs on disk, so that from the second run on the first pose comes in seconds."""

import hashlib
import os
from pathlib import Path

import jax
from platformdirs import user_cache_path

from .compile_cache import processor
from .kinds import check_kind
from .private_folders import is_private, make_private, say_shared


def keep_compiled(folder: str | Path | None = None) -> None:
    """Keep compiled programs on disk, for this process, those that it starts, and later ones.

    The command line does this by itself. Call it before the first reconstruction. If others may write to the folder,
    nothing is loaded or kept, and a warning says so.

    Args:
        folder: Where to keep them; by default the folder of ``JAX_COMPILATION_CACHE_DIR``, and without that the
            command line's, in the user's cache folder.
    """
    check_kind("folder", folder, str | Path | None, "the path of a folder, or None")
    told = os.environ.get("JAX_COMPILATION_CACHE_DIR") if folder is None else None
    if told == "" or (told is not None and "://" in told):  # disabled, or a cloud bucket
        return
    place = Path(folder or told or compiled_folder())
    try:
        make_private(place)
        shared = not is_private(place)
    except OSError:  # JAX compiles without a cache
        shared = False
    if shared:
        say_shared(place)
        jax.config.update("jax_compilation_cache_dir", None)
        os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)  # for the processes of --jobs
    if shared or told is not None:
        return
    for option, value in _options(place).items():
        jax.config.update(option, value)
        os.environ[option.upper()] = str(value)  # for the processes of --jobs


def forget_compiled() -> bool:
    """Undo what `keep_compiled` set for child processes, and return whether it had set anything.

    On another machine the folder may be different.
    """
    ours = {option.upper(): str(value) for option, value in _options(compiled_folder()).items()}
    if any(os.environ.get(name) != value for name, value in ours.items()):
        return False
    for name in ours:
        del os.environ[name]
    return True


def _options(folder: Path) -> dict[str, str | float]:
    """Options of JAX. All functions are kept, since the many small ones add up."""
    return {
        "jax_compilation_cache_dir": str(folder),
        "jax_persistent_cache_min_compile_time_secs": 0.0,
        "jax_persistent_cache_min_entry_size_bytes": -1,
    }


def compiled_folder() -> Path:
    """The user's cache folder, one part for each kind of processor, since differing cluster nodes may share it."""
    kind = hashlib.sha256(processor().encode()).hexdigest()[:12]
    return user_cache_path("jaxskel") / "compiled" / kind
