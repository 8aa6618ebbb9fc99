"""Boards drawn through known lenses: what is measured is the whole way from pixels to where the cameras are."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from jaxskel import Cameras, compare_rigs, make_cameras, pack_silhouettes, project, rays
from jaxskel.boards import (
    Board,
    Intrinsics,
    board_intrinsics,
    calibrate_cameras,
    camera_pose,
    find_corners,
    still_board,
)

BOARD = Board(7, 6, 0.11)
SYMMETRIC = Board(8, 6, 0.11)
SIZE = (640, 480)
LENS = (-0.36, 0.18, 5e-4, -3e-4, -0.05)
UTRECHT = Path(__file__).parents[2] / "shared" / "data" / "real" / "utrecht_horseman"


def rig(angles=(20.0, 110.0, 250.0)) -> Cameras:
    """Cameras at 3 m, 1.5 m above the board, that look at a person above it."""
    R, t = [], []
    for angle in np.radians(angles):
        centre = np.array([3 * np.cos(angle), 3 * np.sin(angle), 1.5])
        forward = np.array([0.0, 0.0, 0.5]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        R.append(np.stack([right, np.cross(forward, right), forward]))
        t.append(-R[-1] @ centre)
    n = len(angles)
    K = np.tile([[520.0, 0, 325], [0, 524, 236], [0, 0, 1]], (n, 1, 1))
    return make_cameras(K, R, t, SIZE, np.tile(LENS, (n, 1)), names=[f"c{i}" for i in range(n)])


def lenses(cameras: Cameras) -> dict[str, Intrinsics]:
    return {
        name: Intrinsics(np.asarray(cameras.K[i]), np.asarray(cameras.dist[i]), SIZE)
        for i, name in enumerate(cameras.names)
    }


def picture(cameras: Cameras, view: int, board: Board, blur: float = 0.7, seed: int = 0) -> np.ndarray:
    """The board on a grey floor, its first square black, with a white rim; four by four samples a pixel, and noise."""
    u, v = np.meshgrid(np.arange(SIZE[0], dtype=float), np.arange(SIZE[1], dtype=float))
    directions = rays(cameras, view, np.stack([u.ravel(), v.ravel()], -1)).reshape(SIZE[1], SIZE[0], 3)
    centre = cameras.centres[view]
    depth = np.where(directions[..., 2] < -1e-3, -centre[2] / directions[..., 2], np.nan)
    floor = (centre + depth[..., None] * directions)[..., :2] / board.square
    floor = cv2.resize(np.nan_to_num(floor, nan=1e3), None, fx=4, fy=4, interpolation=cv2.INTER_LINEAR)
    square = np.floor(floor + (np.array([board.columns, board.rows]) - 1) / 2)
    inside = ((square >= -1) & (square < [board.columns, board.rows])).all(-1)
    paper = ((square >= -1.5) & (square < np.array([board.columns, board.rows]) + 0.5)).all(-1)
    levels = np.where(inside & (square.sum(-1) % 2 == 0), 30.0, np.where(paper, 220.0, 120.0))
    image = cv2.GaussianBlur(cv2.resize(levels, SIZE, interpolation=cv2.INTER_AREA), (0, 0), blur)
    image = image + np.random.default_rng(seed).normal(0, 1.5, image.shape)
    return np.repeat(np.clip(np.rint(image), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def pictures(folder: Path, cameras: Cameras, board: Board) -> dict[str, Path]:
    films = {}
    for view, name in enumerate(cameras.names):
        films[name] = folder / f"{name}.png"
        cv2.imwrite(str(films[name]), picture(cameras, view, board))
    return films


def video(path: Path, images: list[np.ndarray]) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, SIZE)
    for image in images:
        writer.write(image)
    writer.release()
    return path


def column(cameras: Cameras, foot: tuple[float, float]) -> np.ndarray:
    """Silhouettes of a pillar of a person's size that is wider to one side, packed: one frame."""
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([0.25 * np.cos(angle), 0.15 * np.sin(angle)], -1) + foot
    masks = np.zeros((1, len(cameras), SIZE[1], SIZE[0]), np.uint8)
    for low, high in zip(np.linspace(0, 1.4, 8), np.linspace(0.2, 1.6, 8), strict=True):
        points = np.concatenate([np.pad(ring, ((0, 0), (0, 1)), constant_values=z) for z in (low, high)])
        u, v, _ = (np.asarray(a) for a in project(cameras, points))
        for c in range(len(cameras)):
            outline = cv2.convexHull(np.rint(np.stack([u[c], v[c]], -1)).astype(np.int32))
            cv2.fillConvexPoly(masks[0, c], outline, (1,))
    return pack_silhouettes(masks.astype(bool))


def off(found: Cameras, truth: Cameras) -> tuple[float, float]:
    """Largest error of a rotation (degrees) and of an optical centre (m), in one and the same world."""
    turns = np.einsum("cij,ckj->cik", np.asarray(found.R), np.asarray(truth.R))
    cosine = (np.trace(turns, axis1=1, axis2=2) - 1) / 2
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1))).max()
    return float(angle), float(np.linalg.norm(found.centres - truth.centres, axis=1).max())


