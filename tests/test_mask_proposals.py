"""What `init` writes of masks that are not black and white, and of names that are not numbers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import test_folders as folders
from PIL import Image

from jaxskel.io import read_recording
from jaxskel.io.proposals import Proposal, propose_recording

NAMES = ("left", "front", "right")


def masks_of(camera: int) -> np.ndarray:
    return folders.masks_of(folders.a_recording(), camera) > 0


def written(folder: Path, draw: Callable[[np.ndarray], np.ndarray], name: str = "{:06d}.png") -> Path:
    """A folder that nobody has described yet, its masks drawn anew."""
    (folders.write_folder(folder, "folders") / "recording.toml").unlink()
    for camera, view in enumerate(NAMES):
        for file in (folder / "masks" / view).iterdir():
            file.unlink()
        for frame, mask in enumerate(masks_of(camera)):
            Image.fromarray(draw(mask)).save(folder / "masks" / view / name.format(frame))
    return folder


def read(folder: Path, proposal: Proposal) -> np.ndarray:
    """The recording that is proposed, by the cameras' order of `NAMES`."""
    (folder / "recording.toml").write_text(proposal.text)
    recording = read_recording(folder)
    order = [recording.cameras.names.index(name) for name in NAMES]
    return np.unpackbits(recording.silhouettes[:][:, order], axis=-1) > 0


WANTED = np.stack([masks_of(camera) for camera in range(3)], axis=1)


def parted(*values: int) -> Callable[[np.ndarray], np.ndarray]:
    """Background, upper and lower half of the person in these values."""

    def draw(mask: np.ndarray) -> np.ndarray:
        upper = np.arange(len(mask))[:, None] < 15
        return np.where(mask, np.where(upper, values[1], values[2]), values[0]).astype(np.uint8)

    return draw


def test_labels_are_told_and_taken_for_the_person(tmp_path):
    proposal = propose_recording(written(tmp_path, parted(0, 2, 18)), fps=25.0)
    told = "masks hold 0, 2 and 18: all that is not 0 is taken for the person"
    assert proposal.doubts == tuple(f"{name}: {told}" for name in ("front", "left", "right"))
    assert proposal.text.count(f"# {told}") == 3
    np.testing.assert_array_equal(read(tmp_path, proposal), WANTED)


def test_of_black_and_white_there_is_nothing_to_say(tmp_path):
    assert propose_recording(written(tmp_path, parted(0, 255, 255)), fps=25.0).doubts == ()


def test_values_that_say_nothing_are_proposed_to_be_checked(tmp_path):
    proposal = propose_recording(written(tmp_path, parted(0, 1, 255)), fps=25.0)
    assert proposal.text.count("person = [1]  # CHECK: masks hold 0, 1 and 255; name those of the person") == 3
    assert len(proposal.doubts) == 3
    upper = np.arange(WANTED.shape[2])[:, None] < 15
    np.testing.assert_array_equal(read(tmp_path, proposal), WANTED & upper)


def test_masks_that_are_black_on_white_are_told(tmp_path):
    proposal = propose_recording(written(tmp_path, parted(255, 0, 0)), fps=25.0)
    assert "of the masks are white; where the person is black, write person = [0]" in proposal.doubts[0]


def test_masks_of_which_nothing_can_be_made_are_no_pictures(tmp_path):
    ramp = np.uint8((7 * np.arange(folders.SIZE[0])[None] + 13 * np.arange(folders.SIZE[1])[:, None]) % 120)
    with pytest.raises(ValueError, match="too many to be labels, and none is white") as error:
        propose_recording(written(tmp_path, lambda mask: mask * ramp), fps=25.0)
    assert str(tmp_path / "masks") in str(error.value)


def test_times_in_names_are_told(tmp_path):
    proposal = propose_recording(written(tmp_path, parted(0, 255, 255), "1605890123400{}00000.png"), fps=25.0)
    assert proposal.doubts[0].startswith("front: images are numbered in the order of their times")
    np.testing.assert_array_equal(read(tmp_path, proposal), WANTED)
