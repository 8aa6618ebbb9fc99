"""Recordings in one file: nothing is lost, and what is wrong is named."""

from pathlib import Path

import numpy as np
import pytest
from support.files import (
    CAMS,
    FRAMES,
    HEIGHT,
    WIDTH,
    a_recording,
    arrays_of,
    cut,
    recording_file,
    refused,
    rows,
    same,
    scaled,
)

from jaxskel.io.poses import read_truth
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.recording import unpack_silhouettes

SHARED = Path(__file__).parents[3] / "shared" / "data" / "sequences"


@pytest.fixture
def clip(tmp_path):
    return recording_file(tmp_path)


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


WRONG = {
    "fewer views": (lambda a: {"silhouettes": a["silhouettes"][:, :2]}, "silhouettes", "one view a camera"),
    "fewer rotations": (cut("R", 2), "R", "(cams, 3, 3)"),
    "fewer translations": (cut("t", 2), "t", "(cams, 3)"),
    "fewer lenses": (cut("dist", 2), "dist", "each of 3 cameras"),
    "fewer names": (cut("camera_names", 2), "camera_names", "3 different names"),
    "names twice": (rows("camera_names", 1, "front"), "camera_names", "3 different names"),
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
    "no frames": (cut("silhouettes", 0), "silhouettes", "at least one"),
    "one camera": (
        lambda a: {k: a[k][:1] for k in ("K", "R", "t", "dist", "camera_names")}
        | {"silhouettes": a["silhouettes"][:, :1]},
        "K", "at least 2",
    ),
    "stretched rotation": (scaled("R", 1.1), "R", "camera front (index 0)"),
    "mirrored rotation": (scaled("R", -1.0), "R", "flip one axis"),
    "Rodrigues vectors": (lambda a: {"R": a["t"]}, "R", "(cams, 3, 3)"),
    "NaN rotation": (rows("R", (1, 0, 0), np.nan), "R", "index (1, 0, 0)"),
    "NaN translation": (rows("t", (2, 1), np.nan), "t", "index (2, 1)"),
    "infinite focal length": (rows("K", (0, 0, 0), np.inf), "K", "index (0, 0, 0)"),
    "absurd lens": (rows("dist", (0, 0), 1e300), "dist", "index (0, 0)"),
    "negative focal length": (rows("K", (1, 0, 0), -20.0), "K", "camera left (index 1)"),
    "K of other shape": (lambda a: {"K": a["K"][0]}, "K", "give (any, 3, 3)"),
    "translations in millimetres": (scaled("t", 1000.0), "t", "divide by 1000"),
    "subject in millimetres": (
        lambda a: {k: a[k] * 1000 for k in ("rest_joints", "rest_tips")}, "rest_joints", "give metres",
    ),
    "truth in millimetres": (scaled("joints", 1000.0), "joints", "divide by 1000"),
    "tips in millimetres": (scaled("tips", 1000.0), "tips", "divide by 1000"),
    "infinite truth": (rows("joints", (1, 2, 0), np.inf), "joints", "index (1, 2, 0)"),
    "truth of other frames": (cut("joints", 1), "joints", "give (2, 15, 3)"),
    "tips of other frames": (cut("tips", 1), "tips", "give (2, 5, 3)"),
    "no frame rate": (lambda a: {"fps": np.array(0.0)}, "fps", "positive"),
    "negative frame rate": (lambda a: {"fps": np.array(-25)}, "fps", "positive"),
    "NaN frame rate": (lambda a: {"fps": np.array(np.nan)}, "fps", "positive"),
    "infinite frame rate": (lambda a: {"fps": np.array(np.inf)}, "fps", "positive"),
    "frame rate as text": (lambda a: {"fps": np.array("25")}, "fps", "positive"),
    "two frame rates": (lambda a: {"fps": np.array([25.0, 30.0])}, "fps", "positive"),
    "up is z": (lambda a: {"up": np.array("z")}, "up", "+Z"),
    "up is a vector": (lambda a: {"up": np.array([0.0, 0.0, 1.0])}, "up", "text"),
    "frame numbers too few": (cut("frame_index", 1), "frame_index", "2 whole numbers"),
    "frame numbers are floats": (scaled("frame_index", 1.0), "frame_index", "2 whole numbers"),
    "frame numbers too large": (
        lambda a: {"frame_index": np.array([0, 2**64 - 1], np.uint64)}, "frame_index", "63 bits",
    ),
    "size of text": (lambda a: {"size": np.array("640x480")}, "size", "numbers"),
    "size of three": (lambda a: {"size": np.array([3, 4, 5])}, "size", "(width, height)"),
    "joints in disorder": (lambda a: {"joint_names": a["joint_names"][::-1]}, "joint_names", "pelvis, neck"),
    "complex numbers": (scaled("K", 1j), "K", "plain arrays"),
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
