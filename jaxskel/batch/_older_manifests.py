"""Manifests of earlier versions, read as this version would have written them: what is finished stays finished."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from .._runtime.code_digest import digest_of_definitions

# Once, settings were flat, and what belongs to the package was named by its module.
_GROUPS = {
    "hull": ("HullSettings", ("spacing", "box", "min_views", "max_misses")),
    "graph": ("GraphSettings", ("root", "min_branch")),
    "matching": ("MatchingSettings", ("matcher", "descriptor")),
    "refinement": ("RefinementSettings", ("objective", "parametrisation", "solver", "rounds", "max_steps")),
}
_KEYS = {"root": "root_finder"}
_RENAMED = {"LevenbergMarquardt": "NormalEquationsLM"}
_PACKAGE = "jaxskel."
# What every earlier version did, and could not do otherwise.
_ALWAYS = {"graph": {"skeletoniser": {"class": "VoxelScooping"}}}


def modern_method(method: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest's method as this version writes it; one of this version as it is."""
    found = _without_places(dict(method))
    settings = found.get("settings")
    if isinstance(settings, dict) and "spacing" in settings:
        found["settings"] = _grouped(settings)
    return found


@cache
def modern_version(version: str) -> str:
    """The version that has the same results, bit for bit: this one, where a comparison has shown it.

    `equal_versions.txt` names the versions that were compared, each with the digest of the definitions that it was
    compared with. Any later change of a definition makes that line void.
    """
    table = files("jaxskel.batch").joinpath("equal_versions.txt").read_text(encoding="utf-8")
    for line in table.splitlines():
        if line and not line.startswith("#"):
            older, base, digest = line.split()
            if version == older and digest == digest_of_definitions()[:12]:
                return f"{base}+{digest}"
    return version


def _without_places(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_places(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_without_places(each) for each in value]
    if isinstance(value, str) and value.startswith(_PACKAGE):
        name = value.rpartition(".")[2]
        return _RENAMED.get(name, name)
    return value


def _grouped(flat: dict[str, Any]) -> dict[str, Any]:
    groups: dict[str, Any] = {}
    rest = dict(flat)
    for group, (name, keys) in _GROUPS.items():
        moved = {_KEYS.get(key, key): rest.pop(key) for key in keys if key in rest}
        groups[group] = {"class": name} | _ALWAYS.get(group, {}) | moved
    return groups | rest
