"""The presets that tables and figures compare, with their names."""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx

from jaxskel import Settings, Tracking, paper_settings
from jaxskel.graph import FollowedHeights


@dataclass(frozen=True)
class Preset:
    """A way to reconstruct, with its names."""

    name: str
    """Name on the command line, in file names and in figures."""
    title: str
    """Heading of its column."""
    settings: Callable[[], Settings]


def _followed() -> Settings:
    return eqx.tree_at(lambda s: s.graph.root_finder, paper_settings(), FollowedHeights())


PRESETS = {
    preset.name: preset
    for preset in (
        Preset("paper", "`paper_settings()`", paper_settings),
        Preset("followed", "the same, `FollowedHeights()`", _followed),
        Preset("default", "`Settings()`", Settings),
        Preset("tracked", "`Settings(tracking=Tracking())`", lambda: Settings(tracking=Tracking())),
    )
}
"""All presets by name, in the order of the columns."""
