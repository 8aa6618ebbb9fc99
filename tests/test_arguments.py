"""Wrong arguments of public functions: each is refused in one line that names the argument."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import jax
import jaxtyping
import numpy as np
import optimistix as optx
import pytest

import jaxskel as js
from jaxskel.refinement.solvers import default_solver, sequence_solver
from jaxskel.refinement.terms import ArmCollision, coupling_from_function, from_function, paper_objective
from jaxskel.synthetic import camera_ring, make_scene

FRAMES = 6


@pytest.fixture(autouse=True)
def as_for_a_user(monkeypatch):
    """Without the tests' checks of kinds and shapes, which would be the first to refuse."""
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)


class Given(NamedTuple):
    """Arguments that are right."""

    scene: js.Recording
    paper: js.Settings
    problem: js.RefinementProblem
    prepared: js.Prepared


@cache
def given() -> Given:
    scene, paper = make_scene(FRAMES, cameras=camera_ring(4, size=(160, 120))), js.paper_settings()
    prepared = js.prepare(scene, paper)
    return Given(scene, paper, js.refinement_problem(scene, paper, prepared), prepared)


def refined(of=js.refine_frames, **wrong):
    problem, how = given().problem, given().paper.refinement
    right = {
        "objective": how.objective, "parametrisation": how.parametrisation, "solver": how.solver,
        "skeleton": problem.skeleton, "initial": problem.initial, "observed": problem.observed,
    }  # fmt: skip
    return of(**(right | wrong))


