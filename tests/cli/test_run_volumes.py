"""`jaxskel run` of voxels and meshes, and what is done with its results afterwards."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.command_line import jaxskel
from support.voxel_people import carved

import jaxskel as js
from jaxskel.body import place_body, place_joints
from jaxskel.hull import VoxelGrid
from jaxskel.io import read_poses
from jaxskel.poses import score
from jaxskel.recording import rotation_to_z_up
from jaxskel.synthetic import camera_ring, demo_motion, detailed_body, make_scene

PAPER = js.paper_settings()


@cache
def given() -> tuple[js.Recording, np.ndarray, VoxelGrid]:
    scene = make_scene(6, cameras=camera_ring(6, size=(200, 160)))
    return scene, *carved(scene, PAPER)


def write_voxels(folder: Path, frames: slice) -> np.ndarray:
    """Write some of these frames; return the true joints (m)."""
    scene, occupied, grid = given()
    assert scene.truth is not None
    joints = scene.truth.joints[frames]
    np.savez_compressed(
        folder / "voxels.npz", occupied=np.packbits(occupied[frames], axis=-1), shape=grid.shape, origin=grid.origin,
        spacing=grid.spacing, fps=scene.fps, joints=joints,
    )  # fmt: skip
    return joints


@pytest.fixture
def voxels(tmp_path):
    write_voxels(tmp_path, slice(None))
    return tmp_path


def test_the_graph_of_voxels(voxels):
    done = jaxskel("run", "voxels.npz", "-o", "poses", "--preset", "paper", cwd=voxels)
    assert done.returncode == 0, done.stderr
    assert "voxels: unknown subject: stature" in done.stdout
    assert "6 frames, 6 with a pose" in done.stdout
    _, occupied, grid = given()
    poses, wanted = (
        read_poses(voxels / "poses" / "poses.npz"),
        js.reconstruct_hulls(occupied, grid.origin, grid.spacing),
    )
    np.testing.assert_allclose(poses.joints, wanted.joints, atol=1e-5)

    scored = jaxskel("evaluate", "poses/poses.npz", "voxels.npz", "-o", "score", cwd=voxels)
    assert scored.returncode == 0, scored.stderr
    assert json.loads((voxels / "score" / "score.json").read_text())["frames"] == 6
    for command in (
        ("export", "poses/poses.npz", "a.trc", "a.bvh"),
        ("report", "voxels.npz", "poses/poses.npz", "-o", "report.html"),
    ):
        done = jaxskel(*command, cwd=voxels)
        assert done.returncode == 0, done.stderr
    assert (voxels / "report.html").stat().st_size > 10_000


def test_a_subject_and_its_smoothing_reach_the_graph(voxels):
    (voxels / "subject.toml").write_text("stature = 1.6\n")
    options = ("--preset", "paper", "--subject", "subject.toml", "--smooth", "2")
    done = jaxskel("run", "voxels.npz", "-o", "poses", *options, cwd=voxels)
    assert done.returncode == 0, done.stderr
    assert "unknown subject" not in done.stdout
    skeleton = read_poses(voxels / "poses" / "poses.npz").skeleton
    assert skeleton is not None
    assert skeleton.stature == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--spacing", "0.02"), "--spacing: is for silhouettes"),
        (("--max-misses", "1"), "--max-misses: is for silhouettes"),
        (("--box", -1, -1, 0, 1, 1, 2), "--box: is for silhouettes"),
        (("--jobs", "2"), "--jobs: is for silhouettes"),
        (("--smooth", "100"), "a cutoff of 100 Hz"),
    ],
)
def test_options_that_voxels_have_no_use_for(voxels, options, told):
    done = jaxskel("run", "voxels.npz", "-o", "poses", "--preset", "paper", *options, cwd=voxels)
    assert done.returncode == 2
    assert told in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (voxels / "poses").exists()


def test_nobody_in_the_voxels(tmp_path):
    voxels = np.zeros((2, 30, 30, 30), bool)
    voxels[0, 3:5, 3:5, 3:5] = True
    np.savez_compressed(tmp_path / "voxels.npz", occupied=voxels, origin=np.zeros(3), spacing=0.02)
    done = jaxskel("run", "voxels.npz", "-o", "poses", "--preset", "paper", cwd=tmp_path)
    assert done.returncode == 1
    assert "no pose in any frame" in done.stderr
    assert read_poses(tmp_path / "poses" / "poses.npz").counts() == {"empty": 1, "no_hull": 1}


@pytest.mark.parametrize(("up", "options"), [("+Z", ()), ("-X", ("--up", "-X"))])
def test_a_scan(tmp_path, up, options):
    trimesh = pytest.importorskip("trimesh", reason="meshes need trimesh")
    adult = js.default_adult()
    motion = demo_motion(adult, 1)
    ends, radii = (np.asarray(each) for each in place_body(detailed_body(adult), motion))
    turned = rotation_to_z_up(up)
    ball = trimesh.creation.icosphere(subdivisions=2).vertices
    # Convex hulls of two balls each, which overlap.
    parts = [
        trimesh.convex.convex_hull(np.concatenate([end + radius * ball for end, radius in zip(*capsule, strict=True)]))
        for capsule in zip(ends[0] @ turned, radii, strict=True)
    ]
    trimesh.util.concatenate(parts).export(tmp_path / "scan.ply")
    done = jaxskel("run", "scan.ply", "-o", "poses", "--preset", "paper", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    poses = read_poses(tmp_path / "poses" / "poses.npz")
    truth = np.asarray(place_joints(adult, motion)[0]) @ turned
    assert (poses.counts(), poses.up) == ({"ok": 1}, up)
    assert np.median(np.linalg.norm(poses.joints - truth, axis=-1)) < 0.06


@pytest.mark.parametrize(
    ("source", "up", "told"),
    [
        ("voxels.npz", "up", "--up up: give one of +X, -X, +Y, -Y, +Z, -Z"),
        ("scene.npz", "+Y", "--up: is for voxels and meshes, but scene.npz says its own; leave it out"),
    ],
)
def test_an_axis_that_is_none_or_not_needed(voxels, source, up, told):
    js.io.write_recording(voxels / "scene.npz", given()[0])
    done = jaxskel("run", source, "-o", "poses", "--up", up, cwd=voxels)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert told in done.stderr
    assert not (voxels / "poses").exists()


@pytest.mark.slow
def test_the_search_finds_people_in_virtual_views_of_voxels(tmp_path):
    joints = write_voxels(tmp_path, slice(None, None, 3))
    done = jaxskel("run", "voxels.npz", "-o", "poses", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    scored = jaxskel("evaluate", "poses/poses.npz", "voxels.npz", "-o", "score", cwd=tmp_path)
    assert scored.returncode == 0, scored.stderr
    report = jaxskel("report", "voxels.npz", "poses/poses.npz", cwd=tmp_path)
    assert report.returncode == 0, report.stderr
    poses = read_poses(tmp_path / "poses" / "poses.npz")
    assert poses.has_pose.all()
    assert score(poses.joints.astype(float), joints, poses.has_pose).percentile(50) < 0.03
