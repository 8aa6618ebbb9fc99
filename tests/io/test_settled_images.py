"""Changes of images, made by NumPy and found from sizes and silhouettes."""

import cv2
import numpy as np
import pytest
from support.outline_sets import outlines
from support.undescribed_folders import SIZE, VIEWS, masks, rig, same, shrunk

from jaxskel.cameras import ImageChange
from jaxskel.io.proposals._settled_images import SeenViews, settled, stated, turned_or_mirrored
from jaxskel.io.proposals._size_choices import choices_for

W, H = SIZE
TALL = (256, 216)


def seen(changes, size=SIZE) -> SeenViews:
    """Images of the cameras at this size, with a change for all views, or one for each."""
    changes = changes if isinstance(changes, list) else [changes] * VIEWS
    images = [[change(image[view]) for view, change in enumerate(changes)] for image in masks(size)]
    found = {}
    for view in range(VIEWS):
        own = outlines(np.stack([frame[view] for frame in images])[:, None])
        found |= {(frame, view): outline for (frame, _), outline in own.items()}
    sizes = [(float(image.shape[1]), float(image.shape[0])) for image in images[0]]
    return SeenViews(rig(size), [(float(size[0]), float(size[1]))] * VIEWS, sizes, found)


def padded(top: int, bottom: int, left: int, right: int):
    return lambda image: np.pad(image, ((top, bottom), (left, right)))


def squeezed(image: np.ndarray) -> np.ndarray:
    return np.where(cv2.resize(image, (H, H), interpolation=cv2.INTER_AREA) >= 128, np.uint8(255), np.uint8(0))


@pytest.mark.parametrize(
    ("change", "size", "wanted"),
    [
        (shrunk, SIZE, ImageChange(scale=(0.5, 0.5))),
        (squeezed, SIZE, ImageChange(scale=(0.75, 1.0))),
        (lambda image: image[12:-12], TALL, ImageChange(crop=(0.0, 12.0))),
        (lambda image: image[12:-12, 16:-16], TALL, ImageChange(crop=(16.0, 12.0))),
        (lambda image: image[24:], TALL, ImageChange(crop=(0.0, 24.0))),
        (lambda image: image[:-24], TALL, ImageChange()),
        (lambda image: np.rot90(image, -1), SIZE, ImageChange(turn=90)),
        (lambda image: np.rot90(image, 1), SIZE, ImageChange(turn=270)),
        (lambda image: shrunk(np.rot90(image, -1)), SIZE, ImageChange(turn=90, scale=(0.5, 0.5))),
        (padded(20, 20, 0, 0), SIZE, ImageChange(crop=(0.0, -20.0))),
        (padded(0, 30, 0, 30), SIZE, ImageChange()),
        (padded(0, 8, 0, 0), (256, 200), ImageChange()),  # up to a multiple of 16
        (lambda image: shrunk(image[24:-24]), (256, 240), ImageChange(crop=(0.0, 24.0), scale=(0.5, 0.5))),
        (lambda image: padded(16, 16, 0, 0)(shrunk(image)), SIZE, ImageChange(crop=(0.0, -32.0), scale=(0.5, 0.5))),
    ],
)  # fmt: skip
def test_what_was_done_is_found(change, size, wanted):
    found = settled(seen(change, size))
    assert not found.doubt
    for choice in found.choices:
        assert choice.change.turn == wanted.turn
        np.testing.assert_allclose(choice.change.crop, wanted.crop, atol=0.01)
        np.testing.assert_allclose(choice.change.scale, wanted.scale, atol=1e-9)
    assert "px" in found.told


def test_views_of_different_sizes_are_settled_together():
    changes = [shrunk, shrunk, same, lambda image: np.rot90(image, 1), lambda image: np.rot90(image, 1)]
    turns = [choice.change.turn for choice in settled(seen(changes)).choices]
    scales = [choice.change.scale[0] for choice in settled(seen(changes)).choices]
    assert (turns, scales) == ([0, 0, 0, 270, 270], [0.5, 0.5, 1, 1, 1])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda image: image[5:-19], "silhouettes agree"),  # cut somewhere
        (lambda image: np.zeros_like(image)[12:-12], "too few"),
        (lambda image: image[12:-12, ::-1], "miss each other by"),  # and mirrored
    ],
)
def test_what_no_choice_or_more_than_one_explains_is_refused(change, told):
    with pytest.raises(ValueError, match=told):
        settled(seen(change, TALL))


@pytest.mark.parametrize("view", [None, 0, 3])
@pytest.mark.parametrize(
    ("change", "word", "turn"),
    [
        (lambda image: image[::-1, ::-1], "turned by 180 degrees", 180),
        (lambda image: image[:, ::-1], "mirrored", 0),
        (lambda image: image[::-1], "upside down and mirrored", 0),
    ],
)
def test_turned_and_mirrored_images_are_noticed(change, word, turn, view):
    found = turned_or_mirrored(seen([change if view in (None, other) else same for other in range(VIEWS)]))
    assert f"look {word}" in found.told + found.doubt
    assert ("all images" if view is None else f"cam{view + 1}") in found.told + found.doubt
    assert [choice.change.turn for choice in found.choices] == [
        turn if view in (None, other) else 0 for other in range(VIEWS)
    ]
    assert bool(found.doubt) == (turn == 0)


def test_images_as_they_were_calibrated_are_left_alone():
    found = turned_or_mirrored(seen(same))
    assert (found.told, found.doubt) == ("", "")
    assert all(choice.change == ImageChange() for choice in found.choices)


def test_what_a_person_says_is_done_and_its_figure_told():
    half = ImageChange(scale=(0.5, 0.5))
    assert stated(seen(shrunk), half, range(VIEWS)).doubt == ""
    wrong = stated(seen(shrunk), ImageChange(crop=(90.0, 0.0)), [1, 2])
    assert "do not agree" in wrong.doubt
    assert [choice.change.crop[0] for choice in wrong.choices] == [0, 90, 90, 0, 0]


@pytest.mark.parametrize(
    ("calibrated", "image"), [((640.0, 534.0), (640.0, 480.0)), ((2704.0, 1520.0), (1280.0, 720.0))]
)
def test_no_change_is_offered_twice_and_all_images_have_their_size(calibrated, image):
    offered = choices_for(calibrated, image)
    assert len({choice.change for choice in offered}) == len(offered)
    for choice in offered:
        outer = np.linalg.inv(choice.change.matrix(calibrated)) @ [
            [-0.5, image[0] - 0.5],
            [-0.5, image[1] - 0.5],
            [1, 1],
        ]
        assert (np.ptp(outer, axis=1)[:2] > 0).all()


def test_lines_say_what_was_done():
    calibrated, image = (640.0, 534.0), (640.0, 480.0)
    told = {choice.told: choice.lines(image, calibrated) for choice in choices_for(calibrated, image)}
    assert told["cut or padded on both sides"] == ["crop = [0, 27]"]
    assert told["cut or padded at the right or bottom"] == ["calibrated_size = [640, 534]"]
    assert told["scaled across and down by different factors"] == ["scale = [1, 0.8988764045]"]
    assert told["scaled to fit and padded on both sides"] == ["crop = [-36, 0]", "scale = 0.8988764045"]
