"""Poses of several people in one room, one person after the other."""

from collections.abc import Mapping

from ..pipeline import Settings, reconstruct
from ..poses import Poses
from ..recording import Recording


def reconstruct_people(people: Mapping[str, Recording], settings: Settings | None = None) -> dict[str, Poses]:
    """Reconstruct the pose of every person in every frame.

    Args:
        people: The recording of each person by name, as from `hide_others` or `tell_people_apart`.
        settings: See `Settings`; the default ones if None.

    Returns:
        Poses of each person, by name. A person has a body, a status and covariances of their own.
    """
    return {name: reconstruct(recording, settings) for name, recording in people.items()}
