"""Whether two rigs are the same: their projections are."""

from pathlib import Path

import numpy as np

from jaxskel.cameras import Cameras
from jaxskel.io.calibrations import (
    Calibration,
    read_calibration,
)
from support.calibration_files import Format, Rig, sizes_of

POINTS = np.random.default_rng(7).uniform([-0.8, -0.8, 0.0], [0.8, 0.8, 2.0], (400, 3))


def read(form: Format, folder: Path, rig: Rig) -> Calibration:
    return read_calibration(form.write(folder, rig), unit=form.unit, sizes=None if form.has_size else sizes_of(rig))


def assert_same(cameras: Cameras, other: Cameras | Rig) -> None:
    assert cameras.names == other.names
    np.testing.assert_array_equal(cameras.size, other.size)
    np.testing.assert_allclose(cameras.K, other.K, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(cameras.R, other.R, atol=1e-9)
    np.testing.assert_allclose(cameras.t, other.t, atol=1e-9)
    np.testing.assert_allclose(cameras.dist, other.dist, atol=1e-12)