def half(tree):
    return jax.tree.map(lambda a: a[: FRAMES // 2], tree)


def pulled(body, observed, goals):
    return body.joints - goals


def held(before, body, after, goals):
    return body.joints - goals


def recorded(**wrong):
    scene = given().scene
    masks = js.unpack_silhouettes(scene.silhouettes, 160)
    return replace(scene, **{name: value(masks) if callable(value) else value for name, value in wrong.items()})


def streamed(masks, **wrong):
    scene = given().scene
    return js.Stream(scene.cameras, given().paper, scene.skeleton).push(masks, **wrong)


WRONG = {
    # Kinds: a path, a name, a class, a neighbour of what is wanted.
    "reconstruct a path": (lambda: js.reconstruct("scene.npz"), "recording:"),
    "prepare a path": (lambda: js.prepare("scene.npz"), "recording:"),
    "prepare with a name": (lambda: js.prepare(given().scene, "paper"), "settings:"),
    "a problem of a path": (lambda: js.refinement_problem("scene.npz"), "recording:"),
    "calibrate with a path": (lambda: js.calibrate_body("scene.npz"), "recording:"),
    "cameras of a path": (lambda: js.refine_cameras("scene.npz"), "recording:"),
    "in parallel, a path": (lambda: next(js.reconstruct_parallel("scene.npz", 1)), "recording:"),
    "read a number": (lambda: js.read_recording(3), "path:"),
    "keep in a number": (lambda: js.keep_compiled(3), "folder:"),
    "a stream of a list": (lambda: js.Stream([1, 2, 3]), "cameras:"),
    "a stream with a name": (lambda: js.Stream(given().scene.cameras, "paper"), "settings:"),
    "a stream of a subject's path": (lambda: js.Stream(given().scene.cameras, subject="subject.toml"), "subject:"),
    "warm up a recording": (lambda: js.warm_up(given().scene), "cameras:"),
    "a body of a pose": (lambda: js.make_body(given().problem.initial), "skeleton:"),
    "a tall adult": (lambda: js.default_adult("tall"), "stature:"),
    "smooth an array": (lambda: js.smooth(np.zeros((9, 15, 3)), 6.0), "poses:"),
    "join arrays": (lambda: js.join_poses([np.zeros((9, 15, 3))]), "parts:"),
    "hull of nothing": (lambda: js.Settings(hull=None), "hull:"),
    "search switched on": (lambda: js.Settings(search=True), "search:"),
    "tracking switched on": (lambda: js.Settings(tracking=True), "tracking:"),
    "a skeleton as body": (lambda: js.Settings(body=js.default_adult()), "body:"),
    "a class of skeletonisers": (lambda: js.GraphSettings(skeletoniser=js.graph.VoxelScooping), "skeletoniser:"),
    "a class of root finders": (lambda: js.GraphSettings(root_finder=js.graph.HeadBall), "root_finder:"),
    "a class of matchers": (lambda: js.MatchingSettings(matcher=js.matching.DtwMatcher), "matcher:"),
    "settings with a name": (lambda: js.RefinementSettings(objective="paper"), "objective:"),
    "a function for an objective": (lambda: refined(objective=paper_objective), "objective:"),
    "a number as term": (lambda: paper_objective().plus(three=3.0), "'three'"),
    "a class as term": (lambda: paper_objective().plus(arms=ArmCollision), "'arms'"),
    "a class of parametrisations": (lambda: refined(parametrisation=js.parametrisations.SoftBones), "parametrisation:"),
    "a class of solvers": (lambda: refined(solver=optx.LevenbergMarquardt), "solver:"),
    "a root finder": (lambda: refined(solver=optx.Newton(1e-3, 1e-3)), "solver:"),
    "a solver that ends where it starts": (lambda: refined(solver=optx.NelderMead(1e-3, 1e-3)), "solver:"),
    "a solver of sequences": (lambda: refined(solver=sequence_solver()), "solver:"),
    "a body as skeleton": (lambda: refined(skeleton=given().problem.body), "skeleton:"),
    # Numbers.
    "no rounds": (lambda: refined(rounds=0), "rounds:"),
    "no steps": (lambda: refined(max_steps=0), "max_steps:"),
    "no rounds in settings": (lambda: js.RefinementSettings(rounds=0), "rounds:"),
    "fewer than no misses": (lambda: js.HullSettings(max_misses=-1), "max_misses:"),
    "half a miss": (lambda: js.HullSettings(max_misses=1.5), "max_misses:"),
    "no search": (lambda: js.Search(steps=0), "steps:"),
    "back in time": (lambda: js.Tracking(interval=-1.0), "interval:"),
    "less than no weight": (lambda: paper_objective().weighted(rest=-1.0), "rest:"),
    "frames put back": (lambda: streamed(np.zeros((4, 120, 160), bool), skipped=-1), "skipped:"),
    "a stream at no rate": (lambda: js.Stream(given().scene.cameras, fps=0), "fps:"),
    "a recording at no rate": (lambda: recorded(fps=0.0), "fps"),
    # Units.
    "voxels of millimetres": (lambda: js.HullSettings(spacing=15), "voxel spacing"),
    "branches of millimetres": (lambda: js.GraphSettings(min_branch=240), "min_branch:"),
    "an adult of centimetres": (lambda: js.default_adult(175), "metres"),
    "volumes of millimetres": (
        lambda: js.hull.hulls_from_dense(np.zeros((1, 2, 2, 2), bool), js.hull.VoxelGrid(np.zeros(3), 15.0, (2, 2, 2))),
        "voxel spacing",
    ),
    # Ranks and lengths.
    "masks that are not packed": (lambda: recorded(silhouettes=lambda masks: masks.astype(np.uint8)), "silhouettes"),
    "masks that are booleans": (lambda: recorded(silhouettes=lambda masks: masks), "silhouettes"),
    "masks of fewer cameras": (lambda: recorded(cameras=camera_ring(8, size=(160, 120))), "silhouettes"),
    "numbers of fewer frames": (lambda: recorded(frame_index=np.arange(2)), "frame_index"),
    "pack numbers": (lambda: js.pack_silhouettes(np.zeros((1, 4, 12, 16))), "masks:"),
    "unpack too wide": (lambda: js.unpack_silhouettes(given().scene.silhouettes, 1000), "packed:"),
    "carve fewer views": (
        lambda: js.hull.carve(given().scene.silhouettes[:, :3], given().prepared.table), "silhouettes:"
    ),
    "volumes of another shape": (
        lambda: js.hull.hulls_from_dense(np.zeros((1, 3, 4, 5), bool), given().prepared.table.grid), "occupancy:"
    ),
    "project one point": (lambda: js.cameras.project(given().scene.cameras, np.zeros(3)), "points:"),
    "push a list": (lambda: streamed([1, 2]), "masks"),
    "a box of one corner": (lambda: js.HullSettings(box=np.zeros(3)), "box:"),
    "one pose for all": (lambda: refined(initial=jax.tree.map(lambda a: a[0], given().problem.initial)), "initial:"),
    "observations of half of the poses": (lambda: refined(observed=half(given().problem.observed)), "observed:"),
    "poses of half of the sequence": (
        lambda: refined(js.refine_sequence, solver=sequence_solver(), initial=half(given().problem.initial)),
        "observed:",
    ),
    "a parameter with a row for each frame": (
        lambda: refined(objective=paper_objective().plus(pull=from_function(pulled, np.zeros((FRAMES, 15, 3))))),
        "with_data",
    ),
    "a coupling with a row for each frame": (
        lambda: refined(
            js.refine_sequence, solver=sequence_solver(),
            objective=paper_objective().plus(pull=coupling_from_function(held, np.zeros((FRAMES, 15, 3)))),
        ),
        "a coupling is the same for all frames",
    ),
    "follows of half of the frames": (
        lambda: refined(js.refine_sequence, solver=sequence_solver(), follows=np.ones(3, bool)), "follows:"
    ),
    "follows as numbers": (
        lambda: refined(js.refine_sequence, solver=sequence_solver(), follows=np.arange(FRAMES)), "follows:"
    ),
    "data of half of the frames": (lambda: given().problem.observed.with_data(goals=np.zeros((3, 15, 3))), "goals:"),
    "labels of half of the frames": (
        lambda: refined(js.learn_weights, solver=default_solver(), labels=np.zeros((FRAMES // 2, 15, 3))), "labels:"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_argument_is_named_in_one_line(case):
    call, name = WRONG[case]
    with pytest.raises(ValueError, match=r"\A[^\n]*\Z") as refused:
        call()
    assert name in str(refused.value)


def test_a_parameter_that_happens_to_have_as_many_rows_is_none_of_frames():
    weights = np.ones(FRAMES)

    def weighted(body, observed, weights):
        return weights * (body.joints[:6, 2] - 1.0)

    assert refined(objective=paper_objective().plus(some=from_function(weighted, weights))).finite.all()


@pytest.mark.slow
@pytest.mark.parametrize("of", [js.refine_frames, js.refine_sequence])
def test_data_of_each_frame_reach_the_terms_and_gaps_are_none(of):
    problem = given().problem
    goals = np.asarray(problem.initial.root)[:, None] + np.array([0.1, 0.0, 0.0])
    goals[2] = np.nan  # missing

    def towards(body, observed):
        goal = observed.data["goals"]
        return jax.numpy.where(jax.numpy.isnan(goal), 0.0, body.joints[:1] - goal)

    solver = default_solver() if of is js.refine_frames else sequence_solver()
    objective = paper_objective().plus(towards=from_function(towards, weight=1e4))
    found = refined(of, objective=objective, solver=solver, observed=problem.observed.with_data(goals=goals))
    off = np.linalg.norm(found.joints[:, 0] - goals[:, 0], axis=-1)
    assert np.delete(off, 2).max() < 0.02  # from 0.1
    assert found.finite.all()


@pytest.mark.slow
def test_a_term_with_python_floats_works_in_a_whole_reconstruction_and_compiles_once():
    class Height(js.terms.AbstractTerm):
        weight: float
        goal: float

        def residual(self, body, observed, fixed):
            return body.joints[0, 2] - self.goal

    one, two = (paper_objective().plus(height=Height(1.0, goal)) for goal in (0.9, 1.0))
    assert jax.tree.structure(one) == jax.tree.structure(two)
    assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(one))
    paper = given().paper
    settings = replace(paper, refinement=replace(paper.refinement, objective=one))
    assert js.reconstruct(given().scene, settings).has_pose.all()
