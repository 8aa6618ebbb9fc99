"""`jaxskel export`, as its users run it."""

import csv
import json
import sys
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from support.command_line import jaxskel
from support.poses import moving, points

from jaxskel.body import JOINT_NAMES
from jaxskel.io.mocap import read_bvh
from jaxskel.io.poses import BVH_NAMES, read_trc, write_poses
from jaxskel.poses import ANGLE_NAMES, joint_angles


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Poses with two gaps, and poses that are all missing."""
    folder = tmp_path_factory.mktemp("export")
    write_poses(folder, moving(10, 29.97, without=(0, 4)))
    write_poses(folder / "nobody", moving(2, without=(0, 1)))
    write_poses(folder / "older", replace(moving(2), rotations=None, skeleton=None))
    return folder


def test_every_kind_is_written_and_said(folder):
    done = jaxskel("export", "poses.npz", "out/a.trc", "a.C3D", "a.bvh", "a.csv", cwd=folder)
    assert done.returncode == 0, done.stderr
    trc, c3d, bvh, table = done.stdout.strip().splitlines()
    assert trc == "out/a.trc: 10 frames at 29.97 fps, m, +Y up; 2 without a pose: empty cells"
    assert c3d == "a.C3D: 10 frames at 29.97 fps, mm, +Z up; 2 without a pose: residual -1"
    assert bvh.startswith(
        "a.bvh: 10 frames at 29.97 fps, cm, +Y up; 2 without a pose: another held; joints within 0.00"
    )
    assert table == "a.csv: 10 frames at 29.97 fps, m, +Z up; 2 without a pose: empty cells"
    assert (folder / "a.csv").read_bytes() == (folder / "poses.csv").read_bytes()
    assert (folder / "a.C3D").stat().st_size > 1000


def test_joint_angles_for_spreadsheets_and_opensim(folder):
    done = jaxskel("export", "poses.npz", "b.mot", "b.angles.csv", "angles.csv", cwd=folder)
    assert done.returncode == 0, done.stderr
    mot, table, other = done.stdout.strip().splitlines()
    assert mot == "b.mot: 10 frames at 29.97 fps, degrees and m, +Y up; 2 without a pose: left out"
    assert table == "b.angles.csv: 10 frames at 29.97 fps, joint angles in degrees; 2 without a pose: empty cells"
    assert (folder / "angles.csv").read_bytes() == (folder / "b.angles.csv").read_bytes()
    angles = np.rad2deg(joint_angles(moving(10, 29.97, without=(0, 4))).values)
    with open(folder / "angles.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {rows[4][f"{name}_deg"] for name in ANGLE_NAMES} == {""}
    found = [[float(row[f"{name}_deg"]) for name in ANGLE_NAMES] for row in (*rows[1:4], *rows[5:])]
    np.testing.assert_allclose(found, np.delete(angles, [0, 4], 0), atol=1e-4)
    assert rows[9]["frame_index"] == "9"
    assert float(rows[9]["time_s"]) == pytest.approx(9 / 29.97, abs=1e-6)


def test_standard_deviations_are_a_file_beside_the_positions(folder):
    write_poses(folder / "unsure", replace(moving(2), covariance=None))
    done = jaxskel("export", "unsure/poses.npz", "a.sigma.trc", cwd=folder)
    assert done.returncode == 2
    assert "unsure/poses.npz: has no covariances for a.sigma.trc; run again" in done.stderr
    covariance = np.zeros((10, 15, 3, 3), np.float32) + np.diag([1e-4, 4e-4, 9e-4]).astype(np.float32)
    covariance[[0, 4]] = np.nan
    write_poses(folder / "sure", replace(moving(10, 29.97, without=(0, 4)), covariance=covariance))
    done = jaxskel("export", "sure/poses.npz", "a.sigma.trc", "--millimetres", cwd=folder)
    assert done.stdout.startswith("a.sigma.trc: 10 frames at 29.97 fps, standard deviations, mm, +Y up; 2 without")
    read = read_trc(folder / "a.sigma.trc")
    assert read.names == JOINT_NAMES
    # (x, y, z) with z up is (y, z, x) with y up; 10, 20, 30 mm.
    np.testing.assert_allclose(read.positions[1, 5], [0.02, 0.03, 0.01], atol=1e-6)
    assert np.isnan(read.positions[4]).all()


def test_unit_and_up_axis_are_chosen(folder):
    done = jaxskel("export", "poses.npz", "b.trc", "b.bvh", "b.csv", "--up", "+Z", "--millimetres", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "b.trc: 10 frames at 29.97 fps, mm, +Z up" in done.stdout
    assert "\tmm\t" in (folder / "b.trc").read_text()
    expected = points(moving(10, 29.97, without=(0, 4)), "+Z")
    np.testing.assert_allclose(read_trc(folder / "b.trc").positions, expected, atol=1e-6)
    played = read_bvh(folder / "b.bvh")
    pelvis = played.names.index(BVH_NAMES["pelvis"])
    assert played.positions[1, pelvis, 2] == pytest.approx(expected[1, 0, 2], abs=1e-5)
    done = jaxskel("export", "poses.npz", "c.csv", "--up", "+Y", cwd=folder)
    assert "c.csv: 10 frames at 29.97 fps, m, +Y up" in done.stdout
    with open(folder / "c.csv", newline="") as file:
        row = list(csv.DictReader(file))[1]
    np.testing.assert_allclose([float(row[f"pelvis_{a}"]) for a in "xyz"], expected[1, 0, [1, 2, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("poses.npz", "a.fbx"), "a.fbx: unknown kind of file; give a name that ends in one of .trc"),
        (("poses.npz", "d.trc", "none"), "none: unknown kind of file"),
        (("poses.npz", "d.trc", "--up", "Y"), "--up Y: give one of +X"),
        (("poses.npz", "d.bvh", "--millimetres"), "--millimetres: only a .trc"),
        (("poses.csv", "d.trc"), "poses.csv: is not a whole .npz archive"),
        (("nobody/poses.npz", "d.bvh"), "d.bvh: no frame has a pose"),
        (("nobody/poses.npz", "d.mot"), "d.mot: no frame has a pose"),
        (("older/poses.npz", "d.angles.csv"), "older/poses.npz: holds no rotations"),
        (("poses.npz", "d.mot", "--up", "+Z"), "--up +Z: OpenSim's motions have +Y up"),
        (
            ("older/poses.npz", "d.trc", "d.bvh"),
            "older/poses.npz: holds no rotations, because an older version wrote it",
        ),
    ],
)
def test_what_cannot_be_done_is_refused_before_anything_is_written(folder, arguments, why):
    before = set(folder.iterdir())
    done = jaxskel("export", *arguments, cwd=folder)
    assert done.returncode == 2
    assert why in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert set(folder.iterdir()) == before


def test_without_any_pose_it_is_written_and_the_exit_code_says_so(folder):
    done = jaxskel("export", "nobody/poses.npz", "nobody/a.trc", cwd=folder)
    assert done.returncode == 1
    assert "2 without a pose" in done.stdout
    assert "no frame has a pose" in done.stderr
    assert np.isnan(read_trc(folder / "nobody" / "a.trc").positions).all()


def test_a_missing_package_is_named(folder):
    with patch.dict(sys.modules, {"ezc3d": None}):
        done = jaxskel("export", "poses.npz", "e.c3d", cwd=folder)
    assert done.returncode == 2
    assert 'pip install "jaxskel[export]"' in done.stderr


@pytest.mark.parametrize("keypoints", [(), ("--keypoints", "BODY_25")])
@pytest.mark.parametrize("first", [0, 1])
def test_what_was_exported_can_be_evaluated(folder, keypoints, first):
    """Frames of other programs count from one."""
    truth = folder / f"truth{first}{len(keypoints)}.trc"
    assert jaxskel("export", "poses.npz", truth.name, *keypoints, "--millimetres", cwd=folder).returncode == 0
    header, rows = truth.read_text().splitlines()[:5], truth.read_text().splitlines()[6:]
    counted = ["\t".join([str(number + first), *row.split("\t")[1:]]) for number, row in enumerate(rows)]
    truth.write_text("\n".join([*header, "", *counted, ""]))
    done = jaxskel("evaluate", "poses.npz", truth.name, *keypoints, "-o", "score", cwd=folder)
    assert done.returncode == 0, done.stderr
    figures = json.loads((folder / "score" / "score.json").read_text())
    assert figures["frames"] == 8
    assert figures["frames_without_truth"] == 2
    assert figures["sides_counted"]["median_mm"] < 0.01
    assert figures["sides_counted"]["all_joints_correct_percent"] == 100
    assert ("its frame 1 is taken for frame 0" in done.stdout) == bool(first)


def test_markers_to_evaluate_are_refused_in_one_line(folder):
    assert jaxskel("export", "poses.npz", "c.trc", "--keypoints", "COCO_17", cwd=folder).returncode == 0
    for truth, arguments, said in (
        ("c.trc", (), "c.trc: score: no marker (LShoulder, "),
        ("c.trc", ("--keypoints", "COCO"), "--keypoints COCO: give one of COCO_17"),
        ("poses.npz", ("--keypoints", "COCO_17"), "poses.npz: --keypoints and --up are for a .trc; leave them out"),
        ("c.trc", ("--up", "Y"), "up"),
    ):
        done = jaxskel("evaluate", "poses.npz", truth, *arguments, cwd=folder)
        assert done.returncode == 2
        assert said in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
