"""Cameras of changed images: they see a point where the change moves its old image point."""

import cv2
import numpy as np
import pytest
from support.perturbed_rigs import LENS
from support.phantoms import ring

from jaxskel import make_cameras
from jaxskel.cameras import TURNS, ImageChange, project, with_images_changed

SIZE = (64, 48)
CALIBRATED = (64.0, 48.0)
RNG = np.random.default_rng(0)
POINTS = RNG.uniform(-0.8, 0.8, (200, 3)) + [0, 0, 1]


def lensed(skew: float = 0.0):
    cameras = ring(3, SIZE, 60.0)
    K = np.array(cameras.K)
    K[:, 0, 1] = skew
    return make_cameras(K, cameras.R, cameras.t, cameras.size, np.tile([*LENS, 0.01, 0.02, -0.01, 0.003], (3, 1)))


def changed(cameras, change: ImageChange, size=SIZE):
    return with_images_changed(cameras, [change] * 3, [CALIBRATED] * 3, np.tile(size, (3, 1)))


def moved(change: ImageChange, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The formula of the docstring, by hand."""
    w, h = SIZE
    u, v = {0: (u, v), 90: (h - 1 - v, u), 180: (w - 1 - u, h - 1 - v), 270: (v, w - 1 - u)}[change.turn]
    (x, y), (across, down) = change.crop, change.scale
    return across * (u - x + 0.5) - 0.5, down * (v - y + 0.5) - 0.5


CHANGES = [
    ImageChange(turn, crop, scale)
    for turn in TURNS
    for crop, scale in (((0.0, 0.0), (1.0, 1.0)), ((7.0, -3.5), (1.0, 1.0)), ((-2.0, 5.0), (0.5, 0.75)))
]


@pytest.mark.parametrize("change", CHANGES, ids=str)
@pytest.mark.parametrize("skew", [0.0, 3.0])
def test_a_changed_camera_sees_where_the_change_moves_points(change, skew):
    cameras = lensed(skew)
    u, v, depth = project(cameras, POINTS)
    right, low, far = project(changed(cameras, change), POINTS)
    for found, wanted in zip((right, low), moved(change, np.asarray(u), np.asarray(v)), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)
    np.testing.assert_allclose(far, depth, atol=1e-12)


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_opencv_projects_the_same_with_the_changed_camera(change):
    before, after = lensed(), changed(lensed(), change)
    for c in range(3):
        given, found = (
            cv2.projectPoints(
                POINTS, cv2.Rodrigues(np.asarray(cameras.R[c]))[0], np.asarray(cameras.t[c]), np.asarray(cameras.K[c]),
                np.asarray(cameras.dist[c]),
            )[0][:, 0]
            for cameras in (before, after)
        )  # fmt: skip
        wanted = np.stack(moved(change, given[:, 0], given[:, 1]), 1)
        np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("turn", [90, 180, 270])
def test_turns_are_those_of_images(turn):
    image = np.zeros((SIZE[1], SIZE[0]))
    image[11, 50] = 1  # v = 11, u = 50
    (row,), (column,) = np.nonzero(np.rot90(image, -turn // 90))  # NumPy counts the other way
    there = ImageChange(turn).matrix(CALIBRATED) @ [50, 11, 1]
    np.testing.assert_allclose(there, [column, row, 1])


def test_crop_and_scale_are_those_of_images():
    image = np.zeros((SIZE[1], SIZE[0]), np.float32)
    image[10:14, 20:28] = 1  # its middle is between pixels: u = 23.5, v = 11.5
    cut = image[4:, 6:]
    small = cv2.resize(cut, (cut.shape[1] // 2, cut.shape[0] // 4), interpolation=cv2.INTER_AREA)
    rows, columns = np.nonzero(small)
    there = ImageChange(crop=(6.0, 4.0), scale=(0.5, 0.25)).matrix(CALIBRATED) @ [23.5, 11.5, 1]
    middle = [np.average(columns, weights=small[rows, columns]), np.average(rows, weights=small[rows, columns]), 1]
    np.testing.assert_allclose(there, middle, atol=1e-6)


def test_four_quarter_turns_are_none():
    cameras = lensed(2.0)
    size, turned = CALIBRATED, cameras
    for _ in range(4):
        turned = with_images_changed(turned, [ImageChange(90)] * 3, [size] * 3, np.tile(size[::-1], (3, 1)).astype(int))
        size = size[::-1]
    for field in ("K", "R", "t", "dist", "size"):
        np.testing.assert_allclose(getattr(turned, field), getattr(cameras, field), atol=1e-9)


@pytest.mark.parametrize("turn", [90, 180, 270])
def test_fisheye_lenses_follow_too(turn):
    given = ring(3, SIZE, 60.0)
    lens = np.tile([0.1, -0.02, 0.004, -0.001], (3, 1))
    cameras = make_cameras(given.K, given.R, given.t, given.size, lens, fisheye=np.ones(3, bool))
    u, v, _ = project(cameras, POINTS)
    right, low, _ = project(changed(cameras, ImageChange(turn)), POINTS)
    for found, wanted in zip((right, low), moved(ImageChange(turn), np.asarray(u), np.asarray(v)), strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_sizes_follow_turn_and_scale():
    change = ImageChange(turn=270, scale=(0.5, 2.0))
    assert change.turned_size(CALIBRATED) == (48, 64)
    assert change.size_of_all(CALIBRATED) == (24, 128)
