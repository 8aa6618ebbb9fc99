"""What commands that show poses draw: one person, or several in one room."""

from pathlib import Path

from ..io.recordings import RECORDING_FILE, holds_people, read_people, read_recording
from ..people import everybody
from ..poses import Poses
from ..recording import Recording


def read_room(source: Path) -> Recording:
    """A recording; where people have masks of their own, with the silhouettes of everybody.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    if not holds_people(source):
        return read_recording(source)
    place = (source.parent if source.name == RECORDING_FILE else source).resolve()
    return everybody(read_people(source)).named(place.name if place.is_dir() else place.stem)


def one_or_all(people: dict[str, Poses]) -> Poses | dict[str, Poses]:
    """What is drawn: poses without a name where there is only one person."""
    return people if len(people) > 1 else next(iter(people.values()))
