"""What is compiled is kept on disk, so that from the second run on a command starts in seconds."""

import hashlib
import os
from pathlib import Path

import jax
from platformdirs import user_cache_path

from .._kept import processor


def keep_compiled() -> None:
    """Have JAX keep what it compiles, unless ``JAX_COMPILATION_CACHE_DIR`` tells it where already."""
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    # Many small functions add up: all are kept.
    for option, value in (
        ("jax_compilation_cache_dir", str(compiled_folder())),
        ("jax_persistent_cache_min_compile_time_secs", 0.0),
        ("jax_persistent_cache_min_entry_size_bytes", -1),
    ):
        jax.config.update(option, value)
        os.environ[option.upper()] = str(value)  # for the processes of --jobs


def compiled_folder() -> Path:
    """The user's cache folder, one part for each kind of processor: a cluster's nodes may share it and still differ."""
    kind = hashlib.sha256(processor().encode()).hexdigest()[:12]
    return user_cache_path("jaxskel") / "compiled" / kind
