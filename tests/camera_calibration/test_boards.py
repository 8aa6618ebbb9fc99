"""Corners, poses and lenses from boards drawn through known lenses."""

import numpy as np
import pytest
from support.checkerboards import BOARD, LENS, SIZE, picture, rig, video

from jaxskel import make_cameras
from jaxskel.camera_calibration.from_boards import Board, board_intrinsics, camera_pose, find_corners, still_board
from jaxskel.cameras import project


def test_corners_are_found_where_they_are_drawn_in_the_order_of_the_board():
    u, v, _ = (np.asarray(a) for a in project(rig(), BOARD.points))
    for view in range(3):
        corners = find_corners(picture(rig(), view, BOARD), BOARD)
        assert corners is not None
        assert np.abs(corners - np.stack([u[view], v[view]], -1)).max() < 0.15


def test_corners_are_found_under_white_that_blooms():
    # Too bright by half: the paper swallows the corners of the squares.
    image = picture(rig(), 0, BOARD, blur=1.5).astype(float)
    bloomed = np.clip(1.8 * image, 0, 255).astype(np.uint8)
    corners = find_corners(bloomed, BOARD)
    assert corners is not None
    assert camera_pose(corners, BOARD, np.asarray(rig().K[0]), np.array(LENS))[2] < 0.1


@pytest.mark.parametrize("seed", range(5))
def test_the_pose_of_a_camera_is_exact_for_exact_corners(seed):
    cameras = rig(np.random.default_rng(seed).uniform(0, 360, 1))
    u, v, _ = (np.asarray(a) for a in project(cameras, BOARD.points))
    R, t, rms = camera_pose(np.stack([u[0], v[0]], -1), BOARD, np.asarray(cameras.K[0]), np.array(LENS))
    assert rms < 1e-5
    assert np.abs(R - cameras.R[0]).max() < 1e-6
    assert np.abs(t - cameras.t[0]).max() < 1e-6


def test_points_of_a_board_are_centred_and_a_square_apart():
    points = Board(4, 3, 0.5).points
    assert points.shape == (12, 3)
    assert np.allclose(points.mean(0), 0)
    assert np.allclose(points[1] - points[0], [0.5, 0, 0])
    assert np.allclose(points[4] - points[0], [0, 0.5, 0])


@pytest.mark.parametrize("wrong", [(6, 6, 0.1), (2, 5, 0.1), (8, 6, 115.0)])
def test_boards_that_are_none_are_refused(wrong):
    with pytest.raises(ValueError, match="inner corners|squares of"):
        Board(*wrong)


@pytest.mark.slow
def test_a_board_at_rest_is_averaged_and_a_moving_one_refused(tmp_path):
    cameras = rig()
    image = picture(cameras, 0, BOARD)
    still = still_board(video(tmp_path / "still.avi", [picture(cameras, 0, BOARD, seed=s) for s in range(3)]), BOARD)
    assert still.frames == 3
    assert 0 < still.spread < 0.2
    assert still.size == SIZE
    moving = [np.roll(image, 2 * step, axis=1) for step in range(5)]
    with pytest.raises(ValueError, match=r"moving\.avi: the board moves by"):
        still_board(video(tmp_path / "moving.avi", moving), BOARD)


@pytest.mark.slow
def test_a_lens_comes_back_from_a_film_of_the_board(tmp_path):
    images = []
    for step in range(10):
        cameras = rig((36.0 * step,))
        # Nearer, so that it fills the image, and off the axis in all directions.
        aside = 0.35 * np.array([np.cos(2.4 * step), np.sin(2.4 * step), 0.0])
        centre = 0.45 * cameras.centres[0] + aside
        cameras = make_cameras(cameras.K, cameras.R, [-np.asarray(cameras.R[0]) @ centre], SIZE, [LENS])
        images.append(picture(cameras, 0, BOARD, seed=step))
    found = board_intrinsics(video(tmp_path / "lens.avi", images), BOARD)
    assert found.size == SIZE
    assert found.rms is not None
    assert found.rms < 0.3
    assert np.abs(found.K - np.asarray(rig().K[0])).max() < 8
    assert abs(found.dist[0] - LENS[0]) < 0.04


def test_a_film_of_an_empty_room_gives_no_lens(tmp_path):
    empty = video(tmp_path / "empty.avi", [np.full((SIZE[1], SIZE[0], 3), 120, np.uint8)])
    with pytest.raises(ValueError, match=r"empty\.avi: .*found in 0"):
        board_intrinsics(empty, BOARD)
