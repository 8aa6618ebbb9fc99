"""The script for cases that once went wrong: its results for made-up cases, and how it compares rigs."""

import _case_rigs
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.benchmark_runs import benchmark
from support.listings import tree

from jaxskel import make_cameras
from jaxskel.synthetic import camera_ring

pytestmark = pytest.mark.slow


def test_each_case_has_a_line_and_what_is_not_known_or_cannot_be_compared_is_not_ok(tmp_path):
    for name in ("camera_names_bad_codepoint", "from_tomorrow", "words_rembg"):
        (tmp_path / "cases" / name).mkdir(parents=True)
        (tmp_path / "cases" / name / "README").write_text("what should happen")
    (tmp_path / "cases/camera_names_bad_codepoint/names_badcp.npz").write_text("no archive")
    before = tree(tmp_path)
    done = benchmark("cases.py", "cases", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    told = dict(line.split(": ", 1) for line in done.stdout.splitlines()[:-1])
    assert list(told) == ["camera_names_bad_codepoint", "from_tomorrow", "words_rembg"]
    assert told["camera_names_bad_codepoint"].startswith("ok; expected: exit code 2, one line; got: names_badcp.npz: ")
    assert "NOT ok; expected: nothing is known of it; got: unknown case" in told["from_tomorrow"]
    assert told["words_rembg"].startswith("NOT ok; ")
    assert done.stdout.splitlines()[-1] == "3 cases, 1 ok; NOT ok: from_tomorrow, words_rembg"
    assert tree(tmp_path) == before
    assert benchmark("cases.py", "cases", "camera_names_bad_codepoint", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("arguments", [("gone",), (".", "gone")])
def test_what_is_not_there_is_told(tmp_path, arguments):
    done = benchmark("cases.py", *arguments, cwd=tmp_path)
    assert (done.returncode, "gone" in done.stderr) == (2, True)


def test_rigs_are_compared_number_by_number_or_from_their_first_camera():
    rig = camera_ring(5)
    moved = make_cameras(rig.K, rig.R, rig.t + np.array([0.0, 0.0, 0.25]), rig.size)
    world = rig.rotated(Rotation.from_rotvec([0.3, -0.2, 1.0]).as_matrix())
    assert _case_rigs.difference(rig, rig) == 0
    assert _case_rigs.difference(moved, rig) == pytest.approx(0.25)
    assert _case_rigs.difference(world, rig) > 0.1
    assert _case_rigs.difference(world, rig, same_world=False) < 1e-12
    assert _case_rigs.meeting(world) < 1e-9  # they look at one point
