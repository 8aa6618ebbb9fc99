"""TRC: written for OpenSim and read by another reader; reference files; damaged texts."""

from pathlib import Path

import numpy as np
import pytest
import trc
from support.poses import POINT_NAMES, moving, points
from support.shared_data import SHARED

from jaxskel.io.poses import parse_trc, read_trc, with_up, write_trc
from jaxskel.io.poses._markers import to_markers
from jaxskel.recording import UP_AXES

REFERENCE = SHARED / "real" / "pose2sim_balancing"
TENTH_OF_MM = 1e-4


def as_others_read(path: Path) -> trc.TRCData:
    data = trc.TRCData()
    data.load(str(path))
    return data


def as_opensim_reads(path: Path) -> tuple[dict[str, str], list[str], np.ndarray, np.ndarray]:
    """Read by the rules of OpenSim's TRCFileAdapter; any broken rule fails here."""

    def cells(line: str) -> list[str]:
        # A carriage return separates cells too, and an empty cell after the last delimiter does not count.
        found = line.replace("\r", "\t").split("\t")
        return found if found[-1] else found[:-1]

    lines = path.read_bytes().decode().split("\n")
    assert lines[0].split()[0] == "PathFileType"
    keys, values = ([cell for cell in cells(line) if cell] for line in lines[1:3])
    assert (
        keys == "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames".split()
    )
    header = dict(zip(keys, values, strict=True))
    labels = [cell for cell in cells(lines[3]) if cell]
    assert labels[:2] == ["Frame#", "Time"]
    names = labels[2:]
    assert len(names) == int(header["NumMarkers"])
    assert [cell for cell in cells(lines[4]) if cell] == [f"{a}{i + 1}" for i in range(len(names)) for a in "XYZ"]
    rows = [cells(line) for line in lines[5:]]
    rows = rows[next(i for i, row in enumerate(rows) if row and row[0]) :]
    # An empty line ends the data.
    rows = rows[: next(i for i, row in enumerate(rows) if not row)]
    assert {len(row) for row in rows} == {2 + 3 * len(names)}
    numbers = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows])
    return header, names, numbers[:, 1], numbers[:, 2:].reshape(len(rows), len(names), 3)


@pytest.mark.parametrize(("millimetres", "unit", "scale"), [(False, "m", 1.0), (True, "mm", 0.001)])
@pytest.mark.parametrize("fps", [5.0, 29.97, 120.0])
def test_other_readers_find_the_same_points_rate_unit_and_up_axis(tmp_path, fps, millimetres, unit, scale):
    poses = moving(30, fps, without=(0, 7, 8, 29), start=100)
    path = write_trc(tmp_path / "new" / "my poses.trc", poses, millimetres=millimetres)
    expected = points(poses, "+Y")
    data = as_others_read(path)
    assert data["Markers"] == list(POINT_NAMES)
    assert (data["DataRate"], data["Units"], data["NumFrames"]) == (fps, unit, 30)
    assert data["Frame#"] == poses.frame_index.tolist()
    assert data["OrigDataStartFrame"] == 100
    np.testing.assert_allclose(data["Time"], np.arange(30) / fps, atol=1e-8)
    found = np.stack([np.array(data[name]) for name in POINT_NAMES], 1) * scale
    np.testing.assert_allclose(found, expected, atol=TENTH_OF_MM)

    header, names, times, found = as_opensim_reads(path)
    assert names == list(POINT_NAMES)
    assert (float(header["DataRate"]), header["Units"]) == (fps, unit)
    np.testing.assert_allclose(np.diff(times), 1 / fps, atol=1e-8)
    np.testing.assert_allclose(found * scale, expected, atol=TENTH_OF_MM)


@pytest.mark.parametrize("up", UP_AXES)
@pytest.mark.parametrize("before", UP_AXES)
def test_a_world_is_turned_not_mirrored_and_its_up_axis_becomes_the_other(before, up):
    poses = moving(3, up=before)
    turned = with_up(poses, up)

    def heights(of):
        sign, axis = (1 if of.up[0] == "+" else -1), "XYZ".index(of.up[1])
        return sign * of.joints[..., axis]

    assert turned.up == up
    np.testing.assert_array_equal(heights(turned), heights(poses))
    # A mirrored body has its hips, its front and its up in a left-handed order.
    for of in (poses, turned):
        left, spine = of.joints[:, 9] - of.joints[:, 12], of.joints[:, 1] - of.joints[:, 0]
        front = of.tips[:, 3] - of.joints[:, 11]
        assert (np.linalg.det(np.stack([front, left, spine], 1)) > 0).all()
    np.testing.assert_array_equal(with_up(turned, before).joints, poses.joints)


@pytest.mark.parametrize("up", UP_AXES)
@pytest.mark.parametrize("frames", [1, 12])
def test_what_is_written_is_read_again(tmp_path, up, frames):
    poses = moving(frames, up="-X", without=(0,))
    markers = read_trc(write_trc(tmp_path / "poses.trc", poses, up=up), up=up)
    expected = to_markers(with_up(poses, up))
    assert (markers.names, markers.fps, markers.up) == (expected.names, expected.fps, up)
    np.testing.assert_allclose(markers.positions, expected.positions, atol=1e-6)
    np.testing.assert_array_equal(markers.frame_index, expected.frame_index)


