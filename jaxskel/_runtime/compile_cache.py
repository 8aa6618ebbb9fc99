"""Disk cache of compiled functions: a process that finds a function there neither traces nor compiles it.

JAX's persistent cache avoids the compilation, but a function must be traced to compute its key, and that takes longer
than everything else before the first pose. Here the key is made of the arguments and the source code of the package.
Programs are stored in the folder of JAX's persistent cache, if that is switched on.
"""

import ctypes
import hashlib
import io
import os
import pickle
import platform
import sys
import warnings
from collections.abc import Callable, Hashable
from functools import cache, update_wrapper
from importlib.metadata import version
from pathlib import Path
from types import BuiltinFunctionType, FunctionType
from typing import Any, Generic, ParamSpec, TypeVar, cast
from uuid import uuid4

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from .atomic_files import written_whole
from .private_folders import is_private, make_private, read_private, say_shared

P = ParamSpec("P")
R = TypeVar("R")

_LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "lineax", "numpy")
# In these modules, a name stands for the same object in every process, as long as the versions are the same.
_KNOWN = (str(__package__).partition(".")[0], *_LIBRARIES, "builtins", "copyreg", "functools", "collections", "enum")
# JAX settings that change what is compiled.
_SWITCHES = ("jax_enable_x64", "jax_default_matmul_precision", "jax_debug_nans", "jax_numpy_dtype_promotion")


class CachedJit(Generic[P, R]):
    """A function compiled as by `equinox.filter_jit`: arrays are traced, all else is static. It returns arrays only.

    It falls back to `equinox.filter_jit` if JAX's persistent cache is off, if it is itself traced, and if a static
    argument is not from this package or its libraries, because in a notebook the same name may later mean another term.
    """

    def __init__(self, function: Callable[P, R]):
        self._function: Callable[..., R] = function
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._jitted = eqx.filter_jit(function)
        self._known: dict[Hashable, Callable[[list[Any]], R] | None] = {}
        update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
        leaves, structure = jax.tree.flatten((args, kwargs))
        leaves = [_strong(leaf) for leaf in leaves]
        if not folder or "://" in folder:  # JAX can also use a bucket in a cloud, which is not supported here
            return self._call(leaves, structure)
        numbers = [_is_array(leaf) for leaf in leaves]
        arrays = [_canonical(leaf) for leaf, number in zip(leaves, numbers, strict=True) if number]
        if jax.device_count() > 1 or any(isinstance(array, Tracer) for array in arrays):
            return self._call(leaves, structure)
        # 1, 1.0 and True are equal, but compile differently.
        rest = tuple((type(leaf), leaf) for leaf, number in zip(leaves, numbers, strict=True) if not number)
        key = structure, tuple(numbers), rest, tuple((array.shape, array.dtype) for array in arrays), _switches()
        if key not in self._known:
            self._known[key] = self._prepared(Path(folder), leaves, structure)
        program = self._known[key]
        return self._call(leaves, structure) if program is None else program(arrays)

    def forget(self) -> None:
        """Drop the programs that this process has loaded; those on disk stay."""
        self._known.clear()

    def _call(self, leaves: list[Any], structure: Any) -> R:
        args, kwargs = jax.tree.unflatten(structure, leaves)
        return cast(Callable[..., R], self._jitted)(*args, **kwargs)

    def _prepared(self, folder: Path, leaves: list, structure: Any) -> Callable[[list[Any]], R] | None:
        """The function for arguments like these, from disk or compiled; None if no key can be made for it."""
        described = [(leaf.shape, _canonical(leaf).dtype.str) if _is_array(leaf) else leaf for leaf in leaves]
        try:
            content = _named((self._name, jax.tree.unflatten(structure, described), _switches()))
        except (pickle.PicklingError, AttributeError, TypeError):
            return None
        digest = hashlib.sha256(_surroundings() + content).hexdigest()
        own = folder / "jaxskel"
        if not _usable(own):
            return None
        path = own / f"{self._name}-{digest[:32]}"
        return self._read(path, sum(map(_is_array, leaves))) or self._compile(path, leaves, structure)

    def _compile(self, path: Path, leaves: list, structure: Any) -> Callable[[list[Any]], R]:
        structures = []

        def flat(*arrays: Any) -> list[Any]:
            given = iter(arrays)
            args, kwargs = jax.tree.unflatten(structure, [next(given) if _is_array(leaf) else leaf for leaf in leaves])
            found, structure_of_result = jax.tree.flatten(self._function(*args, **kwargs))
            structures.append(structure_of_result)
            return found

        # A unique name, so that JAX does not return a program from its own cache: that could not be serialised again.
        flat.__name__ = f"{self._name.replace('.', '_')}_{uuid4().hex}"
        compiled = jax.jit(flat).lower(*(_canonical(leaf) for leaf in leaves if _is_array(leaf))).compile()
        result = structures[-1]
        try:
            program = serialize(compiled)[0]
            # A tree of integers with the structure of the result, because the structure itself cannot be pickled.
            like = jax.tree.unflatten(result, range(result.num_leaves))
            content = pickle.dumps((program, like))
            with written_whole(path, mode=0o600) as file:
                file.write(hashlib.sha256(content).digest() + content)
        except (OSError, ValueError, NotImplementedError) as error:
            warnings.warn(f"{path}: a compiled function could not be kept ({error})", stacklevel=4)
        _give_memory_back()
        return lambda leaves: jax.tree.unflatten(result, compiled(*leaves))

    def _read(self, path: Path, arguments: int) -> Callable[[list[Any]], R] | None:
        try:
            file = read_private(path)
        except OSError:
            return None
        if file is None:
            return None
        # The file is private to this user, so unpickling is safe; the digest detects truncated files.
        digest, content = file[:32], file[32:]
        if hashlib.sha256(content).digest() != digest:
            return None
        _load_linear_algebra()
        program, like = pickle.loads(content)
        result = jax.tree.structure(like)
        given = jax.tree.structure((tuple(range(arguments)), {}))
        flat = jax.tree.structure(list(range(result.num_leaves)))
        try:
            compiled = deserialize_and_load(program, given, flat)
        except Exception as error:  # any error of the runtime, for example for a program from another kind of machine
            warnings.warn(f"{path}: a compiled function could not be read ({error})", stacklevel=4)
            return None
        return lambda leaves: jax.tree.unflatten(result, compiled(*leaves))


