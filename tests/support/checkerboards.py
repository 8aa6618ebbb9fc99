"""Checkerboards drawn through known lenses."""

from pathlib import Path

import cv2
import numpy as np

from jaxskel import Cameras, make_cameras, pack_silhouettes
from jaxskel.camera_calibration.from_boards import Board, Intrinsics
from jaxskel.cameras import project, rays

BOARD = Board(7, 6, 0.11)
SYMMETRIC = Board(8, 6, 0.11)
SIZE = (640, 480)
LENS = (-0.36, 0.18, 5e-4, -3e-4, -0.05)


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
