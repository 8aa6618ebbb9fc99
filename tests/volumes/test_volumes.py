"""Volumes: wrong arguments are refused, and every up axis is turned to z."""

import jaxtyping
import numpy as np
import pytest

import jaxskel as js
from jaxskel.recording import UP_AXES, rotation_to_z_up
from jaxskel.volumes import hulls_of, make_volumes

RIGHT = {"occupied": np.ones((2, 3, 4, 5), bool), "origin": (0.0, 0.0, 0.0), "spacing": 0.02}
# What is wrong, and what the message must say besides the argument's name.
WRONG = {
    "voxels of a path": ({"occupied": "voxels.npz"}, "booleans"),
    "a list of voxels": ({"occupied": [[[[True]]]]}, "NumPy"),
    "voxels of one frame": ({"occupied": np.ones((3, 4, 5), bool)}, "occupied[None]"),
    "a row of voxels": ({"occupied": np.ones(5, bool)}, "(frames, x, y, z)"),
    "voxels that are numbers": ({"occupied": np.ones((2, 3, 4, 5), np.uint8)}, "occupied > 0"),
    "voxels that are probabilities": ({"occupied": np.ones((2, 3, 4, 5))}, "booleans"),
    "no frames": ({"occupied": np.ones((0, 3, 4, 5), bool)}, "at least one"),
    "no voxels": ({"occupied": np.ones((2, 3, 0, 5), bool)}, "at least one"),
    "an origin of one number": ({"origin": 0.0}, "x, y, z"),
    "an origin for each frame": ({"origin": np.zeros((2, 3))}, "x, y, z"),
    "a named origin": ({"origin": "middle"}, "x, y, z"),
    "an origin of millimetres": ({"origin": (-1500.0, -1500.0, 0.0)}, "millimetres"),
    "an origin that is unknown": ({"origin": (0.0, np.nan, 0.0)}, "metres"),
    "a spacing of millimetres": ({"spacing": 15.0}, "metres"),
    "a spacing of a whole number of millimetres": ({"spacing": 15}, "metres"),
    "a spacing along each axis": ({"spacing": (0.02, 0.02, 0.05)}, "no cubes"),
    "no spacing": ({"spacing": None}, "metres"),
    "a named spacing": ({"spacing": "fine"}, "metres"),
    "no edge": ({"spacing": 0.0}, "metres"),
    "an up axis without a sign": ({"up": "Z"}, "+Z"),
    "an up axis as a vector": ({"up": np.array([0, 0, 1])}, "'+Z'"),
    "no frames per second": ({"fps": 0.0}, "positive"),
    "frames per second as text": ({"fps": "30"}, "positive"),
    "numbers of other frames": ({"frame_index": np.arange(3)}, "2 whole numbers"),
    "halves of frames": ({"frame_index": np.array([0.0, 0.5])}, "whole numbers"),
    "a body for a skeleton": ({"skeleton": js.make_body(js.default_adult())}, "Skeleton"),
}


@pytest.fixture(autouse=True)
def as_for_a_user(monkeypatch):
    """Without the tests' checks of kinds and shapes, which would be the first to refuse."""
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)


@pytest.mark.parametrize("call", [js.reconstruct_hulls, js.virtual_recording])
@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_argument_is_named_in_one_line(case, call):
    wrong, hint = WRONG[case]
    with pytest.raises(ValueError, match=r"\A[^\n]*\Z") as refused:
        call(**(RIGHT | wrong))
    assert next(iter(wrong)) in str(refused.value)
    assert hint in str(refused.value)


@pytest.mark.parametrize("cameras", [2, 8.0, True, "all"])
def test_a_wrong_number_of_virtual_cameras(cameras):
    with pytest.raises(ValueError, match=r"\Acameras: [^\n]*3 or more\Z"):
        js.virtual_recording(**RIGHT, cameras=cameras)


def test_nothing_to_render():
    with pytest.raises(ValueError, match=r"\Aoccupied: no voxel [^\n]*\Z"):
        js.virtual_recording(**(RIGHT | {"occupied": np.zeros((2, 3, 4, 5), bool)}))


@pytest.mark.parametrize("up", UP_AXES)
def test_volumes_are_turned_with_their_world(up):
    # Three single voxels, whose middles are known by hand: origin + spacing * (index + 1/2).
    occupied, origin = np.zeros((1, 3, 4, 5), bool), np.array([1.0, -2.0, 0.5])
    indices = np.array([[0, 0, 0], [2, 1, 0], [1, 3, 4]])
    occupied[0, *indices.T] = True
    middles = (origin + 0.1 * (indices + 0.5)) @ rotation_to_z_up(up).T
    hulls = hulls_of(make_volumes(occupied, origin, 0.1, up), np.array([0]))
    order = np.lexsort(middles.T[::-1])
    np.testing.assert_allclose(hulls.centres, middles[order], atol=1e-12)
    assert hulls.inside.all()


def test_frames_are_chosen():
    occupied = np.zeros((3, 2, 2, 2), bool)
    occupied[1, 0, 1, 1] = True
    hulls = hulls_of(make_volumes(occupied, np.zeros(3), 0.1), np.array([1, 2]))
    assert hulls.inside.tolist() == [[True], [False]]
