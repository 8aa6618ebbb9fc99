"""The refinement problem for notebooks: its stages before the refinement are those of the pipeline."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from jaxskel import pack_silhouettes, paper_settings, prepare, reconstruct, refine_frames, refinement_problem
from jaxskel._runtime.batching import padded
from jaxskel.recording import rotation_to_z_up
from jaxskel.synthetic import make_scene


@pytest.fixture(scope="module")
def scene():
    return make_scene(4)


def test_refining_the_problem_is_what_the_pipeline_does(scene):
    settings = paper_settings()
    how = settings.refinement
    problem = refinement_problem(scene, settings)
    np.testing.assert_array_equal(problem.frames, range(4))
    np.testing.assert_allclose(problem.truth, scene.truth.joints)
    initial, observed = padded(jax.tree.map(np.asarray, (problem.initial, problem.observed)), 32)
    refined = refine_frames(
        how.objective_for(problem.body), how.parametrisation, how.solver, problem.skeleton,
        initial, observed, how.rounds, how.max_steps,
    )  # fmt: skip
    np.testing.assert_allclose(refined.joints[:4], reconstruct(scene, settings).joints, atol=2e-3)


def test_frames_without_a_person_are_left_out_and_a_problem_needs_one(scene):
    settings = paper_settings()
    prepared = prepare(scene, settings)
    masks = np.unpackbits(scene.silhouettes, axis=-1).astype(bool)
    masks[1] = False
    gap = type(scene)(scene.cameras, pack_silhouettes(masks), scene.fps, scene.up, scene.frame_index)
    problem = refinement_problem(gap, settings, prepared)
    np.testing.assert_array_equal(problem.frames, [0, 2, 3])
    assert problem.truth is None
    assert problem.initial.root.shape == (3, 3)
    nobody = type(scene)(scene.cameras, pack_silhouettes(masks & False), scene.fps, scene.up, scene.frame_index)
    with pytest.raises(ValueError, match="no frame shows one whole person"):
        refinement_problem(nobody, settings, prepared)


def test_refined_poses_go_back_into_the_recordings_world(scene):
    settings = paper_settings()
    turned = replace(scene, cameras=scene.cameras.rotated(rotation_to_z_up("+Y").T), up="+Y", truth=None)
    how, problem = settings.refinement, refinement_problem(turned, settings)
    refined = refine_frames(
        how.objective_for(problem.body), how.parametrisation, how.solver, problem.skeleton,
        problem.initial, problem.observed, how.rounds, how.max_steps,
    )  # fmt: skip
    found, expected = problem.to_poses(refined), reconstruct(turned, settings)
    np.testing.assert_array_equal(found.status, expected.status)
    np.testing.assert_array_equal(found.frame_index, expected.frame_index)
    np.testing.assert_allclose(found.joints, expected.joints, atol=2e-3)
    np.testing.assert_allclose(found.confidence, expected.confidence, atol=0.02)
    np.testing.assert_allclose(problem.cameras.R[0] @ problem.to_z_up, turned.cameras.R[0], atol=1e-12)
    with pytest.raises(ValueError, match="refined: has 2 frames, but the problem has 4; refine all"):
        problem.to_poses(jax.tree.map(lambda a: a[:2], refined))
