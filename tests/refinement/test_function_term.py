"""Functions as terms: what counts as the same function, what is refused, and that nothing is compiled twice."""

import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import ideal_graph, pose_of

from jaxskel import default_adult, refine_frames
from jaxskel.refinement.parametrisations import ExactBones
from jaxskel.refinement.solvers import NormalEquationsLM
from jaxskel.refinement.terms import Objective, RestPrior, coupling_from_function, from_function, paper_objective, place

ADULT = jax.tree.map(lambda a: np.asarray(a, np.float32), default_adult())
TRACES = []


def count():
    TRACES.append(1)


CELL = """
def stick(body, observed, length):
    count()
    return jnp.sqrt(((body.joints[5] - body.joints[8]) ** 2).sum() + 1e-12) - length
"""


def cell(source: str = CELL, **names) -> types.FunctionType:
    """Run a notebook cell in a namespace of its own."""
    world = {"jnp": jnp, "count": count} | names
    exec(compile(source, "<cell>", "exec"), world)
    return next(v for k, v in world.items() if k not in ("jnp", "count", "__builtins__", *names))


def test_a_function_is_a_term():
    pose = pose_of(2)
    body, observed = place(ADULT, pose), ideal_graph(ADULT, pose)
    apart = float(np.linalg.norm(body.joints[5] - body.joints[8]))
    term = from_function(cell(), 0.25, weight=9.0)
    np.testing.assert_allclose(term.residual(body, observed, None), apart - 0.25, rtol=1e-5)
    np.testing.assert_allclose(
        Objective({"stick": term}).costs(body, observed)["stick"], 9 * (apart - 0.25) ** 2, rtol=1e-4
    )
    assert not term.needs_graph
    assert from_function(cell(), 0.25, needs_graph=True).needs_graph
    assert from_function(cell(), 0.25, needs_outlines=True).needs_outlines


def test_a_cell_run_again_is_the_same_function_and_a_changed_one_is_not():
    assert cell() is not cell()
    structure = lambda *args: jax.tree.structure(from_function(*args))  # noqa: E731
    assert structure(cell(), 0.25) == structure(cell(), 0.5)
    assert hash(structure(cell(), 0.25)) == hash(structure(cell(), 0.5))
    moved = cell("\n\n" + CELL)  # two lines further down
    assert moved.__code__ != cell().__code__
    assert structure(moved, 0.25) == structure(cell(), 0.25)
    assert structure(cell(), 0.25) != structure(cell(CELL.replace("- length", "+ length")), 0.25)
    assert structure(cell(), 0.25) != structure(cell(CELL.replace("1e-12", "1e-9")), 0.25)
    assert structure(cell(), 0.25) != structure(cell(CELL.replace("joints[8]", "joints[7]")), 0.25)


OUTER = "def pull(body, observed):\n    return body.joints[5] - GOAL\n"
INNER = "def pull(body, observed):\n    return (lambda: body.joints[5] - GOAL)()\n"


@pytest.mark.parametrize("source", [OUTER, INNER])
def test_numbers_from_around_a_function_count(source):
    one, same, other, whole = (from_function(cell(source, GOAL=goal)) for goal in (1.0, 1.0, 2.0, 1))
    structures = [jax.tree.structure(term) for term in (one, same, other, whole)]
    assert structures[0] == structures[1]
    assert structures[0] != structures[2]
    assert structures[0] != structures[3]  # compiles differently


def closed(goal):
    def pull(body, observed):
        return body.joints[5] - goal

    return pull


@pytest.mark.parametrize("goal", [np.zeros(3), jnp.zeros(3), {"hand": np.zeros(3)}])
def test_arrays_from_around_a_function_are_refused_by_name(goal):
    for function, name in ((cell(OUTER, GOAL=goal), "GOAL"), (cell(INNER, GOAL=goal), "GOAL"), (closed(goal), "goal")):
        with pytest.raises(ValueError, match=rf"uses the array `{name}` from around it.*from_function\(pull, {name}\)"):
            from_function(function)


def test_what_can_change_unseen_or_is_no_function_is_refused():
    with pytest.raises(ValueError, match="pass it as a parameter"):
        from_function(cell(OUTER, GOAL=[1.0, 2.0, 3.0]))
    with pytest.raises(ValueError, match="no plain function"):
        from_function(np.linalg.norm)
    # An attribute with the name of an outer array does not use that array.
    from_function(cell("def f(body, observed):\n    return body.joints[5]\n", joints=np.zeros(3)))


