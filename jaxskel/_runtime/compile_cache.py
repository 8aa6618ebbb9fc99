"""Disk cache of compiled functions: a process that finds a function there neither traces nor compiles it.

JAX's persistent cache avoids the compilation, but a function must be traced to compute its key, and that takes longer
than everything else before the first pose. Here the key is made of the arguments and the source code of the package.
After a change of the code functions are traced again, but compiled only if the change concerns them.
Programs are stored in the folder of JAX's persistent cache, if that is switched on.
"""

import ctypes
import hashlib
import io
import os
import pickle
import platform
import sys
from collections.abc import Callable, Hashable
from concurrent.futures import Executor
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from pathlib import Path
from threading import Lock
from types import BuiltinFunctionType, FunctionType
from typing import Any, Generic, ParamSpec, TypeVar, cast
from uuid import uuid4

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .compilations import COMPILATIONS
from .compiler_options import OPTIONS, accepted
from .precision import precise
from .program_files import read_program, read_same_program, usable, write_program
from .source_locations import strip_locations

P = ParamSpec("P")
R = TypeVar("R")

_LIBRARIES = ("jax", "jaxlib", "equinox", "optimistix", "lineax", "numpy")
# In these modules, a name stands for the same object in every process, as long as the versions are the same.
_KNOWN = (str(__package__).partition(".")[0], *_LIBRARIES, "builtins", "copyreg", "functools", "collections", "enum")
# JAX settings that change what is compiled.
_SWITCHES = ("jax_enable_x64", "jax_default_matmul_precision", "jax_debug_nans", "jax_numpy_dtype_promotion")


class CachedJit(Generic[P, R]):
    """A function compiled as by `equinox.filter_jit`: arrays are traced, all else is static. It returns arrays only.

    It is compiled with `OPTIONS`.

    It falls back to `equinox.filter_jit` if JAX's persistent cache is off, if it is itself traced, and if a static
    argument is not from this package or its libraries, because in a notebook the same name may later mean another term.
    """

    def __init__(self, function: Callable[P, R]):
        self._function: Callable[..., R] = precise(function)
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._traced = eqx.filter_jit(self._function)  # within another function, which has the compiler's options
        self._known: dict[Hashable, Callable[[list[Any]], R] | None] = {}
        self._locks: dict[Hashable, Lock] = {}
        update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        leaves, structure = jax.tree.flatten((args, kwargs))
        leaves = [_plain(leaf) for leaf in leaves]
        key, arrays = self._key(leaves, structure)
        program = None if key is None else self._program(key, leaves, structure)
        if program is None:
            args, kwargs = jax.tree.unflatten(structure, leaves)
            traced = any(isinstance(leaf, Tracer) for leaf in leaves)
            return cast(Callable[..., R], self._traced if traced else self._jitted)(*args, **kwargs)
        return program(arrays)

    def ahead(self, threads: Executor, *args: P.args, **kwargs: P.kwargs) -> None:
        """Begin to load or compile the program for arguments like these; a call waits for it."""
        leaves, structure = jax.tree.flatten((args, kwargs))
        leaves = [_plain(leaf) for leaf in leaves]
        key, switches = self._key(leaves, structure)[0], _switches()

        def program() -> None:
            if _switches() == switches:  # JAX's switches may be those of a thread
                self._program(key, leaves, structure)

        if key is not None:
            threads.submit(program)

    def _key(self, leaves: list[Any], structure: Any) -> tuple[Hashable | None, list[Any]]:
        """What a program depends on within this process, or None if programs are not kept; and the arrays."""
        if _folder() is None:
            return None, []
        arrays, rest, numbers = [], [], []
        for leaf in leaves:
            number = _is_array(leaf)
            numbers.append(number)
            if number:
                arrays.append(leaf)
            else:  # 1, 1.0 and True are equal, but compile differently
                rest.append((type(leaf), leaf))
        if jax.device_count() > 1 or any(isinstance(array, Tracer) for array in arrays):
            return None, []
        shapes = tuple((array.shape, array.dtype) for array in arrays)
        return (structure, tuple(numbers), tuple(rest), shapes, _switches()), arrays

    def _program(self, key: Hashable, leaves: list[Any], structure: Any) -> Callable[[list[Any]], R] | None:
        """The program for a key, loaded or compiled by one thread only; None if there can be none."""
        with self._locks.setdefault(key, Lock()):
            if key not in self._known:
                folder = _folder()
                self._known[key] = None if folder is None else self._prepared(folder, leaves, structure)
            return self._known[key]

    def forget(self) -> None:
        """Drop the programs that this process has loaded; those on disk stay."""
        self._known.clear()

    @cached_property
    def _jitted(self) -> Callable[..., R]:
        options: Any = {"compiler_options": accepted(OPTIONS)}
        return eqx.filter_jit(self._function, **options)

    def _prepared(self, folder: Path, leaves: list, structure: Any) -> Callable[[list[Any]], R] | None:
        """The function for arguments like these, from disk or compiled; None if no key can be made for it."""
        described = [(leaf.shape, leaf.dtype.str) if _is_array(leaf) else leaf for leaf in leaves]
        try:
            content = _named((self._name, jax.tree.unflatten(structure, described), _switches()))
        except (pickle.PicklingError, AttributeError, TypeError):
            return None
        digest = hashlib.sha256(_surroundings() + content).hexdigest()
        own = folder / "jaxskel"
        if not usable(own):
            return None
        path = own / f"{self._name}-{digest[:32]}"
        program = read_program(path, sum(map(_is_array, leaves)))
        if program is None:
            with COMPILATIONS.one_more():
                program = self._compile(path, leaves, structure)
        return program

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
        lowered = jax.jit(flat).lower(*(leaf for leaf in leaves if _is_array(leaf)))
        result = structures[-1]
        strip_locations(lowered)
        text = lowered.as_text().replace(flat.__name__, "").encode()
        # Arguments that the function does not use are not in the text.
        shapes = [(leaf.shape, str(leaf.dtype)) for leaf in leaves if _is_array(leaf)]
        around = repr((OPTIONS, shapes, str(result))).encode()
        same = hashlib.sha256(_machine() + around + text).digest()
        program = read_same_program(path, f"{self._name}-*", same, sum(map(_is_array, leaves)))
        if program is not None:
            return program
        compiled = lowered.compile(compiler_options=accepted(OPTIONS))
        write_program(path, same, compiled, result)
        _give_memory_back()
        return lambda leaves: jax.tree.unflatten(result, compiled(*leaves))


