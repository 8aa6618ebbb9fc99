"""The ways to reconstruct that tables and figures compare, by the names that they use."""

from collections.abc import Callable
from dataclasses import dataclass

from jaxskel import Settings, Tracking, paper_settings


@dataclass(frozen=True)
class Preset:
    """A way to reconstruct."""

    name: str
    """On the command line, in file names, in figures."""
    title: str
    """Above its column."""
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
