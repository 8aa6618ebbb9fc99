"""Converts manifests of earlier versions to the current format, so that finished recordings stay finished."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from .._runtime.code_digest import digest_of_definitions

# Earlier, settings were flat, and definitions of the package were named with their module.
_GROUPS = {
    "hull": ("HullSettings", ("spacing", "box", "min_views", "max_misses")),
    "graph": ("GraphSettings", ("root", "min_branch")),
    "matching": ("MatchingSettings", ("matcher", "descriptor")),
    "refinement": ("RefinementSettings", ("objective", "parametrisation", "solver", "rounds", "max_steps")),
}
_KEYS = {"root": "root_finder"}
_RENAMED = {"LevenbergMarquardt": "NormalEquationsLM"}
_PACKAGE = "jaxskel."
# Values that were fixed in every earlier version.
_ALWAYS = {"graph": {"skeletoniser": {"class": "VoxelScooping"}}}
_SEARCH = {"objective": "volume_objective", "enough": 0.0, "vague": np.inf}
_DOUBTFUL = 45.0
_SETTINGS: dict[str, Any] = {"template": None}
# The default of a prior was written out where it is the template's now.
_FIRMNESS = [1.0, 0.5, 3.0, 0.05, 0.1, 3.0, 0.05, 0.1, 0.2, 0.2, 0.2, 0.2, 0.0, 0.0, 0.0, 0.0]


def modern_method(method: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest's method in the current format; one that has it already is returned unchanged."""
    found = _without_places(dict(method))
    settings = found.get("settings")
    if not isinstance(settings, dict):
        return found
    settings = _SETTINGS | (_grouped(settings) if "spacing" in settings else settings)
    if isinstance(settings.get("search"), dict):
        settings["search"] = _search(settings["search"])
    tracking = settings.get("tracking")
    if isinstance(tracking, dict) and "margin" in tracking:  # a turn had no margin of its own
        settings["tracking"] = {"turn_margin": tracking["margin"]} | tracking
    return found | {"settings": settings}


@cache
def modern_version(version: str) -> str:
    """The current version if a comparison has shown bit-identical results; otherwise the version itself.

    `equal_versions.txt` lists the compared versions, each with the digest of the definitions that it was compared
    with. Any later change of a definition makes that line void.
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
        found = {key: _without_places(each) for key, each in value.items()}
        if found.get("class") == "RestPrior" and _is_the_default(found.get("firmness")):
            found["firmness"] = None
        return found
    if isinstance(value, list):
        return [_without_places(each) for each in value]
    if isinstance(value, str) and value.startswith(_PACKAGE):
        name = value.rpartition(".")[2]
        return _RENAMED.get(name, name)
    return value


def _search(search: dict[str, Any]) -> dict[str, Any]:
    # The default of `doubtful` was written out, and made way for what poses of the subject cost.
    made_way = {"doubtful": None} if "enough" not in search and search.get("doubtful") == _DOUBTFUL else {}
    return _SEARCH | search | made_way


def _is_the_default(firmness: Any) -> bool:
    # It was stored in single precision.
    return isinstance(firmness, list) and [round(each, 6) for each in firmness] == _FIRMNESS


def _grouped(flat: dict[str, Any]) -> dict[str, Any]:
    groups: dict[str, Any] = {}
    rest = dict(flat)
    for group, (name, keys) in _GROUPS.items():
        moved = {_KEYS.get(key, key): rest.pop(key) for key in keys if key in rest}
        groups[group] = {"class": name} | _ALWAYS.get(group, {}) | moved
    return groups | rest
