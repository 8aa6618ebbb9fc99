"""`--objective FILE` of `jaxskel run`, `batch` and `live`, and `--data FILE`: an objective and data of one's own."""

import json
import pickle
import subprocess
import sys

import numpy as np
import pytest
from support.command_line import jaxskel

from jaxskel import Recording, Settings, default_adult, make_body
from jaxskel.batch import Method
from jaxskel.cli._objective import with_objective
from jaxskel.io import read_poses, write_recording
from jaxskel.refinement.terms import objective_of
from jaxskel.synthetic import camera_ring, make_scene

MINE = """
import jax.numpy as jnp
from jaxskel.refinement.terms import from_function, paper_objective


def to_marker(body, observed):
    marker = observed.data["marker"]
    return jnp.where(jnp.isnan(marker), 0.0, body.joints[2] - marker)


def objective(body):
    return paper_objective().plus(marker=from_function(to_marker, weight=1e5))
"""


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(4, cameras=camera_ring(6, size=(240, 180)))


@pytest.fixture
def folder(tmp_path, scene):
    """A scene, an objective with a marker, and its data for the frames 3 and 1."""
    write_recording(tmp_path / "scene.npz", scene)
    (tmp_path / "mine.py").write_text(MINE)
    heads = scene.truth.joints[:, 2] + [0.0, 0.0, 0.15]
    np.savez(tmp_path / "extra.npz", marker=heads[[3, 1]], frame_index=np.array([3, 1]))
    return tmp_path


@pytest.mark.slow
def test_an_objective_reads_the_data_of_its_frames(folder, scene):
    options = "--preset", "paper", "--objective", "mine.py", "--data", "extra.npz"
    done = jaxskel("run", "scene.npz", "-o", "out", *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    up = read_poses(folder / "out" / "poses.npz").joints[:, 2, 2] - scene.truth.joints[:, 2, 2]
    assert (up[[1, 3]] > 0.12).all()
    assert (up[[0, 2]] < 0.08).all()


FAULTS = {
    "no file": ({}, ("--objective", "none.py"), "none.py: is no Python file"),
    "no objective": ({"a.py": "x = 1"}, ("--objective", "a.py"), "a.py: defines no objective; write a function"),
    "no Python": ({"a.py": "1 +"}, ("--objective", "a.py"), "a.py: SyntaxError"),
    "it fails": ({"a.py": "1 / 0"}, ("--objective", "a.py"), "a.py: ZeroDivisionError: division by zero"),
    "another thing": (
        {"a.py": "def objective(body):\n    return 3"}, ("--objective", "a.py"), "a.py: objective: is a int; give",
    ),
    "no data": ({}, ("--data", "none.npz"), "none.npz: cannot be opened"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_told_in_one_line_before_any_work(folder, fault):
    files, options, told = FAULTS[fault]
    for name, text in files.items():
        (folder / name).write_text(text)
    done = jaxskel("run", "scene.npz", "-o", "out", "--preset", "paper", *options, cwd=folder)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (folder / "out").exists()


COUPLED = """
from jaxskel.refinement.terms import Smoothness, paper_objective


def objective(body):
    return paper_objective().plus(smooth=Smoothness(fps=30.0))
"""


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (("run", "scene.npz", "--jobs", "2"), "several processes take batches apart; leave out --jobs, or the term"),
        (("batch", "scene.npz"), "a batch goes on where it was interrupted; leave it out, or use `jaxskel run`"),
        (("live", "scene.npz"), "a live session has one at a time; leave it out, or use `jaxskel run` afterwards"),
    ],
)
def test_frames_that_are_apart_are_not_coupled(folder, command, told):
    (folder / "a.py").write_text(COUPLED)
    done = jaxskel(*command, "-o", "out", "--objective", "a.py", cwd=folder)
    assert done.returncode == 2
    assert "settings: smooth couples frames" in done.stderr
    assert told in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (folder / "out").exists()


@pytest.mark.parametrize("command", ["batch", "live"])
def test_batch_and_live_tell_faults_of_the_file_too(folder, command):
    (folder / "a.py").write_text("1 / 0")
    done = jaxskel(command, "scene.npz", "-o", "out", "--objective", "a.py", cwd=folder)
    assert done.returncode == 2
    assert "a.py: ZeroDivisionError: division by zero" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (folder / "out").exists()


def test_a_search_gets_the_terms_of_single_frames(tmp_path):
    (tmp_path / "a.py").write_text(COUPLED)
    settings, body = with_objective(Settings(), tmp_path / "a.py"), make_body(default_adult())
    assert list(settings.refinement.objective_for(body).couplings) == ["smooth"]
    assert settings.search is not None
    alone = objective_of(settings.search.objective, body)
    assert set(alone.terms) == set(settings.refinement.objective_for(body).terms) - {"smooth"}


def test_another_objective_is_another_method_wherever_its_file_is(tmp_path):
    def method(name: str, text: str) -> dict:
        (tmp_path / name).write_text(text)
        return Method(with_objective(Settings(), tmp_path / name)).described

    one = method("a.py", MINE)
    assert method("b.py", MINE) == one
    assert method("c.py", MINE.replace("1e5", "1e4")) != one
    assert Method().described != one
    assert str(tmp_path) not in json.dumps(one)


def test_a_file_that_was_changed_is_refused_by_the_processes_that_come_later(tmp_path):
    (tmp_path / "a.py").write_text(MINE)
    sent = pickle.dumps(with_objective(Settings(), tmp_path / "a.py").refinement.objective)
    (tmp_path / "a.py").write_text(MINE + "# changed")
    later = "import pickle, sys; pickle.loads(sys.stdin.buffer.read())(None)"
    done = subprocess.run([sys.executable, "-c", later], input=sent, capture_output=True)
    assert b"a.py: was changed after the command began; run the command again" in done.stderr


@pytest.mark.slow
def test_a_batch_computes_again_with_another_objective_only(folder, scene):
    pulled = MINE.replace('observed.data["marker"]', "body.joints[2] + jnp.array([0.0, 0.0, 0.3])")
    given = "scene.npz", "-o", "out", "--preset", "paper", "--jobs", "1", "--objective"
    for text, told in ((pulled, "0 of them before"), (pulled, "1 of them before"), (pulled + "\n", "0 of them before")):
        (folder / "mine.py").write_text(text)
        done = jaxskel("batch", *given, "mine.py", cwd=folder)
        assert done.returncode == 0, done.stderr
        assert told in done.stdout
    manifest = json.loads((folder / "out" / "scene" / "manifest.json").read_text())
    assert manifest["work"]["method"]["settings"]["refinement"]["objective"]["class"] == "ObjectiveFile"


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        ({"marker": np.zeros((3, 3))}, "key 'marker': has shape (3, 3); give one row for each of the 4 frames"),
        ({"marker": np.array(["a"] * 4)}, "key 'marker': holds <U1; give numbers"),
        ({"marker": np.zeros((2, 3)), "frame_index": np.array([1, 1])}, "key 'frame_index': holds a number twice"),
        ({"frame_index": np.arange(4)}, "has no arrays; give arrays of numbers with one row for each frame"),
        ({"marker": np.full((4, 3), np.inf)}, "key 'marker': holds inf at index (0, 0)"),
    ],
)
def test_data_of_a_wrong_kind_are_refused(folder, arrays, told):
    np.savez(folder / "wrong.npz", **arrays)
    done = jaxskel("run", "scene.npz", "-o", "out", "--preset", "paper", "--data", "wrong.npz", cwd=folder)
    assert done.returncode == 2
    assert told in done.stderr
