"""Options of XLA's compiler for single programs, no global flags."""

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp

QUICK = {"xla_cpu_use_fusion_emitters": False}
"""XLA for CPUs has two emitters of code. The older one compiles in half the time. For these programs it makes code as
fast: scores of limbs, the linearised body, turned poses, words and blocks of pixels (`crowd_08`: 49 s of compilation
become 26 s). Fits and the refinement take twice as long with it, unexplained outlines of a single frame three times."""


def accepted(options: dict[str, Any]) -> dict[str, Any]:
    """Those options that this version of the compiler knows."""
    return {name: value for name, value in options.items() if _knows(name, value)}


@cache
def _knows(name: str, value: bool) -> bool:
    try:
        jax.jit(jnp.negative).lower(1.0).compile(compiler_options={name: value})
    except Exception:  # of a kind that depends on the version
        return False
    return True
