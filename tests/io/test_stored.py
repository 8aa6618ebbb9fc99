"""Silhouettes read from their file on access equal those read at once."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from jaxskel import (
    Poses,
    Recording,
    join_poses,
    paper_settings,
    prepare,
    reconstruct_batches,
    unpack_silhouettes,
)
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.recording import AbstractSilhouettes, silhouette_areas
from jaxskel.synthetic import make_scene

pytestmark = pytest.mark.slow

FRAMES = 40


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(FRAMES, 4.0)


@pytest.fixture(scope="module", params=["packed", "masks", "not compressed"])
def path(scene: Recording, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    file = tmp_path_factory.mktemp("stored") / "scene.npz"
    write_recording(file, scene)
    if request.param != "packed":
        arrays = dict(np.load(file))
        if request.param == "masks":
            arrays["silhouettes"] = unpack_silhouettes(np.asarray(scene.silhouettes), int(scene.cameras.size[0, 0]))
        save = np.savez if request.param == "not compressed" else np.savez_compressed
        save(file, **arrays)
    return file


def test_only_what_is_asked_for_is_read(path: Path, scene: Recording):
    stored = read_recording(path, in_memory=0).silhouettes
    assert isinstance(stored, AbstractSilhouettes)
    assert stored.shape == scene.silhouettes.shape
    assert len(stored) == FRAMES
    for index in (slice(3, 9), slice(None), np.array([0, 1, 2, 17, 39]), np.array([5, 2]), 7, -1, slice(8, None, 8)):
        np.testing.assert_array_equal(stored[index], np.asarray(scene.silhouettes)[index])
    np.testing.assert_array_equal(stored[:, [2, 0]], np.asarray(scene.silhouettes)[:, [2, 0]])
    np.testing.assert_array_equal(stored[4, 1], np.asarray(scene.silhouettes)[4, 1])
    np.testing.assert_array_equal(np.asarray(stored), scene.silhouettes)
    np.testing.assert_array_equal(silhouette_areas(stored), silhouette_areas(scene.silhouettes))


def made_of(recording: Recording) -> tuple[Poses, int]:
    """Poses, and how many views may miss a voxel."""
    settings = paper_settings()
    prepared = prepare(recording, settings)
    return join_poses(reconstruct_batches(recording, settings, prepared)), prepared.max_misses


@pytest.fixture(scope="module")
def wanted(scene: Recording) -> tuple[Poses, int]:
    """Of the recording in memory."""
    return made_of(scene)


def test_poses_are_the_same(path: Path, scene: Recording, wanted: tuple[Poses, int]):
    whole = read_recording(path)
    assert isinstance(whole.silhouettes, np.ndarray)
    np.testing.assert_array_equal(whole.silhouettes, scene.silhouettes)
    poses, max_misses = made_of(read_recording(path, in_memory=0))
    assert max_misses == wanted[1]
    np.testing.assert_array_equal(poses.joints, wanted[0].joints)


def test_damage_is_told_when_it_is_met(path: Path):
    raw = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        info = archive.getinfo("silhouettes.npy")
    middle = info.header_offset + info.compress_size // 2
    raw[middle : middle + 40] = bytes(byte ^ 255 for byte in raw[middle : middle + 40])
    damaged = path.with_name("damaged.npz")
    damaged.write_bytes(raw)
    recording = read_recording(damaged, in_memory=0)
    with pytest.raises(ValueError, match=r"damaged\.npz: key 'silhouettes': "):
        _ = recording.silhouettes[:]


def test_bits_outside_an_image_are_told_when_they_are_met(scene: Recording, tmp_path: Path):
    silhouettes = np.array(scene.silhouettes)
    arrays = dict(np.load(_written(tmp_path, scene)))
    arrays["silhouettes"], arrays["size"] = silhouettes, arrays["size"] - [4, 0]
    silhouettes[30, 1, 5, -1] = 1
    np.savez_compressed(tmp_path / "wide.npz", **arrays)
    stored = read_recording(tmp_path / "wide.npz", in_memory=0).silhouettes
    with pytest.raises(ValueError, match=r"wide\.npz: key 'silhouettes': camera \S+ has person bits"):
        _ = stored[30]


def _written(folder: Path, scene: Recording) -> Path:
    write_recording(folder / "scene.npz", scene)
    return folder / "scene.npz"
