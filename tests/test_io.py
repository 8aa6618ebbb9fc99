import csv
import io
import os
import pickle
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from jaxskel._camera import make_cameras
from jaxskel._poses import STATUS_NAMES, Poses, Status
from jaxskel._recording import Recording, Truth, pack_silhouettes, unpack_silhouettes
from jaxskel._skeleton import JOINT_NAMES, default_adult
from jaxskel.io import read_poses, read_recording, read_truth, write_poses, write_recording

SHARED = Path(__file__).parents[2] / "shared" / "data" / "sequences"
WIDTH, HEIGHT, FRAMES, CAMS = 20, 12, 2, 3


def a_recording() -> Recording:
    """Two frames of three cameras; a width that is no multiple of 8, so that bytes are padded."""
    rng = np.random.default_rng(0)
    adult = default_adult()
    turn = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    return Recording(
        cameras=make_cameras(
            K=np.tile([[20.0, 0.1, 10.0], [0.0, 21.0, 6.0], [0.0, 0.0, 1.0]], (CAMS, 1, 1)),
            R=np.stack([np.eye(3), turn, turn @ turn]),
            t=rng.normal(size=(CAMS, 3)),
            size=(WIDTH, HEIGHT),
            dist=rng.normal(size=(CAMS, 5)) * 0.01,
            names=("front", "left", "back"),
        ),
        silhouettes=pack_silhouettes(rng.random((FRAMES, CAMS, HEIGHT, WIDTH)) < 0.5),
        fps=29.97,
        up="-Y",
        frame_index=np.array([4, 9]),
        skeleton=adult,
        truth=Truth(np.stack([adult.rest_joints] * FRAMES), np.stack([adult.rest_tips] * FRAMES)),
        name="clip",
    )


def some_poses() -> Poses:
    """Three frames, the middle one without a pose."""
    rng = np.random.default_rng(1)
    gap = np.array([1.0, np.nan, 1.0])[:, None, None]
    return Poses(
        joints=(rng.normal(size=(3, 15, 3)) * gap).astype(np.float32),
        tips=(rng.normal(size=(3, 5, 3)) * gap).astype(np.float32),
        confidence=(rng.random((3, 15)) * [[1], [0], [1]]).astype(np.float32),
        side_confidence=np.array([1.0, 0.0, 0.5], np.float32),
        status=np.array([Status.OK, Status.NO_HULL, Status.VIEW_LOST]),
        fps=12.5,
        up="+Y",
        frame_index=np.array([7, 8, 9]),
    )


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


@pytest.fixture
def clip(tmp_path):
    path = tmp_path / "clip.npz"
    write_recording(path, a_recording())
    return path


@pytest.fixture
def poses_file(tmp_path):
    return write_poses(tmp_path, some_poses())[0]


