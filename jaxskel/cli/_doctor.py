"""`jaxskel doctor`: tells what is installed, what this machine offers, and how to mend what is missing."""

import os
import platform
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import typer

from .._runtime.cores import usable_cores
from ._installed import DISTRIBUTION, Package, core_packages, packages_of_extras, remedy
from ._say import say, warn

_WIDTH = 11
_MEMORY_INFO = Path("/proc/meminfo")  # of Linux


def doctor() -> None:
    """Tell versions, what this machine offers, which extras are there, and how to mend what is missing."""
    core = core_packages()
    _tell("jaxskel", f"{version(DISTRIBUTION)} in {Path(__file__).parents[1]}")
    _tell("Python", f"{platform.python_version()} on {platform.platform()}")
    _tell("packages", ", ".join(_named(core)))
    _tell("cores", f"{usable_cores()} usable")
    memory = _memory()
    if memory:
        _tell("memory", memory)
    problems = list(_device_problems())
    _tell("compiled", _compiled())
    from ..live import cameras_here

    cameras = cameras_here()
    _tell("cameras", "; ".join(cameras) or "none that OpenCV can open")
    for extra, packages in packages_of_extras().items():
        good = all(each.is_good for each in packages)
        _tell(extra, ", ".join(map(_told, packages)) + ("" if good else f"; to mend it: {remedy(packages)}"))
    bad = [each for each in core if not each.is_good]
    if bad:
        problems.append(f"{', '.join(map(_told, bad))}; to mend it: {remedy(bad)}")
    for problem in problems:
        warn(problem)
    if problems:
        raise typer.Exit(1)
    say("all that is needed is there")


def _tell(what: str, line: str) -> None:
    say(f"{what:<{_WIDTH}}{line}")


def _named(core: list[Package]) -> Iterator[str]:
    """Names and versions of packages; JAX's compiler, which JAX brings, beside JAX."""
    for each in core:
        yield _told(each)
        if each.name == "jax":
            try:
                yield f"jaxlib {version('jaxlib')}"
            except PackageNotFoundError:
                yield "jaxlib missing"


def _told(package: Package) -> str:
    if package.version is None:
        return f"{package.name} missing"
    return f"{package.name} {package.version}" + ("" if package.is_good else f" (needed: {package.wanted})")


def _memory() -> str:
    """The machine's memory, where the system tells it."""
    told = []
    with suppress(AttributeError, ValueError, OSError):  # Windows has no sysconf
        told.append(f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 1e9:.1f} GB in all")
    # What sysconf calls available is less: files that Linux keeps in memory, and lets go, count as used.
    with suppress(OSError, StopIteration):
        lines = _MEMORY_INFO.read_text(encoding="utf-8").splitlines()
        available = next(line for line in lines if line.startswith("MemAvailable:"))
        told.append(f"{int(available.split()[1]) * 1024 / 1e9:.1f} GB free")
    return ", ".join(told)


def _device_problems() -> Iterator[str]:
    """Tell JAX's devices; yield what is wrong if JAX cannot compute on them."""
    import jax

    try:
        devices = jax.devices()
        _tell("devices", ", ".join(f"{device.platform} {device.id} ({device.device_kind})" for device in devices))
        if float(jax.jit(lambda number: number + 1)(1.0)) != 2:
            yield "JAX computes 1 + 1 wrongly; install jax and jaxlib again"
    except Exception as error:  # whatever a device's driver raises
        yield f"JAX cannot compute ({' '.join(str(error).split())}); install jax and jaxlib again"


def _compiled() -> str:
    """Where compiled code is kept, and how large that is."""
    import jax

    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    if not folder:
        return "is not kept"
    if "://" in folder:
        return f"kept in {folder}"
    sizes = [path.stat().st_size for path in Path(folder).rglob("*") if path.is_file()]
    return f"kept in {folder}: {len(sizes)} files, {sum(sizes) / 1e6:.0f} MB"
