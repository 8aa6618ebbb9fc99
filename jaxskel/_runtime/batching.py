"""Stacks: trees of arrays with a leading axis, of frames mostly."""

from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Int


def single_precision(tree: Any) -> Any:
    """Arrays in the precision that JAX computes in, so that the caller's precision does not compile again."""
    return jax.tree.map(lambda a: a if a.dtype.kind in "bi" else np.asarray(a, np.float32), tree)


# Memory that begins at a multiple of so many bytes is used by XLA where it is.
_ALIGNED = 64
STACK = 32
"""Stacks on the device are filled up to a multiple of this, so that few shapes are compiled."""


def step_above(count: int) -> int:
    """A number that is not less, and at most a quarter more: four to each power of two, so few shapes are compiled."""
    step = max(1, 2 ** (count.bit_length() - 3))
    return -(-count // step) * step


def aligned(shape: tuple[int, ...], kind: Any = np.float32) -> np.ndarray:
    """An array, not filled yet, where JAX on a processor takes it as it is instead of copying it.

    It must not change any more once JAX has it.
    """
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.empty(size + _ALIGNED, np.uint8)
    start = -memory.ctypes.data % _ALIGNED
    return memory[start : start + size].view(kind).reshape(shape)


def take(tree: Any, index: Int[np.ndarray, "*some"] | Bool[np.ndarray, "*all"]) -> Any:
    """Some of a stack, in any order, also several times."""
    return jax.tree.map(lambda a: np.asarray(a)[index], tree)


def padded(tree: Any, length: int) -> Any:
    """A stack filled up with its first member, so that every batch has the same shapes; in single precision."""

    def pad(a: np.ndarray) -> np.ndarray:
        if len(a) == length:
            return a
        whole = aligned((length, *a.shape[1:]), a.dtype)
        whole[: len(a)], whole[len(a) :] = a, a[0] if len(a) else 0
        return whole

    return jax.tree.map(pad, single_precision(tree))


def filled(tree: Any) -> Any:
    """A stack filled up to a multiple of `STACK`."""
    return padded(tree, STACK * -(-len(jax.tree.leaves(tree)[0]) // STACK))


def on_device(tree: Any) -> Any:
    """A stack as compiled functions take it: filled up, and where it is already, left alone."""
    if all(isinstance(leaf, jax.Array) and len(leaf) % STACK == 0 for leaf in jax.tree.leaves(tree)):
        return tree
    return jax.device_put(filled(tree))