def same(a: object, b: object) -> bool:
    """Equal field by field, with NaN equal to NaN."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if hasattr(a, "__dataclass_fields__"):
        return type(a) is type(b) and all(same(getattr(a, f), getattr(b, f)) for f in a.__dataclass_fields__)
    return a == b


def refused(read, path: Path, *parts: str) -> None:
    """Reading fails with one line that starts with the file and holds the parts."""
    with pytest.raises(ValueError, match=f"^{re.escape(str(path))}: ") as error:
        read(path)
    message = str(error.value)
    assert "\n" not in message
    for part in parts:
        assert part in message


# Recordings


def test_recording_round_trip(clip):
    assert same(read_recording(clip), a_recording())


def test_recording_without_what_is_optional(clip):
    arrays = arrays_of(clip)
    needed = {k: arrays[k] for k in ("silhouettes", "K", "R", "t", "size", "fps")}
    np.savez(clip, **needed)
    recording = read_recording(clip)
    assert recording.up == "+Z"
    assert recording.cameras.names == ("cam0", "cam1", "cam2")
    assert not recording.cameras.dist.any()
    assert recording.frame_index.tolist() == [0, 1]
    assert recording.skeleton is None
    assert recording.truth is None


@pytest.mark.parametrize(("dtype", "person"), [(bool, 1), (np.uint8, 1), (np.uint8, 255)])
def test_unpacked_masks_are_packed(clip, dtype, person):
    masks = unpack_silhouettes(a_recording().silhouettes, WIDTH)
    np.savez(clip, **(arrays_of(clip) | {"silhouettes": masks.astype(dtype) * dtype(person)}))
    assert same(read_recording(clip), a_recording())


def test_cameras_of_different_sizes(clip):
    masks = unpack_silhouettes(a_recording().silhouettes, WIDTH).copy()
    masks[:, 1, :, 13:] = False
    masks[:, 1, 9:] = False
    size = np.array([[20, 12], [13, 9], [20, 12]])
    np.savez(clip, **(arrays_of(clip) | {"silhouettes": np.packbits(masks, axis=-1), "size": size}))
    recording = read_recording(clip)
    assert np.array_equal(recording.cameras.size, size)
    write_recording(clip, recording)
    assert same(read_recording(clip), recording)
    for column, row in ((13, 0), (19, 0), (0, 9)):
        stray = masks.copy()
        stray[1, 1, row, column] = True
        np.savez(clip, **(arrays_of(clip) | {"silhouettes": np.packbits(stray, axis=-1)}))
        refused(read_recording, clip, "key 'silhouettes': camera left has person bits outside of its 13 x 9")


def test_truth_may_be_unknown_in_places(clip):
    joints = arrays_of(clip)["joints"].copy()
    joints[0], joints[1, 3] = np.nan, np.nan
    np.savez(clip, **(arrays_of(clip) | {"joints": joints}))
    truth = read_recording(clip).truth
    assert truth is not None
    assert np.array_equal(truth.joints, joints, equal_nan=True)


def test_signalling_nan_is_a_nan(clip):
    joints = arrays_of(clip)["joints"].astype(np.float32)
    joints.view(np.uint32)[1, 2] = 0x7F800001
    np.savez(clip, **(arrays_of(clip) | {"joints": joints}))
    truth = read_recording(clip).truth
    assert truth is not None
    assert np.isnan(truth.joints[1, 2]).all()


def _rows(key, index, value):
    """A change of one place of an array."""

    def change(arrays):
        changed = arrays[key].copy()
        changed[index] = value
        return {key: changed}

    return change


def _scaled(key, factor):
    return lambda arrays: {key: arrays[key] * factor}


def _cut(key, n):
    return lambda arrays: {key: arrays[key][:n]}


# What is wrong, the change that makes it so, the key that the message names, and how it says to mend it.
WRONG = {
    "fewer views": (lambda a: {"silhouettes": a["silhouettes"][:, :2]}, "silhouettes", "one view a camera"),
    "fewer rotations": (_cut("R", 2), "R", "(cams, 3, 3)"),
    "fewer translations": (_cut("t", 2), "t", "(cams, 3)"),
    "fewer lenses": (_cut("dist", 2), "dist", "each of 3 cameras"),
    "fewer names": (_cut("camera_names", 2), "camera_names", "3 different names"),
    "names twice": (_rows("camera_names", 1, "front"), "camera_names", "3 different names"),
    "names are numbers": (lambda a: {"camera_names": np.arange(3)}, "camera_names", "give text"),
    "masks too low": (lambda a: {"silhouettes": a["silhouettes"][:, :, 1:]}, "silhouettes", "12 rows"),
    "masks too narrow": (lambda a: {"silhouettes": a["silhouettes"][..., 1:]}, "silhouettes", "3 bytes"),
    "width and height exchanged": (lambda a: {"size": a["size"][::-1]}, "silhouettes", "size 12 x 20"),
    "masks of floats": (lambda a: {"silhouettes": a["silhouettes"] * 1.0}, "silhouettes", "uint8"),
    "masks without cameras": (lambda a: {"silhouettes": a["silhouettes"][:, 0]}, "silhouettes", "uint8"),
    "grey masks": (
        lambda a: {"silhouettes": np.full((FRAMES, CAMS, HEIGHT, WIDTH), 128, np.uint8)},
        "silhouettes", "threshold",
    ),
    "bits in the other order": (
        lambda a: {"silhouettes": np.packbits(np.ones((2, 3, HEIGHT, WIDTH), bool), -1, bitorder="little")},
        "silhouettes", "usual bit order",
    ),
    "no frames": (_cut("silhouettes", 0), "silhouettes", "at least one"),
    "one camera": (
        lambda a: {k: a[k][:1] for k in ("K", "R", "t", "dist", "camera_names")}
        | {"silhouettes": a["silhouettes"][:, :1]},
        "K", "at least 2",
    ),
    "stretched rotation": (_scaled("R", 1.1), "R", "camera front (index 0)"),
    "mirrored rotation": (_scaled("R", -1.0), "R", "flip one axis"),
    "Rodrigues vectors": (lambda a: {"R": a["t"]}, "R", "(cams, 3, 3)"),
    "NaN rotation": (_rows("R", (1, 0, 0), np.nan), "R", "index (1, 0, 0)"),
    "NaN translation": (_rows("t", (2, 1), np.nan), "t", "index (2, 1)"),
    "infinite focal length": (_rows("K", (0, 0, 0), np.inf), "K", "index (0, 0, 0)"),
    "absurd lens": (_rows("dist", (0, 0), 1e300), "dist", "index (0, 0)"),
    "negative focal length": (_rows("K", (1, 0, 0), -20.0), "K", "camera left (index 1)"),
    "K of other shape": (lambda a: {"K": a["K"][0]}, "K", "give (any, 3, 3)"),
    "translations in millimetres": (_scaled("t", 1000.0), "t", "divide by 1000"),
    "subject in millimetres": (
        lambda a: {k: a[k] * 1000 for k in ("rest_joints", "rest_tips")}, "rest_joints", "give metres",
    ),
    "truth in millimetres": (_scaled("joints", 1000.0), "joints", "divide by 1000"),
    "tips in millimetres": (_scaled("tips", 1000.0), "tips", "divide by 1000"),
    "infinite truth": (_rows("joints", (1, 2, 0), np.inf), "joints", "index (1, 2, 0)"),
    "truth of other frames": (_cut("joints", 1), "joints", "give (2, 15, 3)"),
    "tips of other frames": (_cut("tips", 1), "tips", "give (2, 5, 3)"),
    "no frame rate": (lambda a: {"fps": np.array(0.0)}, "fps", "positive"),
    "negative frame rate": (lambda a: {"fps": np.array(-25)}, "fps", "positive"),
    "NaN frame rate": (lambda a: {"fps": np.array(np.nan)}, "fps", "positive"),
    "infinite frame rate": (lambda a: {"fps": np.array(np.inf)}, "fps", "positive"),
    "frame rate as text": (lambda a: {"fps": np.array("25")}, "fps", "positive"),
    "two frame rates": (lambda a: {"fps": np.array([25.0, 30.0])}, "fps", "positive"),
    "up is z": (lambda a: {"up": np.array("z")}, "up", "+Z"),
    "up is a vector": (lambda a: {"up": np.array([0.0, 0.0, 1.0])}, "up", "text"),
    "frame numbers too few": (_cut("frame_index", 1), "frame_index", "2 whole numbers"),
    "frame numbers are floats": (_scaled("frame_index", 1.0), "frame_index", "2 whole numbers"),
    "frame numbers too large": (
        lambda a: {"frame_index": np.array([0, 2**64 - 1], np.uint64)}, "frame_index", "63 bits",
    ),
    "size of text": (lambda a: {"size": np.array("640x480")}, "size", "numbers"),
    "size of three": (lambda a: {"size": np.array([3, 4, 5])}, "size", "(width, height)"),
    "joints in disorder": (lambda a: {"joint_names": a["joint_names"][::-1]}, "joint_names", "pelvis, neck"),
    "complex numbers": (_scaled("K", 1j), "K", "plain arrays"),
    "dates": (lambda a: {"t": np.zeros((3, 3), "M8[s]")}, "t", "plain arrays"),
    "records": (lambda a: {"K": np.zeros(3, [("x", float)])}, "K", "plain arrays"),
    "pickled objects": (lambda a: {"R": np.array([{}, None], object)}, "R", "pickled"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_wrong_recording_names_file_key_and_remedy(clip, what):
    change, key, remedy = WRONG[what]
    arrays = arrays_of(clip)
    np.savez(clip, **(arrays | change(arrays)))
    refused(read_recording, clip, f"key '{key}': ", remedy)


@pytest.mark.parametrize("key", ["silhouettes", "K", "R", "t", "size", "fps"])
def test_missing_key(clip, key):
    arrays = arrays_of(clip)
    del arrays[key]
    np.savez(clip, **arrays)
    refused(read_recording, clip, f"key '{key}': is missing", "up")


@pytest.mark.parametrize("pair", [("rest_joints", "rest_tips"), ("rest_tips", "rest_joints"), ("tips", "joints")])
def test_half_of_a_pair(clip, pair):
    kept, lost = pair
    arrays = arrays_of(clip)
    del arrays[lost]
    np.savez(clip, **arrays)
    refused(read_recording, clip, f"key '{kept}': comes without {lost}")


def test_names_with_line_breaks_stay_on_one_line(tmp_path, clip):
    arrays = arrays_of(clip)
    path = tmp_path / "two\nlines.npz"
    np.savez(path, **(arrays | {"camera_names": np.array(["a\nb", "c", "d"]), "R": arrays["R"] * 2}))
    with pytest.raises(ValueError, match="two lines.npz: key 'R': camera a b") as error:
        read_recording(path)
    assert "\n" not in str(error.value)


NOT_ARCHIVES = {
    "empty": b"",
    "text": b"frame,joint\n1,2\n",
    "npy": b"\x93NUMPY\x01\x00",
    "pickle": pickle.dumps({"K": 1}),
    "empty zip": b"PK\x05\x06" + bytes(18),
}


@pytest.mark.parametrize("what", NOT_ARCHIVES)
@pytest.mark.parametrize("read", [read_recording, read_poses, read_truth])
def test_not_an_archive(tmp_path, read, what):
    path = tmp_path / "clip.npz"
    path.write_bytes(NOT_ARCHIVES[what])
    refused(read, path)


@pytest.mark.parametrize("read", [read_recording, read_poses, read_truth])
def test_no_file(tmp_path, read):
    refused(read, tmp_path / "none.npz", "check the path")
    refused(read, tmp_path, "jaxskel init" if read is read_recording else "check the path")


def test_truncated_archive(clip):
    clip.write_bytes(clip.read_bytes()[:-30])
    refused(read_recording, clip, "truncated")


def npy(shape: tuple[int, ...], content: bytes) -> bytes:
    """An array of bytes whose header claims a shape."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": "|u1", "fortran_order": False, "shape": shape})
    return file.getvalue() + content


