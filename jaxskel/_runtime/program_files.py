"""Files of compiled programs, in a private folder: a digest, the digest of the program's text, the pickled program."""

import hashlib
import pickle
import stat
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from .atomic_files import written_whole
from .private_folders import is_private, make_private, read_private, say_shared

_DIGEST = 32  # bytes
Program = Callable[[list[Any]], Any]
"""Takes the flat arguments, returns the tree of results."""


def write_program(path: Path, text: bytes, compiled: Any, result: Any) -> None:
    """Write a compiled program, with the digest of its text and the structure of its result."""
    # A tree of integers with the structure of the result, because the structure itself cannot be pickled.
    like = jax.tree.unflatten(result, range(result.num_leaves))
    try:
        content = text + pickle.dumps((serialize(compiled)[0], like))
    except (ValueError, NotImplementedError) as error:
        _not_kept(path, error)
    except (AttributeError, TypeError, pickle.PicklingError):
        return  # it calls back into this process, as a solver with `verbose=True` does
    else:
        _write(path, content)


def read_program(path: Path, arguments: int) -> Program | None:
    """The program in a file; None if there is none, or if it is damaged or belongs to somebody else."""
    content = _content(path)
    return None if content is None else _loaded(path, content, arguments)


def read_same_program(path: Path, others: str, text: bytes, arguments: int) -> Program | None:
    """A program that was compiled from the same text before other code was changed, copied to `path`.

    Args:
        path: Where to keep it from now on.
        others: Pattern of the files in the same folder to look at.
        text: Digest of the text.
        arguments: Number of flat arguments.
    """
    for other in sorted(path.parent.glob(others)):
        if _digest_of_text(other) == text and (content := _content(other)) is not None:
            _write(path, content)
            return _loaded(path, content, arguments)
    return None


def _digest_of_text(path: Path) -> bytes:
    """The digest of a program's text; empty if there is no regular file."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return b""
        with path.open("rb") as file:
            return file.read(2 * _DIGEST)[_DIGEST:]
    except OSError:
        return b""


@cache
def usable(folder: Path) -> bool:
    """Whether the folder for compiled functions, made if missing, and JAX's folder above it are private."""
    try:
        make_private(folder)
        shared = next((path for path in (folder.parent, folder) if not is_private(path)), None)
    except OSError as error:
        warnings.warn(f"{folder}: compiled functions could not be kept ({error})", stacklevel=5)
        return False
    if shared is not None:
        say_shared(shared)
    return shared is None


def _content(path: Path) -> bytes | None:
    """What `_write` has written to a private file; None if there is none, or if it is damaged."""
    try:
        file = read_private(path)
    except OSError:
        return None
    # The file is private to this user, so unpickling is safe; the digest detects truncated files.
    if file is None or hashlib.sha256(file[_DIGEST:]).digest() != file[:_DIGEST]:
        return None
    return file[_DIGEST:]


def _write(path: Path, content: bytes) -> None:
    try:
        with written_whole(path, mode=0o600) as file:
            file.write(hashlib.sha256(content).digest() + content)
    except (OSError, ValueError) as error:
        _not_kept(path, error)


def _not_kept(path: Path, error: Exception) -> None:
    warnings.warn(f"{path}: a compiled function could not be kept ({error})", stacklevel=6)


def _loaded(path: Path, content: bytes, arguments: int) -> Program | None:
    _load_linear_algebra()
    program, like = pickle.loads(content[_DIGEST:])
    result = jax.tree.structure(like)
    given = jax.tree.structure((tuple(range(arguments)), {}))
    flat = jax.tree.structure(list(range(result.num_leaves)))
    try:
        compiled = deserialize_and_load(program, given, flat)
    except Exception as error:  # any error of the runtime, for example for a program from another kind of machine
        warnings.warn(f"{path}: a compiled function could not be read ({error})", stacklevel=5)
        return None
    return lambda leaves: jax.tree.unflatten(result, compiled(*leaves))


@cache
def _load_linear_algebra() -> None:
    """Make JAX load LAPACK, as it does when it lowers a function that calls it: programs from disk need it."""
    jax.jit(jnp.linalg.cholesky).lower(jax.ShapeDtypeStruct((2, 2), jnp.float32))
