"""Files of XML and text that are not calibrations, or incomplete: each is refused in one line."""

import re

import pytest
from support.calibration_files import a_rig
from support.calibration_texts import TEXT_FORMATS, kalibr, opencv_xml_in_folders, totalcapture
from support.refused_calibrations import edited, refused


def test_a_folder_of_opencv_cameras_is_told_of_what_it_lacks(tmp_path):
    rig = a_rig(11)
    opencv_xml_in_folders(tmp_path, rig)
    assert "camera cam_1: OpenCV XML gives no image size here" in refused(tmp_path)
    board = (tmp_path / "board.xml").read_text()
    assert "camera board: camera_matrix is missing" in refused(tmp_path / "board.xml")
    (tmp_path / "cam_9" / "config.xml").write_text(board)
    assert "cam_9/config.xml: holds no camera, as those in the folders beside it do" in refused(tmp_path)
    (tmp_path / "cam_9" / "config.xml").unlink()
    (tmp_path / "cam_2" / "other.xml").write_bytes((tmp_path / "cam_1" / "config.xml").read_bytes())
    assert "cam_2: holds CameraIntrinsicMatrix in several of config.xml, other.xml" in refused(tmp_path)


@pytest.mark.parametrize(
    ("form", "file", "old", "new", "says"),
    [
        ("skeletool", "camera.calibration", "V1.0", "V2.0", "only version V1.0"),
        ("skeletool", "camera.calibration", "animated    0", "animated    1", "camera cam_1: moves"),
        ("skeletool", "camera.calibration", "radial      0", "radial  0.1", "camera cam_1: radial is not 0"),
        ("skeletool", "camera.calibration", "radial      0", "affine 1 0 0", "camera cam_1: is a fisheye lens"),
        ("skeletool", "camera.calibration", "  size ", "  sizes ", "camera cam_1: size is missing"),
        ("skeletool", "camera.calibration", "name  ", "names  ", "before the first name"),
        ("biocv", "cam_1.mp4-mocAligned.calib", "\n\n", " 7\n", "cam_1.mp4.* is no calibration of BioCV"),
        ("middlebury", "temple_par.txt", "4\n", "5\n", "says '5' cameras but has 4"),
        ("metashape", "cameras.xml", 'type="frame"', 'type="fisheye"', "cam_1: its sensor is of the type fisheye"),
        ("metashape", "cameras.xml", "<k1>", "<k4>1</k4><k1>", "camera cam_1: its lens has k4"),
        ("metashape", "cameras.xml", "<scale>0.37", "<scale>1e8", "camera cam_1: stands somewhere on the globe"),
        ("opencv xml", "cam_1.xml", "<cols>3</cols>", "<cols>4</cols>", "'camera_matrix': claims 3 x 4 numbers"),
        ("opencv xml", "cam_1.xml", "<rows>3</rows>", "<rows>x</rows>", "'camera_matrix': is no matrix"),
        ("opencv xml", "cam_1.xml", "calibration_time", "fisheye_model", "cam_1: fisheye_model is 'Thu .*; give 1"),
        ("opencv xml", "cam_1.xml", "translation_vectors", "place", "T or t or .* is missing; .*; there are .*place"),
    ],
)  # fmt: skip
def test_a_file_that_is_none(form, file, old, new, says, tmp_path):
    TEXT_FORMATS[form].write(tmp_path, a_rig(0, TEXT_FORMATS[form].coefficients))
    path = tmp_path / file
    if form == "opencv xml":
        path.write_text(path.read_text().replace(old, new))
    else:
        edited(path, old, new)
    assert re.search(says, refused(path, unit=TEXT_FORMATS[form].unit, sizes=None))


def test_totalcapture_that_is_none(tmp_path):
    path = totalcapture(tmp_path, a_rig(0, 1))
    whole = path.read_text()
    for old, new, says in (
        ("4 1\n", "5 1\n", "claims 5 cameras, 7 lines each, but has 28"),
        ("4 1\n", "4 9\n", "claims 4 cameras with 9 coefficients"),
        ("\n0 ", "\n10 ", "camera cam1: bounds 10 .* are those of a part"),
    ):
        path.write_text(whole)
        assert re.search(says, refused(edited(path, old, new)))


def test_kalibr_with_lenses_that_are_not_read(tmp_path):
    path = kalibr(tmp_path, a_rig(0, 4))
    assert "camera cam0: is of the model omni with radtan" in refused(edited(path, "pinhole", "omni"))
    assert "camera cam1: T_cn_cnm1 is missing" in refused(edited(kalibr(tmp_path, a_rig(0, 4)), "T_cn_cnm1", "T"))


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("notes.txt", b"bring cables\n", "is of no known format; these are read: TOML"),
        ("notes.xml", b"<notes><a/></notes>", "is of no known format; these are read: TOML"),
        ("camera.calibration", b"hello", "is of no known format; these are read: TOML"),
        ("room.cal", bytes(range(256)), "calibrations of Motive before version 3.2 .* are binary"),
        ("a.calib", b"tc camera calibration v0.3\n", "is a calibration of The Captury"),
        ("room.mcal", b"\xff\xfe\x00", "is not text"),
        ("room.mcal", "<calibrationProfile/>".encode("utf-16"), "holds no camera of a calibration by Motive"),
    ],
)
def test_what_is_no_calibration_is_told_so(name, content, says, tmp_path):
    (tmp_path / name).write_bytes(content)
    assert re.search(says, refused(tmp_path / name))
