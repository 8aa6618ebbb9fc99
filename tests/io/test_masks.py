"""The person in masks: everything but background, or the stated values; black views are never silent."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from support.painted_masks import (
    ASKED,
    DAVIS,
    FRAMES,
    READ,
    REFUSED,
    SIZE,
    SOFT,
    body,
    indexed,
    labels,
    opaque,
    painted,
    soft,
    with_alpha,
    written,
)

from jaxskel.io.recordings._view_table import read_view
from jaxskel.io.views import View
from jaxskel.segmentation import Cleaning


def view_of(path: Path, **table) -> View:
    """The view of a folder, or of the array `cam` of an archive."""
    name = f"{path.name}:cam" if path.suffix == ".npz" else path.name
    return read_view(path.parent / "recording.toml", "cam", {"masks": name} | table, 25.0, Cleaning(), True)


def silhouettes(view: View) -> np.ndarray:
    return np.array([view.silhouette(frame) for frame in range(FRAMES)])


def folder(tmp_path: Path) -> Path:
    (tmp_path / "cam").mkdir(exist_ok=True)
    return tmp_path / "cam"


WANTED = np.array([body(frame) for frame in range(FRAMES)])


@pytest.mark.parametrize("kind", READ)
def test_what_is_not_background_is_the_person(tmp_path, kind):
    seen = silhouettes(view_of(READ[kind](folder(tmp_path))))
    lossy = kind in ("JPEG", "WebP")
    assert np.count_nonzero(seen != WANTED) <= (4 * FRAMES if lossy else 0)


@pytest.mark.parametrize("kind", SOFT)
def test_soft_masks_are_cut_where_they_are_half_white(tmp_path, kind):
    half = np.array([soft(frame) for frame in range(FRAMES)])
    seen = silhouettes(view_of(SOFT[kind](folder(tmp_path))))
    clear = abs(half - 0.5) > 1 / 255
    np.testing.assert_array_equal(seen[clear], half[clear] > 0.5)


@pytest.mark.parametrize("kind", ASKED)
def test_values_that_say_nothing_are_named_and_the_answer_is_used(tmp_path, kind):
    write, told, person = ASKED[kind]
    path = write(folder(tmp_path))
    with pytest.raises(ValueError, match="name those of the person, person = ") as error:
        view_of(path)
    assert told in str(error.value)
    assert f"person = {person}" in str(error.value)
    assert "\n" not in str(error.value)
    seen = silhouettes(view_of(path, person=person))
    assert seen.any((1, 2)).all()
    assert not seen[~WANTED].any() or kind == "a scene"


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_no_mask_is_refused_in_a_line(tmp_path, kind):
    write, told = REFUSED[kind]
    path = write(folder(tmp_path))
    with pytest.raises(ValueError, match=told) as error:
        view_of(path)
    assert str(tmp_path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("write", "person", "wanted"),
    [
        (written(".png", labels(0, 2, 13, 18)), [2, 18], labels(0, 1, 0, 1)),
        (written(".png", labels(0, 24001, 26000, 40003, dtype=np.uint16)), [26000], labels(0, 0, 1, 0)),
        (indexed(".png", labels(0, 1, 2, 3)), [3], labels(0, 0, 0, 1)),
        (indexed(".png", labels(0, 1, 2, 3)), [[128, 0, 0]], labels(0, 1, 0, 0)),
        (written(".png", labels(255, 0, 0, 0)), [0], labels(0, 1, 1, 1)),
        (written(".png", painted((0, 0, 0), (255, 0, 0), (9, 8, 7), (0, 0, 255))), [[9, 8, 7]], labels(0, 0, 1, 0)),
    ],
)
def test_the_values_that_are_named_are_the_person(tmp_path, write, person, wanted):
    seen = silhouettes(view_of(write(folder(tmp_path)), person=person))
    np.testing.assert_array_equal(seen, np.array([wanted(frame) > 0 for frame in range(FRAMES)]))


@pytest.mark.parametrize(
    ("write", "person", "told"),
    [
        (READ["class labels"], [3], "none of the masks holds 3; there are 0, 2, 13 and 18"),
        (READ["class labels"], 2, "is 2; give values of the masks"),
        (READ["class labels"], [], r"is \[\]; give values"),
        (READ["class labels"], [True], r"is \[True\]; give values"),
        (READ["class labels"], [2, [1, 2, 3]], "give values"),
        (READ["class labels"], [[1, 2, 300]], "give values"),
        (READ["a colour for each part"], [2], r"are in colour, \[0, 0, 0\], .*; name colours"),
        (READ["JPEG"], [255], "values are not kept exactly"),
    ],
)
def test_values_that_cannot_be_the_person_are_refused(tmp_path, write, person, told):
    with pytest.raises(ValueError, match=told) as error:
        view_of(write(folder(tmp_path)), person=person)
    assert "views.cam.person" in str(error.value)


def long_view(tmp_path: Path, count: int, shown: dict[int, np.ndarray], empty: np.ndarray) -> Path:
    """Images that are empty except for a few."""
    for number in range(count):
        Image.fromarray(shown.get(number, empty)).save(folder(tmp_path) / f"{number:04d}.png")
    return folder(tmp_path)


def test_a_person_in_the_last_image_only_decides_for_all(tmp_path):
    black = np.zeros(SIZE[::-1], np.uint8)
    path = long_view(tmp_path, 40, {37: labels(0, 2, 9, 18)(0)}, black)
    view = view_of(path)
    np.testing.assert_array_equal(view.silhouette(37), body(0))
    assert not any(view.silhouette(number).any() for number in range(37))


def test_where_opacity_counts_an_image_without_anybody_is_empty_whatever_its_colour(tmp_path):
    nobody = np.full((*SIZE[::-1], 4), 255, np.uint8)
    nobody[..., 3] = 0
    view = view_of(long_view(tmp_path, 20, {5: with_alpha(grey=False)(0)}, nobody))
    np.testing.assert_array_equal(view.silhouette(5), body(0))
    assert not view.silhouette(6).any()


def test_black_views_stay_black(tmp_path):
    view = view_of(long_view(tmp_path, 12, {}, np.zeros(SIZE[::-1], np.uint8)))
    assert not any(view.silhouette(number).any() for number in range(12))


def with_one_other(tmp_path: Path, most: np.ndarray, other: np.ndarray) -> View:
    """A view with one inconsistent image, which is not among those sampled beforehand."""
    return view_of(long_view(tmp_path, 60, {31: other}, most))


@pytest.mark.parametrize(
    ("most", "other", "told"),
    [
        (labels(0, 255, 255, 255)(0), labels(0, 1, 1, 1)(0), "0031.png holds 0 and 1, but others white"),
        (labels(0, 255, 255, 255)(0), labels(0, 2, 13, 18)(0), "0031.png holds 0, 2, 13 and 18, but others white"),
        (labels(0, 1, 1, 1)(0), labels(0, 255, 255, 255)(0), "0031.png holds 255, but others 1;"),
        (labels(0, 2, 13, 18)(0), labels(0, 2, 2, 255)(0), "0031.png holds 2 and 255, but others 2, 13 and 18"),
        (
            np.uint16(255 * soft(0)),
            labels(0, 9, 9, 65535, dtype=np.uint16)(0),
            "0031.png holds 65535, but others no more than",
        ),
        (with_alpha(grey=False)(0), labels(0, 255, 255, 255)(0), "0031.png has no alpha channel"),
        (labels(0, 255, 255, 255)(0), painted((0, 0, 0), *[(255, 0, 0)] * 3)(0), "0031.png is a picture in colour"),
    ],
)
def test_an_image_that_does_not_go_with_the_others_is_named(tmp_path, most, other, told):
    view = with_one_other(tmp_path, most, other)
    view.silhouette(30)
    with pytest.raises(ValueError, match=told):
        view.silhouette(31)


def test_an_image_with_another_palette_is_named(tmp_path):
    path = indexed(".png", labels(0, 1, 2, 3))(folder(tmp_path))
    for number in range(FRAMES, 60):
        (path / f"{number:06d}.png").write_bytes((path / "000000.png").read_bytes())
    other = Image.fromarray(np.uint8(body(0))).convert("P")
    other.putpalette([9, 9, 9, 200, 0, 0])
    other.save(path / "000031.png")
    with pytest.raises(ValueError, match="000031.png: has another palette"):
        view_of(path).silhouette(31)


@pytest.mark.parametrize("other", [labels(0, 2, 7, 40)(1), np.zeros(SIZE[::-1], np.uint8)])
def test_other_labels_and_nobody_are_no_contradiction(tmp_path, other):
    view = with_one_other(tmp_path, labels(0, 2, 13, 18)(0), other)
    np.testing.assert_array_equal(view.silhouette(31), other > 0)


def test_dim_edges_alone_are_nobody_in_soft_masks(tmp_path):
    """A person about to enter the image: no pixel is half white yet."""
    dim = np.uint8(120 * soft(0))
    view = with_one_other(tmp_path, np.uint8(255 * soft(0)), dim)
    assert not view.silhouette(31).any()


@pytest.mark.parametrize("dark", [16, 0])
def test_a_black_that_is_not_0_is_nobody(tmp_path, dark):
    """As in images extracted from a video."""
    lit = np.where(body(0), 235, dark).astype(np.uint8)
    empty = np.full(SIZE[::-1], dark, np.uint8)
    empty[::2, ::3] += 2
    view = view_of(
        long_view(tmp_path, 60, {31: empty, 33: np.full_like(empty, dark)}, np.where(empty > dark, empty, lit))
    )
    assert view.silhouette(0).any()
    assert not view.silhouette(31).any()
    assert not view.silhouette(33).any()


def test_a_palette_whose_first_images_show_nobody_is_one_of_labels(tmp_path):
    path = indexed(".png", labels(0, 1, 2, 3))(folder(tmp_path))
    (path / "000002.png").rename(path / "000041.png")
    nobody = Image.fromarray(np.zeros(SIZE[::-1], np.uint8)).convert("P")
    nobody.putpalette(np.resize(DAVIS, (256, 3)).ravel().tolist())
    for number in (*range(41), *range(42, 60)):
        nobody.save(path / f"{number:06d}.png")
    np.testing.assert_array_equal(view_of(path, person=[2, 3]).silhouette(41), labels(0, 0, 1, 1)(2) > 0)


def filmed(path: Path, codec: str, drawn) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 25.0, SIZE)
    for frame in range(FRAMES):
        writer.write(np.repeat(drawn(frame)[..., None], 3, axis=2))
    writer.release()
    return path


@pytest.mark.parametrize(("codec", "value"), [("FFV1", 1), ("FFV1", 38), ("MJPG", 90)])
def test_a_video_with_labels_is_no_black_view(tmp_path, codec, value):
    path = filmed(tmp_path / "cam.avi", codec, labels(0, value, value, value))
    with pytest.raises(ValueError, match="none is white; write white for the person, labels as PNG"):
        view_of(path)


@pytest.mark.parametrize("drawn", [labels(0, 255, 255, 255), labels(0, 0, 0, 0)])
def test_a_video_in_black_and_white_or_black_is_read(tmp_path, drawn):
    seen = silhouettes(view_of(filmed(tmp_path / "cam.avi", "FFV1", drawn)))
    np.testing.assert_array_equal(seen, np.array([drawn(frame) > 0 for frame in range(FRAMES)]))


def test_opaque_images_are_masks_by_their_colour(tmp_path):
    view = view_of(long_view(tmp_path, 3, {1: opaque(0)}, opaque(1)))
    np.testing.assert_array_equal(view.silhouette(1), body(0))
