"""Options of XLA's compiler for single programs, no global flags."""

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp

QUICK = {"xla_cpu_use_fusion_emitters": False}
"""XLA for CPUs has two emitters of code. The older one compiles in half the time. What it makes is as fast for the
refinement by graphs alone (29 and 34 ms for 16 frames of `crowd_07`), turned poses, words and blocks of pixels. Scores
of limbs take half as long again and the linearised body a third, which is 3 % of a frame (`crowd_08`; 49 s of
compilation became 26 s). Fits and the refinement by outlines take twice as long, unexplained outlines seven times."""


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