def cached_jit(function: Callable[P, R]) -> CachedJit[P, R]:
    """Compile a function and store it on disk, see [`CachedJit`][]."""
    return CachedJit(function)


def _folder() -> Path | None:
    """Folder of JAX's persistent cache, if that is switched on."""
    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    # JAX can also use a bucket in a cloud, which is not supported here.
    return None if not folder or "://" in folder else Path(folder)


# Kinds of numbers that JAX takes as they are, whatever its precision.
_TAKEN = frozenset(map(np.dtype, ("float32", "int32", "uint8", "bool")))


@cache
def _is_array_type(kind: type) -> bool:
    return issubclass(kind, np.ndarray | np.generic | jax.Array | Tracer)


def _is_array(value: Any) -> bool:
    # By its type: `isinstance` of a JAX array takes ten times as long, and a call has some hundred arrays.
    return _is_array_type(type(value))


def _plain(leaf: Any) -> Any:
    """An array in JAX's precision and without its weak type, the mark of a Python number: both recompile."""
    if not _is_array(leaf) or not isinstance(leaf.dtype, np.dtype):
        return leaf
    if leaf.dtype not in _TAKEN:
        kind = _canonical(leaf.dtype, jax.config.jax_enable_x64)  # pyright: ignore[reportAttributeAccessIssue]
        if leaf.dtype != kind:
            leaf = np.asarray(leaf, kind)
    weak = getattr(leaf, "weak_type", False) and not isinstance(leaf, Tracer)
    return jnp.asarray(leaf, leaf.dtype) if weak else leaf


@cache
def _canonical(kind: np.dtype, _: bool) -> np.dtype:
    """JAX's precision for a kind of number; the second argument is the setting that it depends on."""
    return np.dtype(jax.dtypes.canonicalize_dtype(kind))


def _switches() -> tuple[Any, ...]:
    optimised = not jax.config.read("jax_disable_most_optimizations")  # pyright: ignore[reportAttributeAccessIssue]
    return optimised, *(getattr(jax.config, name) for name in _SWITCHES)


@cache
def _surroundings() -> bytes:
    """What a program depends on besides its arguments: code, versions, processor."""
    return digest_of_code().encode() + _machine()


@cache
def _machine() -> bytes:
    """What a program depends on besides its text: versions, processor."""
    device, flags = jax.devices()[0], os.environ.get("XLA_FLAGS")
    versions = [import_module(name).__version__ for name in _LIBRARIES]
    return repr((versions, processor(), device.platform, device.device_kind, flags)).encode()


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


class _Namer(pickle.Pickler):
    """Pickles static arguments; functions and classes are pickled by name, if they are from a known module."""

    def reducer_override(self, obj: Any) -> Any:
        if isinstance(obj, type | FunctionType | BuiltinFunctionType):
            if (obj.__module__ or "").partition(".")[0] not in _KNOWN:
                raise pickle.PicklingError(f"{obj} is not known")
        return NotImplemented


def _named(tree: Any) -> bytes:
    file = io.BytesIO()
    namer = _Namer(file, 5)
    namer.fast = True  # without a memo, so that equal trees give equal bytes, whether or not they share objects
    namer.dump(tree)
    return file.getvalue()
