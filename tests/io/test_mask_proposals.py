"""What `init` writes for masks that are not black and white, and for names that are not numbers."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support import recording_folders as folders

from jaxskel.io.proposals import propose_recording
from jaxskel.io.proposals._proposals import Proposal
from jaxskel.io.recordings import read_recording

NAMES = ("left", "front", "right")
# Rows above the lower part. The figure is small, and smaller regions count as edges, not parts.
UPPER = 19


def masks_of(camera: int) -> np.ndarray:
    return folders.masks_of(folders.a_recording(), camera) > 0


def written(
    folder: Path, draw: Callable[[np.ndarray], np.ndarray | Image.Image], name: str = "{:06d}.png", **options
) -> Path:
    """A folder that nobody has described yet, its masks drawn anew."""
    (folders.write_folder(folder, "folders") / "recording.toml").unlink()
    for camera, view in enumerate(NAMES):
        for file in (folder / "masks" / view).iterdir():
            file.unlink()
        for frame, mask in enumerate(masks_of(camera)):
            drawn = draw(mask)
            image = drawn if isinstance(drawn, Image.Image) else Image.fromarray(drawn)
            image.save(folder / "masks" / view / name.format(frame), **options)
    return folder


def read(folder: Path, proposal: Proposal) -> np.ndarray:
    """The recording that is proposed, by the cameras' order of `NAMES`."""
    (folder / "recording.toml").write_text(proposal.text)
    recording = read_recording(folder)
    order = [recording.cameras.names.index(name) for name in NAMES]
    return np.unpackbits(recording.silhouettes[:][:, order], axis=-1) > 0


WANTED = np.stack([masks_of(camera) for camera in range(3)], axis=1)


def parted(*values: int) -> Callable[[np.ndarray], np.ndarray]:
    """Background, upper and lower part of the person in these values."""

    def draw(mask: np.ndarray) -> np.ndarray:
        upper = np.arange(len(mask))[:, None] < UPPER
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


def with_a_palette(mask: np.ndarray) -> Image.Image:
    """Index 1 is a dark red, as the palette of DAVIS has it."""
    image = Image.fromarray(mask.astype(np.uint8)).convert("P")
    image.putdata(mask.ravel().astype(int).tolist())
    image.putpalette([0, 0, 0, 128, 0, 0])
    return image


KINDS = {
    "palette": (with_a_palette, "{:06d}.png", ()),
    "grey with alpha": (lambda mask: np.stack([np.full(mask.shape, 90), 255 * mask], -1).astype(np.uint8),
                        "{:06d}.png", ()),
    "ones of 16 bits": (lambda mask: mask.astype(np.uint16), "{:06d}.png", ()),
    "one instance": (parted(0, 38, 38), "{:06d}.png", ("masks hold 0 and 38: 38 is taken for the person",)),
    "PBM": (lambda mask: Image.fromarray(mask), "{:06d}.pbm", ()),
    "WebP": (parted(0, 255, 255), "{:06d}.webp", ()),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_masks_of_any_kind_are_proposed_as_masks_and_never_as_pictures(tmp_path, kind):
    draw, name, told = KINDS[kind]
    options = {"lossless": True} if kind == "WebP" else {}
    proposal = propose_recording(written(tmp_path, draw, name, **options), fps=25.0)
    assert (proposal.text.count("\nmasks = "), "median" in proposal.text) == (3, False)
    assert proposal.doubts == tuple(f"{view}: {each}" for view in ("front", "left", "right") for each in told)
    np.testing.assert_array_equal(read(tmp_path, proposal), WANTED)


@pytest.mark.parametrize(
    "name",
    [
        "{:06d}_0.png",  # frame and person
        "Camera (5)_{0:04d}_2019-08-23_16-08-50.{0}92.png",  # camera, frame, date and time
        "cam1_{:06d}_640x480.png",
    ],
)
def test_numbers_that_are_not_the_frame_stay_what_they_are(tmp_path, name):
    proposal = propose_recording(written(tmp_path, parted(0, 255, 255), name), fps=25.0)
    assert proposal.doubts == ()
    np.testing.assert_array_equal(read(tmp_path, proposal), WANTED)
    assert read_recording(tmp_path).frame_index.tolist() == list(range(len(WANTED)))


def test_values_that_say_nothing_are_proposed_to_be_checked(tmp_path):
    proposal = propose_recording(written(tmp_path, parted(0, 1, 255)), fps=25.0)
    assert proposal.text.count("person = [1]  # CHECK: masks hold 0, 1 and 255; name those of the person") == 3
    assert len(proposal.doubts) == 3
    upper = np.arange(WANTED.shape[2])[:, None] < UPPER
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
