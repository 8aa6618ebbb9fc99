"""Stacks: trees of arrays with a leading axis, mostly of frames."""

from typing import Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Int


def single_precision(tree: Any) -> Any:
    """Arrays in the precision of JAX's computations, so that the caller's precision does not cause a recompilation.

    Nor does the weak type of what was a Python number.
    """

    def single(a: Any) -> Any:
        if not hasattr(a, "dtype") or a.dtype.kind in "bi":
            return a
        kept = a.dtype == np.float32 and (isinstance(a, Tracer) or not getattr(a, "weak_type", False))
        return a if kept else np.asarray(a, np.float32)

    return jax.tree.map(single, tree)


# Padding is not written in arrays of more numbers than this for each member: silhouette distances, above all.
_LARGE = 100_000
# XLA uses memory aligned to this many bytes without copying it.
_ALIGNED = 64
STACK = 32
"""Stacks of a recording's frames on the device are padded to a multiple of this, so that few shapes are compiled."""


def step_above(count: int) -> int:
    """Round up by at most a quarter: four values between powers of two, so that few shapes are compiled."""
    step = max(1, 2 ** (count.bit_length() - 3))
    return -(-count // step) * step


def aligned(shape: tuple[int, ...], kind: Any = np.float32) -> np.ndarray:
    """An array of zeros, aligned so that JAX on a CPU uses it without copying.

    Do not change it after it has been passed to JAX.
    """
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.zeros(size + _ALIGNED, np.uint8)  # pages that nothing is written to take no memory
    start = -memory.ctypes.data % _ALIGNED
    return memory[start : start + size].view(kind).reshape(shape)


def take(tree: Any, index: Int[np.ndarray, "*some"] | Bool[np.ndarray, "*all"]) -> Any:
    """Select members of a stack by index or mask; indices may repeat, in any order."""
    return jax.tree.map(lambda a: np.asarray(a)[index], tree)


def padded(tree: Any, length: int) -> Any:
    """A stack in single precision, padded with its first member so that every batch has the same shapes.

    Padding of large arrays stays zero, and takes neither time nor memory.
    """

    def pad(a: np.ndarray | jax.Array) -> np.ndarray | jax.Array:
        if len(a) == length:
            return a
        whole = aligned((length, *a.shape[1:]), a.dtype)
        whole[: len(a)] = np.asarray(a)
        if a.size < _LARGE * len(a):
            whole[len(a) :] = whole[0]
        return whole

    return jax.tree.map(pad, single_precision(tree))


def length_of(tree: Any) -> int:
    """Number of members of a stack."""
    return len(jax.tree.leaves(tree)[0])


def filled(tree: Any, step: int = STACK) -> Any:
    """A stack padded to a multiple of `step`."""
    return padded(tree, step * -(-length_of(tree) // step))


def on_device(tree: Any, step: int = STACK) -> Any:
    """A stack padded to a multiple of `step` and on the device, as compiled functions need it.

    It is returned unchanged if it is already there: who put it there chose its length.
    """
    if all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(tree)):
        return tree
    return jax.device_put(filled(tree, step))
