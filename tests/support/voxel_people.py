"""Voxels of people: hulls carved from silhouettes, as dense arrays."""

import numpy as np

from jaxskel import Recording, Settings, prepare
from jaxskel.hull import VoxelGrid, carve


def carved(recording: Recording, settings: Settings) -> tuple[np.ndarray, VoxelGrid]:
    """Hulls of all frames, (frames, x, y, z), and where they lie, as these settings carve them."""
    table = prepare(recording, settings, calibrate=False).table
    assert table is not None
    hulls = carve(recording.silhouettes[:], table)
    return np.stack([hulls.dense(frame) for frame in range(len(hulls))]), table.grid
