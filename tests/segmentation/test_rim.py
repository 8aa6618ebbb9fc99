"""How wide silhouettes are, on a disc that a lens and a codec have blurred."""

import cv2
import numpy as np
import pytest

from jaxskel.segmentation import plate_of
from jaxskel.segmentation._rim import without_thin_air

SIZE, RADIUS, FINER = 120, 40.3, 8


def cover(sharp: float) -> np.ndarray:
    """Share of each pixel that a disc covers, blurred by a Gaussian of this standard deviation (px)."""
    across = (np.arange(SIZE * FINER) + 0.5) / FINER - SIZE / 2
    fine = (across[:, None] ** 2 + across**2 < RADIUS**2).astype(np.float32)
    share = cv2.resize(fine, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(share, (0, 0), sharp) if sharp else share


def filmed(person: tuple[int, int, int], sharp: float, rng: np.random.Generator) -> tuple[list[np.ndarray], np.ndarray]:
    """Some images of the empty scene, and one with a disc before it."""
    room = np.full((SIZE, SIZE, 3), (120.0, 110.0, 100.0)) + 20 * np.sin(np.arange(SIZE) / 9)[:, None, None]
    share = cover(sharp)[..., None]
    scene = share * np.array(person) + (1 - share) * room
    return [_noisy(room, rng) for _ in range(8)], _noisy(scene, rng)


def _noisy(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.clip(np.round(image + rng.normal(0, 1.0, image.shape)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("person", [(60, 70, 200), (230, 230, 235), (20, 15, 10)])
@pytest.mark.parametrize("sharp", [0.0, 0.7, 1.2])
def test_silhouettes_are_as_wide_as_the_person_however_sharp_the_image(person, sharp):
    empty, image = filmed(person, sharp, np.random.default_rng(0))
    found = plate_of(empty, shadows=False).foreground(image)
    middle = cv2.medianBlur(found.astype(np.uint8), 3)
    width = np.sqrt(middle.sum() / np.pi)
    assert abs(width - RADIUS) < 0.25


def test_what_is_left_shows_about_half_of_the_person_at_least():
    share = cover(0.7)
    room, person = np.array([100.0, 0.0, 0.0]), np.array([40.0, 30.0, -20.0])
    seen = (share[..., None] * person + (1 - share[..., None]) * room).astype(np.float32)
    expected = np.broadcast_to(room, seen.shape).astype(np.float32)
    kept = without_thin_air(share > 0.02, seen, np.ascontiguousarray(expected))
    # The colour beside the rim is a little mixed itself.
    assert kept[share >= 0.5].all()
    assert share[kept].min() > 0.4


def test_what_is_too_thin_to_have_a_colour_of_its_own_stays():
    mask = np.zeros((20, 20), bool)
    mask[10:12, 2:18] = True
    image = np.zeros((20, 20, 3), np.float32)
    np.testing.assert_array_equal(without_thin_air(mask, image, image), mask)
