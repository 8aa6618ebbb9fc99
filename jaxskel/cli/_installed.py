"""What the installed distribution says it needs, and what of that is there."""

from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version

from packaging.requirements import Requirement

DISTRIBUTION = "jaxskel"
# Extras of those who work on the package itself; whoever uses it needs none of them.
_OF_DEVELOPERS = {"test", "peers", "notebooks", "dev"}


@dataclass(frozen=True)
class Package:
    """A package that is needed.

    Attributes:
        name: Name of its distribution.
        wanted: Name and versions, as pip is told them.
        version: The installed version; None if it is not installed.
        is_good: Whether it is installed, in a version that will do.
    """

    name: str
    wanted: str
    version: str | None
    is_good: bool


def core_packages() -> list[Package]:
    """Packages without which nothing works, in the order of the distribution's metadata."""
    return _packages(None)


def packages_of_extras() -> dict[str, list[Package]]:
    """Packages of each extra that adds a feature, by the extra's name."""
    extras = metadata(DISTRIBUTION).get_all("Provides-Extra") or []
    return {extra: _packages(extra) for extra in extras if extra not in _OF_DEVELOPERS}


def remedy(packages: list[Package]) -> str:
    """The command that installs packages that are missing or too old.

    It names the packages themselves and not the extra, so that it does not matter where this package came from.
    """
    return " ".join(["python -m pip install", *(f'"{each.wanted}"' for each in packages if not each.is_good)])


def _packages(extra: str | None) -> list[Package]:
    """Packages of an extra, or, for None, those that every installation needs."""
    found = []
    for line in requires(DISTRIBUTION) or []:
        need = Requirement(line)
        always = need.marker is None or need.marker.evaluate({"extra": ""})
        if always if extra is None else not always and need.marker and need.marker.evaluate({"extra": extra}):
            found.append(_package(need))
    return found


def _package(need: Requirement) -> Package:
    try:
        there = version(need.name)
    except PackageNotFoundError:
        there = None
    is_good = there is not None and need.specifier.contains(there, prereleases=True)
    return Package(need.name, f"{need.name}{need.specifier}", there, is_good)