def replace_member(path: Path, key: str, content: bytes) -> None:
    with zipfile.ZipFile(path) as old:
        members = {name: old.read(name) for name in old.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name, data in (members | {f"{key}.npy": content}).items():
            new.writestr(name, data)


@pytest.mark.parametrize("frames", [3, 10**9, 10**30])
def test_header_that_claims_more_than_is_there(clip, frames):
    replace_member(clip, "silhouettes", npy((frames, CAMS, HEIGHT, 3), bytes(2 * CAMS * HEIGHT * 3)))
    refused(read_recording, clip, f"key 'silhouettes': claims shape ({frames}, ", "but holds 216 bytes")


@pytest.mark.parametrize("size", [10**9, 2**40])
def test_directory_that_claims_more_than_is_there(clip, size):
    # The array header and the zip directory agree on a size that the compressed bytes cannot hold.
    frames = size // (CAMS * HEIGHT * 3)
    header = npy((frames, CAMS, HEIGHT, 3), b"")
    replace_member(clip, "silhouettes", header)
    claimed = len(header) + frames * CAMS * HEIGHT * 3
    with zipfile.ZipFile(clip, "a") as archive:
        archive.getinfo("silhouettes.npy").file_size = claimed
        archive._didModify = True  # write the directory again, with the lie
    refused(read_recording, clip, f"key 'silhouettes': claims {claimed} bytes that the file cannot hold")


def test_directory_that_claims_more_than_the_file_is_long(clip):
    np.savez(clip, **arrays_of(clip))  # stored plainly: both sizes of a member are the same
    with zipfile.ZipFile(clip, "a") as archive:
        member = archive.getinfo("K.npy")
        member.file_size = member.compress_size = 10**9
        archive._didModify = True
    refused(read_recording, clip, "key 'K': claims 1000000000 bytes that the file cannot hold")


def test_member_that_is_no_array(clip):
    replace_member(clip, "K", b"not an array")
    refused(read_recording, clip, "key 'K': is not a NumPy array")


class Bomb:
    """Unpickling this makes a folder."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


def test_pickles_are_never_run(clip, tmp_path):
    trap = tmp_path / "sprung"
    held = io.BytesIO()
    np.save(held, np.array([Bomb(str(trap))], object))
    for content in (held.getvalue(), pickle.dumps(Bomb(str(trap)))):
        for key in ("K", "camera_names", "joints"):
            write_recording(clip, a_recording())
            replace_member(clip, key, content)
            for read in (read_recording, read_truth):
                if (read, key) == (read_truth, "K") or (read, key) == (read_truth, "camera_names"):
                    continue  # not read, so not refused
                refused(read, clip, f"key '{key}'")
    assert not trap.exists()


def test_broken_write_leaves_the_old_file(clip, monkeypatch):
    before = clip.read_bytes()
    folder = sorted(clip.parent.iterdir())

    def broken(file, **arrays):
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", broken)
    with pytest.raises(OSError, match="disk full"):
        write_recording(clip, a_recording())
    assert clip.read_bytes() == before
    assert sorted(clip.parent.iterdir()) == folder


def test_shared_sequence():
    if not SHARED.is_dir():
        pytest.skip(f"needs the shared sequences at {SHARED}")
    recording = read_recording(SHARED / "13_17_male.npz")
    assert len(recording) == 60
    assert len(recording.cameras) == 10
    assert recording.truth is not None
    assert recording.skeleton is not None
    truth, up, frame_index = read_truth(SHARED / "13_17_male.npz")
    assert np.array_equal(truth.joints, recording.truth.joints)
    assert up == "+Z"
    assert np.array_equal(frame_index, recording.frame_index)


# Poses


def test_poses_round_trip(poses_file):
    assert same(read_poses(poses_file), some_poses())


def test_poses_file_holds_what_its_readers_need(poses_file):
    arrays = arrays_of(poses_file)
    assert arrays["joint_names"].tolist() == list(JOINT_NAMES)
    assert arrays["status_names"].tolist() == list(STATUS_NAMES)
    assert arrays["joints"].dtype == np.float32
    assert arrays["confidence"].dtype == np.float32
    assert np.isnan(arrays["joints"][1]).all()


def test_poses_table(tmp_path):
    poses = some_poses()
    _, table = write_poses(tmp_path / "new" / "folder", poses)
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:6] == ["frame_index", "time_s", "status", "pelvis_x", "pelvis_y", "pelvis_z"]
    assert list(rows[0])[-1] == "r_foot_confidence"
    assert [row["frame_index"] for row in rows] == ["7", "8", "9"]
    assert [float(row["time_s"]) for row in rows] == [0.0, 0.08, 0.16]
    assert [row["status"] for row in rows] == ["ok", "no_hull", "view_lost"]
    for name, cell in rows[1].items():
        assert (cell == "") == (name not in ("frame_index", "time_s", "status"))
    for i in (0, 2):
        for j, joint in enumerate(JOINT_NAMES):
            read = [float(rows[i][f"{joint}_{axis}"]) for axis in "xyz"]
            np.testing.assert_allclose(read, poses.joints[i, j], atol=1e-6)
            np.testing.assert_allclose(float(rows[i][f"{joint}_confidence"]), poses.confidence[i, j], atol=1e-4)


def test_poses_serve_as_truth(poses_file):
    truth, up, frame_index = read_truth(poses_file)
    assert np.array_equal(truth.joints, some_poses().joints, equal_nan=True)
    assert up == "+Y"
    assert frame_index.tolist() == [7, 8, 9]


WRONG_POSES = {
    "fewer tips": (_cut("tips", 2), "tips", "give (3, 5, 3)"),
    "fewer confidences": (_cut("confidence", 2), "confidence", "give (3, 15)"),
    "confidence in percent": (lambda a: {"confidence": np.full((3, 15), 90.0)}, "confidence", "0..1"),
    "negative side confidence": (_rows("side_confidence", 0, -0.5), "side_confidence", "0..1"),
    "NaN confidence": (_rows("confidence", (1, 4), np.nan), "confidence", "index (1, 4)"),
    "unknown status": (_rows("status", 0, 99), "status", "view_lost"),
    "negative status": (_rows("status", 0, -1), "status", "view_lost"),
    "status of floats": (_scaled("status", 1.0), "status", "whole numbers"),
    "status without pose but joints": (_rows("status", 2, Status.EMPTY), "joints", "frame 2 is empty"),
    "status with pose but no joints": (_rows("status", 1, Status.OK), "joints", "frame 1 is ok"),
    "half a pose": (_rows("tips", (0, 3), np.nan), "tips", "frame 0 is ok"),
    "other statuses": (lambda a: {"status_names": a["status_names"][::-1]}, "status_names", "ok, view_lost"),
    "fps": (lambda a: {"fps": np.array(0)}, "fps", "positive"),
    "up": (lambda a: {"up": np.array("up")}, "up", "+Z"),
    "frame_index": (_cut("frame_index", 1), "frame_index", "3 whole numbers"),
}


@pytest.mark.parametrize("what", WRONG_POSES)
def test_wrong_poses_name_file_key_and_remedy(poses_file, what):
    change, key, remedy = WRONG_POSES[what]
    arrays = arrays_of(poses_file)
    np.savez(poses_file, **(arrays | change(arrays)))
    refused(read_poses, poses_file, f"key '{key}': ", remedy)