def test_a_function_of_three_frames_is_a_coupling():
    bodies = [place(ADULT, pose_of(seed)) for seed in range(3)]

    def slid(before, body, after, joints):
        return (after.joints - before.joints)[:2] * joints

    coupling = coupling_from_function(slid, np.array([[1.0], [2.0]]), weight=9.0)
    wanted = (np.asarray(bodies[2].joints - bodies[0].joints)[:2]) * [[1.0], [2.0]]
    np.testing.assert_allclose(coupling.residual(*bodies), wanted, rtol=1e-6)
    objective = paper_objective().plus(slid=coupling)
    assert list(objective.couplings) == ["slid"]
    assert "slid" not in objective.of_frames
    found = objective.coupled(*(jax.tree.map(lambda a: jnp.stack([a, a]), body) for body in bodies))
    np.testing.assert_allclose(found["slid"], 3 * np.stack([wanted, wanted]), rtol=1e-5)
    # Other numbers are the same program.
    other = coupling_from_function(slid, np.array([[0.5], [0.1]]), weight=2)
    assert jax.tree.structure(other) == jax.tree.structure(coupling)


def test_a_coupling_is_refused_as_a_term_is():
    def pull(before, body, after):
        return body.joints[5] - GOAL  # noqa: F821

    with pytest.raises(ValueError, match="no plain function.*derived from AbstractCoupling"):
        coupling_from_function(np.linalg.norm)
    with pytest.raises(ValueError, match=r"array `GOAL` from around.*coupling_from_function\(pull, GOAL\)"):
        coupling_from_function(types.FunctionType(pull.__code__, {"GOAL": np.zeros(3)}, "pull"))


@pytest.mark.parametrize("make", [from_function, coupling_from_function])
def test_a_function_of_other_arguments_is_refused_in_one_line(make):
    def residual(body):
        return body.joints

    told = rf"too many positional.*called with .*body.* and the parameters given to {make.__name__}$"
    with pytest.raises(ValueError, match=told):
        make(residual, 0.5)


BONES, SOLVER = ExactBones(), NormalEquationsLM(rtol=1e-2, atol=3e-3)


def solve(objective: Objective, seed: int = 0):
    poses = [pose_of(seed + i, 0.3) for i in range(4)]
    stack = lambda *a: jnp.stack([jnp.asarray(x) if x.dtype == bool else jnp.asarray(x, jnp.float32) for x in a])  # noqa: E731
    initial = jax.tree.map(stack, *poses)
    observed = jax.tree.map(stack, *(ideal_graph(ADULT, pose) for pose in poses))
    return refine_frames(objective, BONES, SOLVER, ADULT, initial, observed, 2, 8)


@pytest.mark.slow
def test_new_weights_data_and_parameters_and_a_cell_run_again_trace_nothing():
    first = solve(paper_objective().plus(stick=from_function(cell(), 0.25, weight=10.0)))
    traced = len(TRACES)
    assert traced > 0
    again = solve(
        paper_objective().plus(stick=from_function(cell(), 0.6, weight=5000)).weighted(graph=7, rest=0.5), seed=9
    )
    assert len(TRACES) == traced
    apart = np.linalg.norm(again.joints[:, 5] - again.joints[:, 8], axis=-1)
    np.testing.assert_allclose(apart, 0.6, atol=0.05)
    assert set(first.costs) == {"graph", "end_nodes", "inner_nodes", "rest", "stick"}
    # Another function is traced, once.
    solve(paper_objective().plus(stick=from_function(cell(CELL.replace("[8]", "[7]")), 0.25, weight=10.0)))
    assert len(TRACES) > traced


def test_objectives_are_put_together_by_name():
    objective = paper_objective().plus(firm=RestPrior()).without("graph", "rest").weighted(firm=3.0)
    assert list(objective.terms) == ["end_nodes", "inner_nodes", "firm"]
    assert objective.terms["firm"].weight == 3.0
    assert eqx.tree_equal(paper_objective().weighted(rest=2.0), paper_objective())
    for change in (lambda o: o.without("hinge"), lambda o: o.weighted(hinge=1.0)):
        with pytest.raises(ValueError, match="no term 'hinge'; it has end_nodes, inner_nodes, firm"):
            change(objective)
