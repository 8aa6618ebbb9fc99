"""A class of a notebook's cell that is run again is the same class to an objective, and nothing is compiled again."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from jaxskel.refinement.terms import AbstractTerm, GemanMcClure, Objective, RestPrior, Robust, _definitions

CELL = """
class Floor(AbstractTerm):
    '''Balls of the feet.'''
    height: float
    weight: Any = eqx.field(converter=jnp.asarray, default=1.0)

    def residual(self, body, observed, fixed):
        return self.stretched(body.joints[jnp.array([11, 14]), 2] - self.height)

    @staticmethod
    def stretched(away):
        return SCALE * away
"""


@pytest.fixture
def notebook(monkeypatch) -> dict[str, Any]:
    """Variables of a notebook in a process that has seen no class yet."""
    monkeypatch.setattr(_definitions, "_first", {})
    monkeypatch.setattr(_definitions, "_definitions", {})
    return {"__name__": "__main__", "AbstractTerm": AbstractTerm, "Any": Any, "eqx": eqx, "jnp": jnp, "SCALE": 2.0}


def run(notebook: dict[str, Any], cell: str = CELL) -> type:
    exec(cell, notebook)  # noqa: S102
    return notebook["Floor"]


def structure_of(term: Any) -> Any:
    return jax.tree.structure(Objective({"floor": term}))


def test_a_cell_that_is_run_again_changes_nothing(notebook):
    first, second = run(notebook), run(notebook)
    assert first is not second
    assert structure_of(first(0.1)) == structure_of(second(0.2))
    again: Any = Objective({"floor": second(0.2)}).terms["floor"]
    assert again.height == pytest.approx(0.2)
    assert type(again) is first


def test_so_does_a_class_within_another_term(notebook):
    first, second = run(notebook), run(notebook)
    loss = GemanMcClure(0.05)
    assert structure_of(Robust(first(0.1), loss)) == structure_of(Robust(second(0.2), loss))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("SCALE * away", "SCALE + away"),
        ("11, 14", "8, 14"),
        ("default=1.0", "default=2.0"),
        ("    height: float\n", "    height: float\n    play: float = 0.1\n"),
        ("@staticmethod\n    def stretched(away)", "def stretched(self, away)"),
    ],
)
def test_another_definition_is_another_class(notebook, old, new):
    assert old in CELL
    first, other = run(notebook), run(notebook, CELL.replace(old, new))
    assert structure_of(first(0.1)) != structure_of(other(0.1))
    assert type(Objective({"floor": other(0.1)}).terms["floor"]) is other


def test_a_class_that_saw_other_outer_variables_is_not_taken(notebook):
    first = run(notebook)
    assert type(Objective({"floor": first(0.1)}).terms["floor"]) is first
    notebook["SCALE"] = 3.0
    second = run(notebook)
    assert type(Objective({"floor": second(0.1)}).terms["floor"]) is second
    # The first class, whose code may have run with either value, is left alone from here on.
    assert type(Objective({"floor": first(0.1)}).terms["floor"]) is first
    notebook["SCALE"] = 2.0
    third = run(notebook)
    assert type(Objective({"floor": third(0.1)}).terms["floor"]) is third


def test_what_cannot_be_compared_stays_as_it_is(notebook):
    notebook["SCALE"] = jnp.ones(2)
    first, second = run(notebook), run(notebook)
    assert type(Objective({"floor": second(0.1)}).terms["floor"]) is second
    assert structure_of(first(0.1)) != structure_of(second(0.1))


def test_classes_of_modules_are_not_looked_at(notebook):
    notebook["__name__"] = "lab.terms"
    first, second = run(notebook), run(notebook)
    assert structure_of(first(0.1)) != structure_of(second(0.1))
    own = RestPrior()
    assert type(Objective({"rest": own}).terms["rest"]) is RestPrior
