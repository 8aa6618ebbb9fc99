"""Data of one's own: from the recording, or the stream, to the terms of every frame."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from support.recordings import graph_settings

from jaxskel import Recording, Stream, join_poses, read_recording, reconstruct, refinement_problem
from jaxskel.io import write_recording
from jaxskel.refinement.terms import from_function, paper_objective
from jaxskel.synthetic import camera_ring, make_scene

OFF = np.array([0.0, 0.0, 0.15])
HEAD = 2
KNOWN = np.array([True, False, True, False, True])


def to_marker(body, observed):
    """Pulls the head to where a marker is seen."""
    marker = observed.data["marker"]
    return jnp.where(jnp.isnan(marker), 0.0, body.joints[2] - marker)


@pytest.fixture(scope="module")
def scene() -> Recording:
    """Five frames, with a marker 15 cm above the head in three of them."""
    scene = make_scene(5, cameras=camera_ring(6, size=(240, 180)))
    assert scene.truth is not None
    return scene.with_data(marker=np.where(KNOWN[:, None], scene.truth.joints[:, HEAD] + OFF, np.nan))


@pytest.fixture(scope="module")
def settings():
    settings = graph_settings()
    objective = paper_objective().plus(marker=from_function(to_marker, weight=1e5))
    return replace(settings, refinement=replace(settings.refinement, objective=objective))


@pytest.fixture(scope="module")
def plain(scene):
    return reconstruct(replace(scene, data={}), graph_settings()).joints


@pytest.fixture(scope="module")
def joints(scene, settings):
    return reconstruct(scene, settings).joints


def test_each_frame_is_pulled_by_its_own_row_and_a_gap_by_nothing(scene, joints, plain):
    up = joints[:, HEAD, 2] - scene.truth.joints[:, HEAD, 2]
    assert (up[KNOWN] > 0.12).all()
    np.testing.assert_allclose(joints[~KNOWN], plain[~KNOWN], atol=2e-3)


def test_rows_go_with_their_frames(scene, settings, joints):
    assert scene[1:3].data["marker"].shape == (2, 3)
    np.testing.assert_allclose(reconstruct(scene[2:], settings).joints[0, HEAD], joints[2, HEAD], atol=5e-3)


def test_a_problem_has_them_too(scene, settings):
    problem = refinement_problem(scene, settings)
    np.testing.assert_allclose(problem.observed.data["marker"], scene.data["marker"], atol=1e-6)


def test_a_stream_takes_the_data_of_each_frame(scene, settings, plain):
    with Stream(scene.cameras, settings, scene.skeleton, scene.up, scene.fps) as stream:
        rows = [{"marker": row} if known else {} for row, known in zip(scene.data["marker"], KNOWN, strict=True)]
        frames = zip(scene.silhouettes, rows, strict=True)
        found = join_poses([stream.push(masks, data=data) for masks, data in frames]).joints
        with pytest.raises(ValueError, match=r"data: 'marker' has shape \(2,\), but the first frame had marker of sh"):
            stream.push(scene.silhouettes[0], data={"marker": np.zeros(2)})
        with pytest.raises(ValueError, match="data: 'feet' has shape"):
            stream.push(scene.silhouettes[0], data={"feet": np.zeros(2)})
    up = found[:, HEAD, 2] - plain[:, HEAD, 2]
    assert (up[KNOWN] > 0.08).all()
    assert (np.abs(up[~KNOWN]) < 0.03).all()


@pytest.mark.parametrize("wrong", [np.zeros((4, 3)), "heads", np.array(3.0), np.array(["a"] * 5)])
def test_what_is_no_row_for_each_frame_is_refused(scene, wrong):
    with pytest.raises(ValueError, match="marker: .*one row for each frame"):
        scene.with_data(marker=wrong)


def test_a_sequence_file_keeps_them(scene, tmp_path):
    write_recording(tmp_path / "a.npz", scene)
    again = read_recording(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.data["marker"], scene.data["marker"])
    assert set(again.data) == {"marker"}
