"""Source locations in lowered programs."""

from jax.stages import Lowered
from jaxlib.mlir import passmanager

_STRIP = "builtin.module(strip-debuginfo)"


def strip_locations(lowered: Lowered) -> None:
    """Remove from a lowered program which line of Python each operation comes from.

    Compiled programs would keep them, a third of the bytes of a fit, and read them again whenever they are loaded.
    """
    module = lowered.compiler_ir()
    if module is None:
        return
    with module.context:
        passmanager.PassManager.parse(_STRIP).run(module.operation)
