"""Options of XLA's compiler for the programs of this package, no global flags."""

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp

OPTIONS = {"xla_cpu_use_fusion_emitters": False, "xla_cpu_prefer_vector_width": 512}
"""XLA for CPUs has two emitters of code. The older one compiles in 0.55 times the time, and what it makes is as fast
(`film_50` tracked and single frames of `crowd_08`: 0.96 to 1.06 times the time), with one exception: where a kernel
writes over what it reads, it takes number by number, four to eight times as long, see
[`computed_once`][jaxskel._runtime.materialise.computed_once].

XLA uses vectors of 256 bits by default. With 512, where a processor has them, fits, limbs and the refinement took
0.90 to 0.93 times the time (an AMD EPYC)."""


def accepted(options: dict[str, Any]) -> dict[str, Any]:
    """Those options that this version of the compiler knows."""
    return {name: value for name, value in options.items() if _knows(name, value)}


@cache
def _knows(name: str, value: Any) -> bool:
    try:
        jax.jit(jnp.negative).lower(1.0).compile(compiler_options={name: value})
    except Exception:  # of a kind that depends on the version
        return False
    return True
