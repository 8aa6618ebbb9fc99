"""The objective of a Python file, for `--objective` of `run`, `batch` and `live`."""

import sys
from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Annotated

import equinox as eqx
import typer

from ..body import Body
from ..pipeline import Settings
from ..refinement.terms import Objective, objective_of

_NAME = "objective"

ObjectiveOption = Annotated[
    Path | None,
    typer.Option(
        "--objective", help="Python file with objective(body): what search and refinement minimise. It is executed."
    ),
]


def with_objective(settings: Settings, path: Path | None) -> Settings:
    """The settings with the objective of a file, if one is given: for the refinement, and for a search.

    Raises:
        ValueError: One line that names the file.
    """
    if path is None:
        return settings
    digest = _digest(path)
    search = settings.search
    if search is not None:
        search = replace(search, objective=ObjectiveFile(path, digest, alone=True))
    refinement = replace(settings.refinement, objective=ObjectiveFile(path, digest))
    return replace(settings, search=search, refinement=refinement)


class ObjectiveFile(eqx.Module):
    """What a file's `objective` says: an objective, or a function that makes one for a body.

    The file is executed once in each process, so that it can be sent to others by its path. A process that finds
    another content there refuses it.

    Attributes:
        path: Where the file is; of the method of a batch, only its content is a part.
        digest: Digest of its content, in hexadecimal digits.
        alone: Whether terms that couple frames are left out, as for a search, which looks at single frames.

    Raises:
        ValueError: One line that names the file.
    """

    path: Path = eqx.field(metadata={"described": False})
    digest: str
    alone: bool = False

    def __check_init__(self):
        """Refuse a file that cannot be executed, or has no objective."""
        _executed(self.path, self.digest)

    def __call__(self, body: Body) -> Objective:
        """The objective for a subject."""
        try:
            found = objective_of(getattr(_executed(self.path, self.digest), _NAME), body)
            return found.without(*found.couplings) if self.alone and found.couplings else found
        except ValueError as error:
            raise ValueError(f"{self.path}: {error}") from None


def _digest(path: Path) -> str:
    if not path.is_file():
        raise ValueError(f"{path}: is no Python file; give one that defines {_NAME}(body)")
    return sha256(path.read_bytes()).hexdigest()


@cache
def _executed(path: Path, digest: str) -> ModuleType:
    name = f"jaxskel_objective_{path.stem}"
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path}: is no Python file; give one that defines {_NAME}(body)")
    if _digest(path) != digest:
        raise ValueError(f"{path}: was changed after the command began; run the command again")
    module = module_from_spec(spec)
    sys.modules[name] = module  # where its classes are looked up
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(f"{path}: {type(error).__name__}: {error}") from error
    if not hasattr(module, _NAME):
        raise ValueError(f"{path}: defines no {_NAME}; write a function {_NAME}(body) that returns an Objective")
    return module