def cached_jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function and store it on disk, see [`CachedJit`][]."""
    return cast(Callable[P, R], CachedJit(function))


@cache
def _usable(folder: Path) -> bool:
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


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray | jax.Array | np.generic)


def _strong(leaf: Any) -> Any:
    """An array without JAX's weak type, the mark of a Python number, which would cause a recompilation."""
    weak = isinstance(leaf, jax.Array) and not isinstance(leaf, Tracer) and leaf.weak_type
    return jnp.asarray(leaf, leaf.dtype) if weak else leaf


def _canonical(leaf: Any) -> Any:
    dtype = jax.dtypes.canonicalize_dtype(leaf.dtype)
    return leaf if leaf.dtype == dtype else np.asarray(leaf, dtype)


def _switches() -> tuple[Any, ...]:
    optimised = not jax.config.read("jax_disable_most_optimizations")  # pyright: ignore[reportAttributeAccessIssue]
    return optimised, *(getattr(jax.config, name) for name in _SWITCHES)


@cache
def _surroundings() -> bytes:
    """What a program depends on besides its arguments: code, versions, processor."""
    device, flags = jax.devices()[0], os.environ.get("XLA_FLAGS")
    versions = [version(name) for name in _LIBRARIES]
    return repr((digest_of_code(), versions, processor(), device.platform, device.device_kind, flags)).encode()


@cache
def digest_of_code() -> str:
    """Digest of the source of this package, in hexadecimal digits."""
    folder = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


@cache
def processor() -> str:
    """The kind of processor: nodes of a cluster may share a folder but have different processors."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        kind = next(line for line in lines if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        kind = platform.processor()
    return f"{platform.machine()} {kind}"


def _give_memory_back() -> None:
    """Make glibc return the memory that the compiler has freed, some hundred megabytes, to the system."""
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        library.malloc_trim(0)


@cache
def _load_linear_algebra() -> None:
    """Make JAX load LAPACK, as it does when it lowers a function that calls it: programs from disk need it."""
    jax.jit(jnp.linalg.cholesky).lower(jax.ShapeDtypeStruct((2, 2), jnp.float32))


class _Namer(pickle.Pickler):
    """Pickles static arguments; functions and classes are pickled by name, if they are from a known module."""

    def reducer_override(self, obj: Any) -> Any:
        if isinstance(obj, type | FunctionType | BuiltinFunctionType):
            if (obj.__module__ or "").partition(".")[0] not in _KNOWN:
                raise pickle.PicklingError(f"{obj} is not known")
        return NotImplemented


def _named(tree: Any) -> bytes:
    file = io.BytesIO()
    _Namer(file, 5).dump(tree)
    return file.getvalue()
