"""Virtual silhouettes: a ball is seen as a disc, all cameras see all voxels, and worlds may be turned."""

import cv2
import numpy as np
import pytest

import jaxskel as js
from jaxskel.cameras import project
from jaxskel.recording import UP_AXES, rotation_to_z_up
from jaxskel.volumes import rendered

RADIUS, SPACING = 0.3, 0.02
MIDDLE = np.array([0.7, -0.4, 1.1])


def ball(around: np.ndarray = MIDDLE) -> tuple[np.ndarray, np.ndarray]:
    """Voxels of a ball, (1, x, y, z), and their origin (m)."""
    origin = around - 0.4 - 0.003  # the middle is no corner of a voxel
    middles = origin[:, None] + SPACING * (np.arange(41) + 0.5)
    x, y, z = np.meshgrid(*(middles - around[:, None]), indexing="ij")
    return (x**2 + y**2 + z**2 < RADIUS**2)[None], origin


def test_a_ball_is_seen_as_a_disc():
    occupied, origin = ball()
    recording = js.virtual_recording(occupied, origin, SPACING)
    cameras, masks = (
        recording.cameras,
        js.unpack_silhouettes(recording.silhouettes, int(recording.cameras.size[0, 0]))[0],
    )
    u, v, _ = project(cameras, MIDDLE[None])
    away = np.linalg.norm(cameras.centres - MIDDLE, axis=1)
    # A cone that touches the ball: the radius in the image near its middle.
    seen = np.asarray(cameras.K)[:, 0, 0] * RADIUS / np.sqrt(away**2 - RADIUS**2)
    for mask, middle, radius in zip(masks, np.concatenate([u, v], 1), seen, strict=True):
        rows, columns = np.nonzero(mask)
        assert np.abs([columns.mean(), rows.mean()] - middle).max() < 1.5  # px; a voxel is 3 px
        assert np.sqrt(mask.sum() / np.pi) == pytest.approx(radius, abs=2.0)
        assert mask[[0, -1]].sum() + mask[:, [0, -1]].sum() == 0


@pytest.mark.parametrize("up", UP_AXES)
def test_silhouettes_do_not_depend_on_the_world(up):
    turn = rotation_to_z_up(up).T  # from z up to this world
    occupied, origin = ball()
    grid_to = np.abs(turn).argmax(1)
    there = occupied.transpose(0, *(1 + grid_to))[(slice(None), *(slice(None, None, int(s)) for s in turn.sum(1)))]
    corners = np.stack([origin, origin + SPACING * 41]) @ turn.T
    one = js.virtual_recording(occupied, origin, SPACING, cameras=3)
    other = js.virtual_recording(there, corners.min(0), SPACING, cameras=3, up=up)
    # Sums of other numbers round differently: single pixels at the outline may.
    assert np.bitwise_count(one.silhouettes ^ other.silhouettes).sum() < 20
    np.testing.assert_allclose(other.cameras.centres, one.cameras.centres @ turn.T, atol=1e-9)


def test_every_camera_sees_every_voxel_of_every_frame():
    occupied, origin = ball()
    far = np.zeros((3, 120, 50, 50), bool)
    far[0, :41, :41, :41], far[2, 79:, 9:, 9:] = occupied[0], occupied[0]
    recording = js.virtual_recording(far, origin, SPACING, cameras=5, fps=12.0, frame_index=[4, 6, 9])
    masks = js.unpack_silhouettes(recording.silhouettes, int(recording.cameras.size[0, 0]))
    for frame in (0, 2):
        u, v, _ = project(recording.cameras, origin + SPACING * (np.argwhere(far[frame]) + 0.5))
        for mask, column, row in zip(masks[frame], np.round(u).astype(int), np.round(v).astype(int), strict=True):
            # Far from the camera a voxel has fewer pixels: its middle may lie a pixel outside.
            near = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8))
            assert near[row, column].all()
    assert not masks[1].any()
    assert recording.frame_index.tolist() == [4, 6, 9]
    assert recording.fps == 12.0


def test_a_large_volume_has_images_of_bounded_size():
    voxels = np.zeros((1, 1500, 2, 2), bool)
    voxels[0, [0, -1]] = True
    assert js.virtual_recording(voxels, np.zeros(3), 0.01, cameras=3).cameras.size.max() <= 2000


def test_nobody_is_black():
    recording = js.virtual_recording(*ball(), SPACING, cameras=3)
    grid = js.hull.VoxelGrid(np.zeros(3), SPACING, (41, 41, 41))
    assert not rendered(np.zeros((0, 3), int), grid, recording.cameras).any()
