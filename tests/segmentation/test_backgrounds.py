"""Colour images to silhouettes, on drawn rooms in which the person is known to the pixel."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.shared_data import SHARED

from jaxskel.segmentation import Cleaning, ColouredBackdrop, Plate, backdrop_of, backdrop_of_colour, plate_of

SIZE = (240, 320)
PERSON = np.zeros(SIZE, bool)
PERSON[60:200, 130:190] = True
# Beside the person, where he stands in the light.
SHADOW = np.zeros(SIZE, bool)
SHADOW[170:215, 195:290] = True
UTRECHT = SHARED / "real" / "utrecht_horseman"


def room() -> np.ndarray:
    """A grey room with a bright wall, a darker floor and a skirting between them, unevenly lit."""
    down, across = np.mgrid[: SIZE[0], : SIZE[1]]
    grey = np.where(down < 120, 170.0, 110.0) - 0.1 * np.abs(across - 160)
    grey[118:124] = 60
    return grey[..., None] * np.array([1.0, 1.0, 1.0])


def filmed(scene: np.ndarray, seed: int, noise: float = 1.5) -> np.ndarray:
    noisy = scene + np.random.default_rng(seed).normal(0, noise, scene.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def with_person(scene: np.ndarray, colour: tuple[float, float, float] = (60.0, 50.0, 120.0)) -> np.ndarray:
    scene = scene.copy()
    scene[PERSON] = colour
    return scene


def share(mask: np.ndarray, of: np.ndarray) -> float:
    return (mask & of).sum() / of.sum()


@pytest.fixture(scope="module")
def plate() -> Plate:
    return plate_of(filmed(room(), seed) for seed in range(30))


def test_a_plate_sees_nobody_in_images_of_the_empty_room(plate):
    for seed in range(3):
        assert not Cleaning().apply(plate.foreground(filmed(room(), seed))).any()
    assert plate.foreground(filmed(room(), 99)).mean() < 1e-4


def test_a_plate_sees_all_of_a_person_and_nothing_else(plate):
    mask = plate.foreground(filmed(with_person(room()), 100))
    assert share(mask, PERSON) == 1
    assert share(mask, ~PERSON) < 1e-4


@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_noise_is_that_of_the_frame_not_that_of_the_plate(plate, noise):
    mask = plate.foreground(filmed(with_person(room()), 100, noise))
    assert share(mask, PERSON) > 0.999
    assert share(mask, ~PERSON) < 1e-3


def test_a_plate_of_one_image_measures_noise_in_the_frames():
    mask = plate_of([filmed(room(), 0, 3.0)]).foreground(filmed(with_person(room()), 1, 3.0))
    assert share(mask, PERSON) > 0.999
    assert share(mask, ~PERSON) < 1e-3


def test_a_shadow_is_background_unless_it_is_asked_for(plate):
    scene = with_person(room())
    scene[SHADOW] *= 0.7
    image = filmed(scene, 101)
    assert share(plate.foreground(image), SHADOW) < 1e-3
    assert share(replace(plate, shadows=False).foreground(image), SHADOW) > 0.999
    assert share(plate.foreground(image), PERSON) == 1


def test_what_is_darker_than_a_shadow_is_the_person(plate):
    scene = room()
    scene[PERSON] *= 0.3  # of the very tint of the wall
    # But for the edges of the skirting: a camera that sways would show them so.
    assert share(plate.foreground(filmed(scene, 102)), PERSON) > 0.99


def test_a_person_of_the_walls_brightness_is_told_by_his_colour(plate):
    scene = room()
    luma = scene[PERSON].copy()
    scene[PERSON] += np.array([-30.0, 0.0, 11.4])  # yellowish, and not brighter
    assert np.abs((scene[PERSON] - luma) @ np.array([0.114, 0.587, 0.299])).max() < 0.1
    assert share(plate.foreground(filmed(scene, 103)), PERSON) > 0.99


@pytest.mark.parametrize("gain", [(0.8, 0.8, 0.8), (1.2, 1.2, 1.2), (0.95, 1.0, 1.1)])
def test_gains_that_the_camera_adapts_change_nothing(plate, gain):
    for scene in (room(), with_person(room())):
        plain = plate.foreground(filmed(scene, 104))
        adapted = plate.foreground(filmed(scene * np.array(gain), 104))
        assert (plain ^ adapted).mean() < 2e-4


def test_lamps_that_are_as_bright_as_can_be_are_background_at_any_exposure():
    scene = room()
    scene[20:40, 40:280] = 400.0
    plate = plate_of(filmed(scene, seed) for seed in range(10))
    for gain in (0.6, 0.8, 1.2):
        assert plate.foreground(filmed(gain * scene, 105)).mean() < 2e-4
    scene[20:40, 150:160] = 100.0
    assert plate.foreground(filmed(0.8 * scene, 105))[20:40, 150:160].all()


def test_a_median_over_time_removes_a_person_who_walks_through():
    images = []
    for step in range(40):
        scene = room()
        scene[60:200, 7 * step : 7 * step + 60] = (60.0, 50.0, 120.0)
        images.append(filmed(scene, step))
    plate = plate_of(images)
    assert np.abs(plate.mean - room()).max() < 3
    mask = plate.foreground(images[20])
    assert mask[60:200, 140:200].all()
    assert mask.sum() - 140 * 60 < 1e-3 * mask.size


def test_a_plate_of_a_long_video_keeps_few_images_spread_over_all_of_it():
    # Brighter and brighter: the mean of all is in the middle, of the first ones it would be dark.
    plate = plate_of(np.full((4, 4, 3), level, np.uint8) for level in range(40, 240))
    assert np.abs(plate.mean - 139.5).max() < 4


def test_images_that_do_not_fit_are_refused(plate):
    with pytest.raises(ValueError, match="at least one image"):
        plate_of([])
    with pytest.raises(ValueError, match="image 1 has shape"):
        plate_of([np.zeros((4, 4, 3), np.uint8), np.zeros((4, 5, 3), np.uint8)])
    with pytest.raises(ValueError, match="320 x 240"):
        plate.foreground(np.zeros((4, 4, 3), np.uint8))


def studio() -> np.ndarray:
    """Green cloth, half as bright at its corners."""
    down, across = np.mgrid[: SIZE[0], : SIZE[1]]
    light = 1 - 0.5 * np.hypot((down - 120) / 120, (across - 160) / 160) / np.sqrt(2)
    return light[..., None] * np.array([70.0, 170.0, 50.0])


def test_a_backdrop_is_background_in_light_and_shadow():
    scene = with_person(studio(), (90.0, 110.0, 160.0))
    scene[SHADOW] *= 0.6
    image = filmed(scene, 110)
    mask = backdrop_of([image]).foreground(image)
    assert share(mask, PERSON) == 1
    assert share(mask, ~PERSON) < 1e-3


@pytest.mark.parametrize(
    "colour", [(20.0, 20.0, 20.0), (200.0, 200.0, 200.0), (90.0, 110.0, 160.0), (150.0, 60.0, 60.0)]
)
def test_a_backdrops_light_on_a_person_makes_him_no_backdrop(colour):
    # Two fifths of the light that falls on him come from the cloth.
    tinted = np.array(colour) * (0.6 + 0.4 * np.array([70.0, 170.0, 50.0]) / 170)
    mask = backdrop_of([filmed(studio(), 111)]).foreground(filmed(with_person(studio(), tuple(tinted)), 112))
    assert share(mask, PERSON) > 0.999


def test_a_backdrop_is_the_same_learned_and_given():
    learned, given = backdrop_of([filmed(studio(), 113)]), backdrop_of_colour(70, 170, 50)
    assert np.abs(learned.tint - given.tint).max() < 0.02
    image = filmed(with_person(studio(), (90.0, 110.0, 160.0)), 114)
    assert (learned.foreground(image) ^ given.foreground(image)).mean() < 1e-3


def test_a_backdrop_is_learned_past_a_door_in_the_rim():
    scene = studio()
    scene[:, :40] = (120.0, 120.0, 125.0)
    backdrop = backdrop_of([filmed(scene, 115)])
    assert isinstance(backdrop, ColouredBackdrop)
    assert not backdrop.foreground(filmed(studio(), 116)).any()


def test_a_grey_room_is_no_backdrop():
    with pytest.raises(ValueError, match="coloured backdrop"):
        backdrop_of([filmed(room(), 117)])
    with pytest.raises(ValueError, match="too grey"):
        backdrop_of_colour(120, 120, 125)
    with pytest.raises(ValueError, match="none"):
        backdrop_of([])


@pytest.mark.slow
@pytest.mark.skipif(not UTRECHT.exists(), reason="needs real/utrecht_horseman in ../shared/data")
@pytest.mark.parametrize("camera", [1, 2, 3, 4])
def test_a_real_person_before_a_plate_of_another_film(camera):
    plate = plate_of(video(UTRECHT / f"cam{camera}" / "background.avi", 40))
    image = next(video(UTRECHT / f"cam{camera}" / "video.avi", 1))
    with np.load(UTRECHT / "masks.npz") as archive:
        given = np.unpackbits(archive["masks_packed"][camera - 1, 0], axis=1)[:, : image.shape[1]].astype(bool)
    mask = Cleaning().apply(plate.foreground(image))
    # The given masks lie a pixel to the right of the person and below in all four views.
    given = np.roll(given, (-1, -1), (0, 1))
    assert (mask & given).sum() / (mask | given).sum() > 0.92


def video(path: Path, frames: int):
    capture = cv2.VideoCapture(str(path))
    for _ in range(frames):
        there, image = capture.read()
        assert there
        yield image
