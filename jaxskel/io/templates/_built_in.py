"""The templates that come with the package, beside the paper's human."""

from importlib.resources import as_file, files

from ...body import Skeleton
from ._template_file import read_template

BUILT_IN = ("human-21", "hand", "quadruped")
"""Their names."""


def human_21() -> Skeleton:
    """The human with spine, chest, wrists, hands, ankles and feet apart (m)."""
    return built_in(BUILT_IN[0])


def hand() -> Skeleton:
    """A left hand with 17 joints, held up with the palm to the front (m); the graph begins at the forearm."""
    return built_in(BUILT_IN[1])


def quadruped() -> Skeleton:
    """A dog with 18 joints, standing (m)."""
    return built_in(BUILT_IN[2])


def built_in(name: str) -> Skeleton:
    """The template of a name of `BUILT_IN` (m)."""
    with as_file(files(str(__package__)).joinpath(f"{name}.toml")) as path:
        return read_template(path)
