"""Objectives that couple frames, in a whole reconstruction: across batches, not across gaps, and not where apart."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import jaxskel as js
from jaxskel.batch import Method, run_batch
from jaxskel.hull import Seen
from jaxskel.pipeline import _coupled_batches as coupled
from jaxskel.pipeline._assemble import FramesOf
from jaxskel.refinement import Refined
from jaxskel.refinement.solvers import sequence_solver
from jaxskel.refinement.terms import Smoothness, paper_objective
from jaxskel.synthetic import camera_ring, make_scene

OBJECTIVE = paper_objective().plus(smooth=Smoothness(fps=30.0, weight=0.3))
PAPER = js.paper_settings()
SMOOTH = replace(PAPER, refinement=replace(PAPER.refinement, objective=OBJECTIVE))
GIVEN = js.default_adult(), OBJECTIVE, SMOOTH.refinement


def accelerations(joints) -> np.ndarray:
    """Root mean square second difference at each inner frame (m)."""
    return np.sqrt((np.diff(joints, 2, axis=0) ** 2).sum(-1).mean(-1))


@pytest.mark.slow
def test_batches_are_refined_as_the_whole_film():
    scene = make_scene(44, cameras=camera_ring(6, size=(200, 160)))
    alone, found = js.reconstruct(scene, PAPER), js.reconstruct(scene, SMOOTH)
    assert found.has_pose.all()
    rough, smooth = accelerations(alone.joints), accelerations(found.joints)
    assert smooth.mean() < 0.6 * rough.mean()
    border = smooth[29:33]  # three frames across the end of the first batch
    assert border.max() < 2 * smooth.max()
    problem, how = js.refinement_problem(scene, SMOOTH), SMOOTH.refinement
    whole = js.refine_sequence(
        OBJECTIVE, how.parametrisation, replace(sequence_solver(), ftol=1e-2), problem.skeleton, problem.initial,
        problem.observed, how.rounds, how.max_steps,
    )  # fmt: skip
    apart = np.linalg.norm(found.joints - problem.to_poses(whole).joints, axis=-1)
    assert np.median(apart) < 2e-3
    # Solves that stop at a hundredth of the cost are centimetres apart in the last ten frames of the film.
    assert np.percentile(apart, 93) < 0.02
    assert apart[:34].max() < 0.02


def batch_of(statuses: list[int], people: list[int], plausible: list[bool], first: int) -> coupled.Started:
    """A batch whose people stand at x = number of the frame."""
    at = first + np.array(people, np.float32)
    poses = js.Pose(np.stack([at, 0 * at, 0 * at], 1), np.zeros((len(at), 17, 3, 3), np.float32))
    start: Any = SimpleNamespace(plausible=np.array(plausible), poses=poses, observed=np.concatenate([at, at]))
    seen = Seen(np.array(statuses), np.array(people, int), np.zeros((len(statuses), 3), bool), None)
    frames = FramesOf(np.eye(3), "+Z", 30.0, first + np.arange(len(statuses)))
    return coupled.Started(frames, seen, start if people else None)


@pytest.fixture
def windows(monkeypatch):
    """What is refined together: frames, and which follow the one before."""
    found = []

    def together(initial, observed, follows, *others):
        places, count = initial.root[:, 0], len(follows)
        yes = jnp.ones(count, bool)
        np.testing.assert_array_equal(observed, places)
        found.append((places.tolist(), follows.tolist()))
        joints, tips, spread = (jnp.zeros((count, *rest)) for rest in ((15, 3), (5, 3), (15, 3, 3)))
        return Refined(initial, joints, tips, spread, {}, yes, yes, jnp.ones(count, int))

    monkeypatch.setattr(coupled, "refine_together", together)
    monkeypatch.setattr(coupled, "assemble", lambda frames, skeleton, seen, start, refined, deviation: refined)
    return found


def test_each_batch_has_the_frames_around_it_and_gaps_end_what_follows(windows):
    every = list(range(32))
    missing = [place for place in every if place not in (4, 5)]
    strange = [place != 10 for place in every]
    batches = [
        batch_of([0] * 32, every, strange, 0),
        batch_of([0] * 32, missing, [True] * 30, 32),
        batch_of([0] * 3, [0, 1, 2], [True] * 3, 64),
    ]
    refined = list(coupled.coupled_batches(iter(batches), *GIVEN))
    assert [each.pose.root[:, 0].tolist() for each in refined] == [every, [32 + i for i in missing], [64, 65, 66]]
    (first, follows), (second, _), (third, _) = windows
    assert first == [*every, *(32 + i for i in missing if i < 16)]
    # Not the first one, not what comes after the stranger, the stranger itself, or a gap.
    assert [frame for frame, yes in zip(first, follows, strict=True) if not yes] == [0, 10, 11, 38]
    assert second == [*range(16, 36), *range(38, 67)]
    assert third == [*range(48, 67)]


def test_batches_without_anybody_end_what_follows_too(windows):
    nobody = batch_of([1] * 32, [], [], 32)
    batches = iter([batch_of([0], [0], [True], 31), nobody, nobody])
    refined = list(coupled.coupled_batches(batches, *GIVEN))
    assert [each is None for each in refined] == [False, True, True]
    assert windows == [([31], [False])]


CAMERAS = camera_ring(6, size=(200, 160))
APART = {
    "a stream": lambda: js.Stream(CAMERAS, SMOOTH),
    "several processes": lambda: next(js.reconstruct_parallel(make_scene(2, cameras=CAMERAS), 2, SMOOTH)),
    "a batch": lambda: run_batch([], Path("out"), Method(SMOOTH)),
}


@pytest.mark.parametrize("apart", APART)
def test_where_frames_are_apart_it_is_said_before_anything_starts(apart):
    with pytest.raises(ValueError, match=r"\Asettings: smooth couples frames, [^\n]*; leave it out, or [^\n]*\Z"):
        APART[apart]()
