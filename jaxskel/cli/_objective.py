"""The objective of a Python file, for `jaxskel run --objective`."""

import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import equinox as eqx

from ..body import Body
from ..refinement.terms import Objective, objective_of

_NAME = "objective"


class ObjectiveFile(eqx.Module):
    """What a file's `objective` says: an objective, or a function that makes one for a body.

    The file is executed once in each process, so that it can be sent to others by its path.

    Attributes:
        alone: Whether terms that couple frames are left out, as for a search, which looks at single frames.

    Raises:
        ValueError: One line that names the file.
    """

    path: Path
    alone: bool = False

    def __check_init__(self):
        """Refuse a file that cannot be executed, or has no objective."""
        _executed(self.path)

    def __call__(self, body: Body) -> Objective:
        """The objective for a subject."""
        try:
            found = objective_of(getattr(_executed(self.path), _NAME), body)
            return found.without(*found.couplings) if self.alone and found.couplings else found
        except ValueError as error:
            raise ValueError(f"{self.path}: {error}") from None


@cache
def _executed(path: Path) -> ModuleType:
    name = f"jaxskel_objective_{path.stem}"
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f"{path}: is no Python file; give one that defines {_NAME}(body)")
    module = module_from_spec(spec)
    sys.modules[name] = module  # where its classes are looked up
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(f"{path}: {type(error).__name__}: {error}") from error
    if not hasattr(module, _NAME):
        raise ValueError(f"{path}: defines no {_NAME}; write a function {_NAME}(body) that returns an Objective")
    return module
