"""The presets that tables and figures compare, with their names."""

from collections.abc import Callable
from dataclasses import dataclass

from jaxskel import Settings, Tracking, paper_settings


@dataclass(frozen=True)
class Preset:
    """A way to reconstruct, with its names."""

    name: str
    """Name on the command line, in file names and in figures."""
    title: str
    """Heading of its column."""
    settings: Callable[[], Settings]


PRESETS = {
    preset.name: preset
    for preset in (
        Preset("paper", "`paper_settings()`", paper_settings),
        Preset("default", "`Settings()`", Settings),
        Preset("tracked", "`Settings(tracking=Tracking())`", lambda: Settings(tracking=Tracking())),
    )
}
"""All presets by name, in the order of the columns."""