def test_nothing_is_left_behind_and_no_frames_are_refused(tmp_path):
    poses = moving(2)
    with pytest.raises(ValueError, match=r"up axis 'Y': give one of \+X"):
        write_trc(tmp_path / "poses.trc", poses, up="Y")
    empty = type(poses)(
        poses.joints[:0], poses.tips[:0], None, None, poses.confidence[:0], poses.side_confidence[:0],
        poses.status[:0], 5.0, "+Z", poses.frame_index[:0],
    )  # fmt: skip
    with pytest.raises(ValueError, match="no frame"):
        write_trc(tmp_path / "poses.trc", empty)
    assert not list(tmp_path.iterdir())


SMALL = "\n".join(
    [
        "PathFileType\t4\t(X/Y/Z)\tsmall.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        "50\t50\t3\t2\tcm\t50\t1\t3",
        "Frame#\tTime\tL.Knee\t\t\tR Knee\t\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\t",
        "",
        "1\t0.00\t10\t20\t30\t40\t50\t60\t",
        "2\t0.02\t11\t\t31\tNaN\tnan\tNaN",
        "3\t0.04",
        "",
    ]
)


def test_a_file_by_hand():
    markers = parse_trc(SMALL)
    assert (markers.names, markers.fps, markers.up) == (("L.Knee", "R Knee"), 50.0, "+Y")
    assert markers.frame_index.tolist() == [1, 2, 3]
    np.testing.assert_allclose(markers.positions[0], [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    # A marker that lacks one coordinate is nowhere.
    assert np.isnan(markers.positions[1:]).all()
    for other in (SMALL.replace("\n", "\r\n"), SMALL.replace("\n", "\r"), SMALL.replace("\n\n", "\n")):
        np.testing.assert_array_equal(parse_trc(other).positions, markers.positions)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("PathFileType", "HIERARCHY", "TRC:1: the line should begin with PathFileType"),
        ("\tOrigNumFrames", "", "TRC:3: 8 values for the 7 names"),
        ("DataRate\tCamera", "Rate\tCamera", "TRC:2: DataRate is missing"),
        ("50\t50\t3", "fast\t50\t3", "TRC:3: DataRate: 'fast' should be a number"),
        ("50\t50\t3", "0\t50\t3", "TRC:3: DataRate is 0"),
        ("cm", "inches", "TRC:3: Units 'inches'; give one of m, cm, mm"),
        ("3\t2\tcm", "3\t5\tcm", "TRC:4: 2 names, but NumMarkers is 5"),
        ("R Knee", "L.Knee", "TRC:4: there is no marker, or two of the same name"),
        ("1\t0.00", "one\t0.00", "TRC:7: 'one' should be the number of a frame"),
        ("1\t0.00", "²\t0.00", "TRC:7: '²' should be the number of a frame"),
        ("\t0.02", "\tsoon", "TRC:8: time: 'soon' should be a number"),
        ("40\t50\t60\t", "40\t50", "TRC:7: 7 cells, where 8 belong to 2 markers; is it cut short"),
        ("40\t50\t60\t", "40\t50\t60\t70", "TRC:7: 9 cells, where 8 belong"),
        ("40\t50\t60\t", "40\tinf\t60\t", "TRC:7: 'inf' should be a number"),
        ("40\t50\t60\t", "40\t1e12\t60\t", "m away; are Units right"),
        ("3\t0.04", "3", "TRC:9: frame 3 has no time"),
    ],
)
def test_damaged_files_are_refused_with_the_line(old, new, message):
    assert old in SMALL
    with pytest.raises(ValueError, match=message) as error:
        parse_trc(SMALL.replace(old, new, 1))
    assert len(str(error.value).splitlines()) == 1


def test_files_cut_short_name_the_file_and_its_end(tmp_path):
    for lines in (0, 1, 3, 5):
        (tmp_path / "cut.trc").write_text("\n".join(SMALL.split("\n")[:lines]))
        with pytest.raises(ValueError, match=r"cut\.trc:\d+: "):
            read_trc(tmp_path / "cut.trc")
    (tmp_path / "cut.trc").write_text("\n".join(SMALL.split("\n")[:6]))
    with pytest.raises(ValueError, match=r"cut\.trc:6: there is no frame"):
        read_trc(tmp_path / "cut.trc")
    with pytest.raises(ValueError, match=r"none\.trc: cannot be opened"):
        read_trc(tmp_path / "none.trc")


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the files of Pose2Sim are not beside this checkout")
@pytest.mark.parametrize("name", ["Demo_0-100", "Demo_filt_0-100", "Standing_for_Scaling"])
def test_files_of_pose2sim_are_read_as_by_others(name):
    path = REFERENCE / f"{name}.trc"
    markers, others = read_trc(path), as_others_read(path)
    assert (markers.names, markers.fps) == (tuple(others["Markers"]), others["DataRate"])
    found = np.stack([np.array(others[name]) for name in markers.names], 1)
    np.testing.assert_array_equal(markers.positions, found)
    # A person, standing: hips over knees over toes, as high as hips are.
    heights = {name: markers.positions[:, i, 1].mean() for i, name in enumerate(markers.names)}
    assert heights["RBigToe"] < heights["RKnee"] < heights["RHip"] < heights["Head"]
    assert 0.7 < heights["RHip"] < 1.1
