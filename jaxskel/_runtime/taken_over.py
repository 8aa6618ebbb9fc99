"""Arrays whose memory JAX takes over."""

import math

import numpy as np

# JAX copies arrays on the CPU whose memory does not begin at a multiple of this many bytes.
_ALIGNED = 64


def unwritten(shape: tuple[int, ...], kind: type[np.generic]) -> np.ndarray:
    """An array to be written once, which `jax.device_put` takes over on the CPU without a copy.

    Nothing may write to it after that.
    """
    size = math.prod(shape) * np.dtype(kind).itemsize
    memory = np.empty(size + _ALIGNED, np.uint8)
    first = -memory.ctypes.data % _ALIGNED
    return memory[first : first + size].view(kind).reshape(shape)
