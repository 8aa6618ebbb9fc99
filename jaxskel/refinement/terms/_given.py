"""An objective as users give it: one, or a function that makes one for a body."""

from collections.abc import Callable
from typing import Any

from ..._runtime.kinds import told
from ...body import Body
from ._base import Objective

GivenObjective = Objective | Callable[[Body], Objective]
"""An objective, or a function that makes one for the subject's body."""


def check_objective(objective: Any) -> None:
    """Refuse what is no objective and has not its methods either.

    Raises:
        ValueError: One line.
    """
    if isinstance(objective, Objective):
        return
    methods = ("residuals", "correspond", "costs", "couplings")
    if isinstance(objective, type) or not all(hasattr(objective, name) for name in methods):
        raise ValueError(f"objective: is {told(objective)}; give an Objective, such as paper_objective()")


def check_given(objective: Any) -> None:
    """As `check_objective`, but a function passes: it is asked when a body is known.

    Raises:
        ValueError: One line.
    """
    if isinstance(objective, type) or not callable(objective):
        check_objective(objective)


def objective_of(given: Any, body: Body) -> Objective:
    """The objective for a subject.

    Raises:
        ValueError: A function made something else.
    """
    if isinstance(given, Objective):
        return given
    found = given if hasattr(given, "residuals") else given(body)
    check_objective(found)
    return found
