"""Poses as a dataset in the layout of `movement`, with xarray and with `movement` itself where they are installed."""

import subprocess
import sys
from unittest.mock import patch

import numpy as np
import pytest
from support.poses import POINT_NAMES, moving

from jaxskel.poses import STATUS_NAMES


def test_layout_of_movement():
    pytest.importorskip("xarray")
    poses = moving(12, 25.0, up="+Y", without=(0, 5), start=100)
    dataset = poses.to_xarray()
    assert dataset.position.dims == ("time", "space", "keypoints", "individuals")
    assert dataset.confidence.dims == ("time", "keypoints", "individuals")
    assert dict(dataset.sizes) == {"time": 12, "space": 3, "keypoints": 20, "individuals": 1}
    assert dataset.keypoints.values.tolist() == list(POINT_NAMES)
    assert dataset.attrs == {
        "source_software": "jaxskel", "ds_type": "poses", "fps": 25.0, "time_unit": "seconds", "space_unit": "m",
        "up": "+Y",
    }  # fmt: skip
    knee = dataset.position.sel(keypoints="l_knee", individuals="person")
    np.testing.assert_array_equal(knee.transpose("time", "space").values, poses.joints[:, 10])
    toes = dataset.position.sel(keypoints="r_toetip", individuals="person", space="y")
    np.testing.assert_array_equal(toes.values, poses.tips[:, 4, 1])
    np.testing.assert_array_equal(dataset.confidence.values[:, :15, 0], poses.confidence)
    assert np.isnan(dataset.confidence.values[:, 15:]).all()
    np.testing.assert_allclose(dataset.time, np.arange(12) / 25)
    assert dataset.frame_index.values.tolist() == list(range(100, 112))
    assert dataset.status.values.tolist() == [STATUS_NAMES[status] for status in poses.status]


def test_movement_accepts_it_and_finds_the_speed_of_a_joint():
    kinematics = pytest.importorskip("movement.kinematics")
    validators = pytest.importorskip("movement.validators.datasets")
    poses = moving(30, 30.0)
    dataset = poses.to_xarray()
    validators.ValidPosesInputs.validate(dataset)
    speed = kinematics.compute_speed(dataset.position).sel(keypoints="l_hand", individuals="person").values
    expected = np.linalg.norm(np.gradient(poses.joints[:, 5].astype(np.float64), 1 / 30, axis=0), axis=-1)
    np.testing.assert_allclose(speed, expected, rtol=1e-4, atol=1e-5)


def test_the_missing_extra_is_named():
    with patch.dict(sys.modules, {"xarray": None}), pytest.raises(ImportError, match=r'install "jaxskel\[xarray\]"'):
        moving(2).to_xarray()


def test_xarray_is_loaded_only_where_it_is_used():
    code = "import jaxskel, sys; print('xarray' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"