@pytest.fixture(scope="module")
def films(tmp_path_factory) -> dict[str, Path]:
    return pictures(tmp_path_factory.mktemp("board"), rig(), BOARD)


@pytest.fixture(scope="module")
def symmetric_films(tmp_path_factory) -> dict[str, Path]:
    return pictures(tmp_path_factory.mktemp("symmetric"), rig(), SYMMETRIC)


def test_cameras_come_back_from_pictures_of_a_board_through_strong_lenses(films):
    found = calibrate_cameras(films, BOARD, lenses(rig()))
    angle, distance = off(found.cameras, rig())
    assert angle < 0.05
    assert distance < 0.002
    assert found.rms.max() < 0.1
    assert found.cameras.names == ("c0", "c1", "c2")
    assert found.turned == ()
    assert found.coverage is None


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


def test_a_symmetric_board_alone_is_refused_with_how_to_mend_it(symmetric_films):
    with pytest.raises(ValueError, match="looks the same.*give silhouettes.*9 x 6"):
        calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()))


def test_a_person_beside_the_middle_settles_which_end_is_which(symmetric_films):
    found = calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()), column(rig(), (0.5, 0.3)))
    difference = compare_rigs(found.cameras, rig())
    assert np.degrees(difference.angles).max() < 0.05
    assert difference.distances.max() < 0.002
    assert found.coverage is not None
    assert found.coverage > 0.9
    # The same by hand.
    given = calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()), turned_cameras=found.turned)
    assert np.array_equal(given.cameras.R, found.cameras.R)
    # And every camera on the face of the board.
    assert (found.cameras.centres[:, 2] > 1).all()


def test_a_person_in_the_middle_settles_nothing(symmetric_films):
    with pytest.raises(ValueError, match="beside the board's middle"):
        calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()), column(rig(), (0.0, 0.0)))


def test_a_film_without_a_board_is_refused_by_camera_and_file(films, tmp_path):
    empty = tmp_path / "empty.png"
    cv2.imwrite(str(empty), np.full((SIZE[1], SIZE[0], 3), 120, np.uint8))
    with pytest.raises(ValueError, match=r"camera c1: .*empty\.png: no board of 7 x 6"):
        calibrate_cameras(films | {"c1": empty}, BOARD, lenses(rig()))
    with pytest.raises(ValueError, match=r"camera c1: .*nowhere\.avi: there is no such file"):
        calibrate_cameras(films | {"c1": tmp_path / "nowhere.avi"}, BOARD, lenses(rig()))
    text = tmp_path / "text.avi"
    text.write_text("no video")
    with pytest.raises(ValueError, match="no video or picture"):
        calibrate_cameras(films | {"c1": text}, BOARD, lenses(rig()))


def test_names_sizes_and_lenses_that_do_not_fit_are_refused(films):
    good = lenses(rig())
    with pytest.raises(ValueError, match="two cameras or more"):
        calibrate_cameras({"c0": films["c0"]}, BOARD, good)
    with pytest.raises(ValueError, match="intrinsics: there are none of c2"):
        calibrate_cameras(films, BOARD, {name: good[name] for name in ("c0", "c1")})
    with pytest.raises(ValueError, match="no camera c9"):
        calibrate_cameras(films, BOARD, good, turned_cameras=["c9"])
    with pytest.raises(ValueError, match="camera c0: .*640 x 480.*1280 x 960"):
        calibrate_cameras(films, BOARD, good | {"c0": replace(good["c0"], size=(1280, 960))})
    with pytest.raises(ValueError, match="camera c0: .*fits to"):
        calibrate_cameras(films, BOARD, good | {"c0": replace(good["c0"], dist=np.array([2.0, 0, 0, 0, 0]))})


@pytest.mark.parametrize("wrong", [(6, 6, 0.1), (2, 5, 0.1), (8, 6, 115.0)])
def test_boards_that_are_none_are_refused(wrong):
    with pytest.raises(ValueError, match="inner corners|squares of"):
        Board(*wrong)


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


@pytest.mark.skipif(not UTRECHT.exists(), reason="needs real/utrecht_horseman in ../shared/data")
def test_real_cameras_from_a_board_on_the_floor_and_silhouettes():
    names = [f"cam{i}" for i in range(1, 5)]
    with np.load(UTRECHT / "calibration.npz") as given:
        size = tuple(int(n) for n in given["image_size_wh"])
        reference = make_cameras(given["K"], given["R"], given["t_mm"] / 1000, size, given["dist"], names)
        lens = {name: Intrinsics(given["K"][i], given["dist"][i], size) for i, name in enumerate(names)}
    with np.load(UTRECHT / "masks.npz") as archive:
        masks = np.ascontiguousarray(archive["masks_packed"][:, ::200].transpose(1, 0, 2, 3))
    films = {name: UTRECHT / name / "checkerboard.avi" for name in names}
    found = calibrate_cameras(films, Board(8, 6, 0.115), lens, masks)
    assert found.rms.max() < 0.3
    assert found.coverage is not None
    assert found.coverage > 0.95
    # The given extrinsics were found from the same films, to a rms of 0.7 px at worst.
    difference = compare_rigs(found.cameras, reference)
    assert np.degrees(difference.angles).max() < 0.6
    assert difference.distances.max() < 0.04
    assert abs(difference.scale - 1) < 0.01
