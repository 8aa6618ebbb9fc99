"""Voxel files and meshes: what is read, what virtual cameras see of it, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from jaxtyping import TypeCheckError

import jaxskel as js
from jaxskel.io import read_recording, read_volumes
from jaxskel.io.recordings import holds_volumes, write_recording
from jaxskel.synthetic import make_scene
from jaxskel.volumes import Volumes, hulls_of

trimesh = pytest.importorskip("trimesh", reason="meshes need trimesh")

RNG = np.random.default_rng(3)
OCCUPIED = RNG.random((5, 6, 7, 11)) < 0.5
PLACE = {"origin": np.array([0.5, -1.0, 0.25]), "spacing": np.array(0.02)}


def written(path: Path, **arrays) -> Path:
    np.savez_compressed(path, **arrays)
    return path


def all_frames(volumes: Volumes) -> np.ndarray:
    hulls = hulls_of(volumes, np.arange(len(volumes)))
    return np.stack([hulls.dense(frame) for frame in range(len(hulls))])


FORMS = {
    "booleans": {"occupied": OCCUPIED},
    "bytes": {"occupied": OCCUPIED.astype(np.uint8)},
    "white bytes": {"occupied": 255 * OCCUPIED.astype(np.uint8)},
    "packed bits": {"occupied": np.packbits(OCCUPIED, axis=-1), "shape": np.array([6, 7, 11])},
}


@pytest.mark.parametrize("form", FORMS)
def test_voxels_are_read(tmp_path, form):
    joints = RNG.random((5, 15, 3))
    path = written(
        tmp_path / "a.npz", **FORMS[form], **PLACE, up="+Z", fps=12.5, frame_index=[3, 4, 5, 8, 9], joints=joints
    )
    volumes = read_volumes(path)
    np.testing.assert_array_equal(all_frames(volumes), OCCUPIED)
    np.testing.assert_array_equal(volumes.grid.origin, PLACE["origin"])
    assert (volumes.grid.spacing, volumes.up, volumes.fps, volumes.name) == (0.02, "+Z", 12.5, "a")
    assert volumes.frame_index.tolist() == [3, 4, 5, 8, 9]
    assert volumes.truth is not None
    np.testing.assert_array_equal(volumes.truth.joints, joints)


def test_what_a_voxel_file_need_not_say(tmp_path):
    volumes = read_volumes(written(tmp_path / "a.npz", occupied=OCCUPIED, **PLACE))
    assert (volumes.up, volumes.fps, volumes.skeleton, volumes.truth) == ("+Z", 30.0, None, None)
    assert volumes.frame_index.tolist() == [0, 1, 2, 3, 4]
    assert read_volumes(tmp_path / "a.npz", up="-Y").up == "-Y"


def test_a_known_subject_is_read(tmp_path):
    adult = js.default_adult(1.6)
    known = {"rest_joints": adult.rest_joints, "rest_tips": adult.rest_tips}
    volumes = read_volumes(written(tmp_path / "a.npz", occupied=OCCUPIED, **PLACE, **known))
    assert volumes.skeleton is not None
    assert volumes.skeleton.stature == pytest.approx(adult.stature)


def test_a_recording_of_voxels_is_what_virtual_cameras_see(tmp_path):
    path = written(tmp_path / "a.npz", occupied=OCCUPIED, **PLACE, fps=12.5)
    recording = read_recording(path)
    wanted = js.virtual_recording(OCCUPIED, PLACE["origin"], 0.02, fps=12.5)
    np.testing.assert_array_equal(recording.silhouettes, wanted.silhouettes)
    np.testing.assert_array_equal(recording.cameras.t, wanted.cameras.t)


def test_what_holds_volumes(tmp_path):
    write_recording(tmp_path / "scene.npz", make_scene(1))
    (tmp_path / "broken.npz").write_text("no archive")
    assert holds_volumes(written(tmp_path / "a.npz", occupied=OCCUPIED, **PLACE))
    assert holds_volumes(tmp_path / "any.PLY")
    for other in ("scene.npz", "broken.npz", "missing.npz", "folder"):
        assert not holds_volumes(tmp_path / other)


# What is wrong with a voxel file, and what the message must say.
WRONG = {
    "no origin": ({"origin": None}, "'origin'"),
    "no spacing": ({"spacing": None}, "'spacing'"),
    "numbers": ({"occupied": OCCUPIED.astype(float)}, "'occupied'"),
    "one frame": ({"occupied": OCCUPIED[0]}, "'occupied'"),
    "no frame": ({"occupied": OCCUPIED[:0]}, "'occupied'"),
    "another shape": ({"occupied": np.packbits(OCCUPIED, axis=-1), "shape": np.array([6, 7, 30])}, "'shape'"),
    "a shape of two": ({"occupied": np.packbits(OCCUPIED, axis=-1), "shape": np.array([6, 7])}, "'shape'"),
    "a shape of booleans": ({"shape": np.array([6, 7, 88])}, "'shape'"),
    "millimetres": ({"spacing": np.array(20.0)}, "spacing"),
    "an origin in millimetres": ({"origin": np.array([500.0, -1000.0, 250.0])}, "origin"),
    "three spacings": ({"spacing": np.full(3, 0.02)}, "spacing"),
    "text": ({"spacing": np.array("fine")}, "'spacing'"),
    "an unknown axis": ({"up": np.array("up")}, "'up'"),
    "no rate": ({"fps": np.array(0.0)}, "'fps'"),
    "truth of other frames": ({"joints": np.zeros((4, 15, 3))}, "'joints'"),
    "truth in millimetres": ({"joints": 1000 * RNG.random((5, 15, 3))}, "'joints'"),
    "numbers of other frames": ({"frame_index": np.arange(4)}, "'frame_index'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_fault_of_a_voxel_file_is_named_in_one_line(tmp_path, case):
    wrong, hint = WRONG[case]
    arrays = {key: value for key, value in ({"occupied": OCCUPIED} | PLACE | wrong).items() if value is not None}
    with pytest.raises(ValueError, match=r"\A[^\n]*\Z") as refused:
        read_volumes(written(tmp_path / "a.npz", **arrays))
    assert str(tmp_path / "a.npz") in str(refused.value)
    assert hint in str(refused.value)


def test_bits_without_a_shape_are_refused_when_they_are_read(tmp_path):
    path = written(tmp_path / "a.npz", occupied=np.full((1, 2, 2, 2), 6, np.uint8), **PLACE)
    with pytest.raises(ValueError, match="'occupied'.*frame 0.*shape"):
        read_recording(path)


def capsule(height: float = 1.2, radius: float = 0.2):
    mesh = trimesh.creation.capsule(height, radius, count=[40, 40])
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.4, [1, 2, 0]))
    mesh.apply_translation([0.31, 0.77, 0.123])
    return mesh


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".off"])
def test_a_mesh_becomes_voxels_whose_middle_lies_inside(tmp_path, suffix):
    mesh = capsule()
    mesh.export(tmp_path / f"scan{suffix}")
    volumes = read_volumes(tmp_path / f"scan{suffix}")
    occupied = all_frames(volumes)[0]
    assert occupied.sum() * volumes.grid.spacing**3 == pytest.approx(mesh.volume, rel=2e-3)
    middle = volumes.grid.centres()[occupied.ravel()].mean(0)
    np.testing.assert_allclose(middle, mesh.center_mass, atol=1e-3)


def test_surfaces_that_overlap_or_are_inside_out_have_one_inside(tmp_path):
    one, other = capsule(), capsule()
    other.apply_translation([0.1, 0.0, 0.0])
    trimesh.util.concatenate([one, other]).export(tmp_path / "both.ply")
    one.export(tmp_path / "one.ply")
    inside_out = one.copy()
    inside_out.invert()
    inside_out.export(tmp_path / "inside_out.ply")
    both, single, inverted = (all_frames(read_volumes(tmp_path / f"{n}.ply")) for n in ("both", "one", "inside_out"))
    np.testing.assert_array_equal(inverted, single)
    # The overlap, which both have, is occupied as well.
    assert single.sum() < both.sum() < 2 * single.sum()
    assert (both.sum(1) > 0).sum() >= (single.sum(1) > 0).sum()


def test_parts_that_share_corners_are_closed(tmp_path):
    # Two cubes of 0.5 m with an edge in common, at which four squares meet.
    cubes = [trimesh.creation.box((0.5, 0.5, 0.5)) for _ in range(2)]
    cubes[1].apply_translation([0.5, 0.5, 0.0])
    trimesh.util.concatenate(cubes).export(tmp_path / "scan.ply")
    volumes = read_volumes(tmp_path / "scan.ply")
    assert all_frames(volumes).sum() * volumes.grid.spacing**3 == pytest.approx(0.25)


@pytest.mark.parametrize(("axis", "up"), [((0, 1, 2), "+Z"), ((0, 2, 1), "+Y")])
def test_up_is_where_a_mesh_is_longest(tmp_path, axis, up):
    mesh = trimesh.creation.capsule(1.2, 0.2)
    trimesh.Trimesh(mesh.vertices[:, axis], mesh.faces).export(tmp_path / "scan.ply")
    assert read_volumes(tmp_path / "scan.ply").up == up
    assert read_volumes(tmp_path / "scan.ply", up="-Z").up == "-Z"


def with_a_hole(mesh):
    mesh.update_faces(np.arange(len(mesh.faces)) > 3)
    return mesh


def scaled(factor: float):
    mesh = capsule()
    mesh.apply_scale(factor)
    return mesh


def with_a_turned_triangle(mesh):
    mesh.faces[7] = mesh.faces[7][::-1]
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


FAULTY = {
    "a turned triangle": (lambda: with_a_turned_triangle(capsule()), "Re-Orient"),
    "a hole": (lambda: with_a_hole(capsule()), "MeshLab"),
    "millimetres": (lambda: scaled(1000.0), "scale it by 0.001"),
    "centimetres": (lambda: scaled(100.0), "scale it by 0.01"),
    "a hundredth": (lambda: scaled(0.01), "scale it by 100"),
    "a hall": (lambda: scaled(3.0), "one person"),
}


@pytest.mark.parametrize("case", FAULTY)
def test_a_fault_of_a_mesh_is_named_in_one_line(tmp_path, case):
    mesh, hint = FAULTY[case]
    mesh().export(tmp_path / "scan.ply")
    with pytest.raises(ValueError, match=r"\A[^\n]*scan\.ply: [^\n]*\Z") as refused:
        read_recording(tmp_path / "scan.ply")
    assert hint in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"ply\nformat", b"ply\nformat ascii 1.0\nelement vertex 99999999999\n"])
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".off"])
def test_what_is_no_mesh_is_refused_in_one_line(tmp_path, content, suffix):
    (tmp_path / f"scan{suffix}").write_bytes(content)
    with pytest.raises(ValueError, match=rf"\A[^\n]*scan{suffix}: [^\n]*\Z"):
        read_volumes(tmp_path / f"scan{suffix}")


@pytest.mark.parametrize("wrong", [{"path": 3}, {"up": 2}])
def test_a_wrong_argument_is_named(tmp_path, wrong):
    with pytest.raises((ValueError, TypeCheckError), match=next(iter(wrong))):
        read_volumes(**({"path": tmp_path / "scan.ply"} | wrong))
