"""Calibrations in XML and text of other tools: read back as the rig that they were made of."""

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from calibration_files import Format, Rig, a_rig, seen_by_opencv, sizes_of
from calibration_files_text import (
    SPELLINGS,
    TEXT_FORMATS,
    biocv,
    kalibr,
    metashape,
    opencv_xml,
    opencv_xml_in_folders,
    qualisys_sensors,
    skeletool,
    theia3d,
    totalcapture,
)
from test_calibration_refusals import edited, refused
from test_calibrations import POINTS, assert_same, read

from jaxskel._camera import project
from jaxskel.io import read_calibration
from jaxskel.io.calibrations import contents_of

every_format = pytest.mark.parametrize("form", TEXT_FORMATS.values(), ids=TEXT_FORMATS.keys())


def assert_seen(path: Path, rig: Rig, **given) -> None:
    """Points are seen where OpenCV sees them with the rig."""
    u, v, _ = project(read_calibration(path, **given).cameras, POINTS)
    for i in range(len(rig.names)):
        off = np.stack([u[i], v[i]], 1) - seen_by_opencv(rig, i, POINTS)
        assert np.isfinite(off).all(1).mean() > 0.9
        assert np.nanmax(np.abs(off)) < 1e-3


@every_format
@pytest.mark.parametrize("seed", range(3))
def test_a_file_is_read_as_the_rig_it_was_made_of(form: Format, seed, tmp_path):
    rig = a_rig(seed, form.coefficients)
    calibration = read(form, tmp_path, rig)
    assert_same(calibration.cameras, rig)
    assert (calibration.up, calibration.format) == (form.up, form.format)


@every_format
def test_points_are_seen_where_opencv_sees_them(form: Format, tmp_path):
    rig = a_rig(5, form.coefficients)
    sizes = None if form.has_size else sizes_of(rig)
    assert_seen(form.write(tmp_path, rig), rig, unit=form.unit, sizes=sizes)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_totalcapture_names_its_cameras_by_number(order, tmp_path):
    rig = a_rig(6, 5)
    rig.dist[:, 2:4] = 0
    rig.dist[:, [1, 4][order - 1 :]] = 0
    assert_same(read_calibration(totalcapture(tmp_path, rig, order)).cameras,
                replace(rig, names=tuple(f"cam{i + 1}" for i in range(4))))  # fmt: skip


def test_kalibr_places_each_camera_by_the_one_before_it(tmp_path):
    rig = a_rig(7, 4)
    R = rig.R @ rig.R[0].T
    expected = replace(rig, names=("cam0", "cam1", "cam2", "cam3"), R=R, t=rig.t - R @ rig.t[0])
    calibration = read_calibration(kalibr(tmp_path, rig))
    assert_same(calibration.cameras, expected)
    assert (calibration.format, calibration.up) == ("Kalibr", None)


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("file_of", ["{}.xml", "{}/config.xml", "{}.yml", "{}/calibration.yml", "{}.json", "{}/a.json"])
def test_opencv_files_in_any_spelling_and_syntax(spelling, file_of, tmp_path):
    rig = a_rig(8)
    assert_same(read_calibration(opencv_xml(tmp_path, rig, spelling, file_of)).cameras, rig)


def test_opencv_xml_says_things_twice_where_they_agree(tmp_path):
    rig = a_rig(9, cams=1)
    path = opencv_xml(tmp_path, rig) / "cam_1.xml"
    turn = "".join(f"{x:.6g} " for x in rig.R[0].ravel())
    more = f'<RotationMatrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>f</dt><data>{turn}</data>'
    edited(path, "</opencv_storage>", f"{more}</RotationMatrix></opencv_storage>")
    assert_same(read_calibration(path).cameras, rig)
    edited(path, turn, "1 0 0 0 1 0 0 0 1")
    assert "camera cam_1: rotation_vectors and RotationMatrix are both there and differ; keep one" in refused(path)


def test_opencv_xml_of_several_channels_and_a_list_for_the_size(tmp_path):
    path = opencv_xml(tmp_path, a_rig(10, cams=1), size=False) / "cam_1.xml"
    text = path.read_text()
    vector = re.search(r"<translation_vectors.*?</translation_vectors>", text, re.DOTALL)[0]  # pyright: ignore
    text = text.replace(vector, vector.replace(">3<", ">1<").replace("<dt>d<", "<dt>3d<"))
    path.write_text(text.replace("</opencv_storage>", "<image_size>\n  640 480</image_size></opencv_storage>"))
    assert read_calibration(path).cameras.size.tolist() == [[640, 480]]


def test_fisheye_lenses_are_marked(tmp_path):
    path = opencv_xml(tmp_path, a_rig(22, 4, 1), "words") / "cam_1.xml"
    lens = re.search(r"<DistortionCoeffs.*</DistortionCoeffs>", path.read_text(), re.DOTALL)[0]  # pyright: ignore
    four = '<dist type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt><data>.1 .2 .3 .4</data></dist>'
    edited(path, lens, f"<fisheye_model>1</fisheye_model>{four}")
    edited(kalibr(tmp_path, a_rig(22, 4)), "radtan", "equidistant")
    for name in ("cam_1.xml", "camchain.yaml"):
        entry = contents_of(tmp_path / name).entries[0]
        assert entry.fisheye
        assert len(entry.dist) == 4


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


def test_opencv_writes_the_parts_of_a_camera_to_two_files(tmp_path):
    rig = a_rig(23)
    opencv_xml(tmp_path, rig, "words", "{}/intrinsics.xml")
    for folder in tmp_path.iterdir():
        text = (folder / "intrinsics.xml").read_text()
        pose = text[text.index("<CameraRotationVecs") :]
        edited(folder / "intrinsics.xml", pose, "</opencv_storage>")
        (folder / "extrinsics.xml").write_text(f'<?xml version="1.0"?>\n<opencv_storage>\n{pose}')
    assert_same(read_calibration(tmp_path).cameras, rig)


@pytest.mark.parametrize(("bins", "rows", "resolution"), [(2, 1088, "540p"), (2, 1440, "720p"), (3, 1440, "480p")])
@pytest.mark.parametrize("in_bins", [False, True])
def test_qualisys_at_a_lower_resolution(bins, rows, resolution, in_bins, tmp_path):
    sensor = a_rig(12, 5)
    sensor.size[:] = 1920, rows
    sensor.K[:, :2, 2] = (960, rows / 2)
    small = replace(sensor, K=sensor.K.copy(), size=sensor.size // bins)
    small.K[:, :2] /= bins
    # The middle of a binned pixel is that of those it is made of.
    small.K[:, :2, 2] += 0.5 / bins - 0.5
    path = qualisys_sensors(tmp_path, sensor, resolution=resolution)
    if in_bins:
        right, bottom = small.size[0] - 1
        path.write_text(re.sub(r'right="1919" bottom="\d+"', f'right="{right}" bottom="{bottom}"', path.read_text()))
    assert_same(read_calibration(path).cameras, small)


def test_qualisys_cropped_to_a_lower_resolution(tmp_path):
    rig = a_rig(13, 5)
    rig.size[:] = 1280, 720
    path = qualisys_sensors(tmp_path, rig, resolution="720p", margin=184)
    largest = '<fov_video_max left="184" top="184" right="1463" bottom="903"/>'
    path.write_text(re.sub("<fov_video_max [^/]*/>", largest, path.read_text()))
    assert_same(read_calibration(path).cameras, rig)


@pytest.mark.parametrize(
    ("rows", "resolution", "says"),
    [(1088, "720p", "720p is neither the sensor's, 1080p, nor half"), (1088, "full", "'full' is none, such as 1080p")],
)
def test_qualisys_at_a_resolution_that_nothing_explains(rows, resolution, says, tmp_path):
    rig = a_rig(14, 5)
    rig.size[:] = 1920, rows
    assert f"camera cam_1: video_resolution {says}" in refused(qualisys_sensors(tmp_path, rig, resolution=resolution))


def test_qualisys_cameras_of_markers_and_hybrids_that_do_not_film_are_left_out(tmp_path):
    rig = a_rig(15, 5)
    rig.size[:] = 1920, 1088
    path = qualisys_sensors(tmp_path, rig, ("Miqus Video", "Miqus Hybrid", "Miqus M3", "Miqus Hybrid"))
    assert read_calibration(path).cameras.names == ("cam_1", "cam_2", "cam_10")
    text = path.read_text()
    path.write_text(re.sub(r'Hybrid"(.*?)1080p', r'Hybrid"\1N/A', text, count=1, flags=re.DOTALL))
    assert read_calibration(path).cameras.names == ("cam_1", "cam_10")


def test_qualisys_that_is_not_calibrated_and_parameters_without_it(tmp_path):
    path = qualisys_sensors(tmp_path, a_rig(16, 5))
    assert "calibrated = false; calibrate the cameras" in refused(
        edited(path, 'calibrated="true"', 'calibrated="false"')
    )
    (tmp_path / "p.xml").write_text("<QTM_Parameters_Ver_1.25><General/></QTM_Parameters_Ver_1.25>")
    assert "<QTM_Parameters_Ver_1.25> holds no element calibration" in refused(tmp_path / "p.xml")


def test_theia_is_never_read_as_qualisys(tmp_path):
    rig = a_rig(17, 5)
    path = theia3d(tmp_path, rig)
    # It may have a field of view too: then the sensor is of its size, and not 64 times as large.
    (width, height), name = rig.size[0], 'viewrotation="0" static_boxes="">'
    fov = f'<fov_video left="0" top="0" right="{width - 1}" bottom="{height - 1}"/>'
    edited(path, name, name + fov)
    assert_same(read_calibration(path).cameras, rig)
    path.write_text(path.read_text().replace(f'sensorMaxU="{width}"', f'sensorMaxU="{64 * width}"', 1))
    assert "counts only some sensors in pixels" in refused(path)
    edited(theia3d(tmp_path, rig), 'centerPointU="', 'centerPointU="99')
    assert "camera cam_1: the middle of its image, 99" in refused(path)


@pytest.mark.parametrize("scale", [0.5, 0.998, 1.0, 40.0])
def test_biocv_at_any_scale(scale, tmp_path):
    rig = a_rig(18, 5)
    assert_same(read_calibration(biocv(tmp_path, rig, scale)).cameras, rig)
    for name in ("cam_2.mp4-mocAligned.calib", "cam_2.AVI-mocAligned2.calib", "cam_2.calib"):
        (tmp_path / "cam_2.mp4-mocAligned.calib").rename(tmp_path / name)
        assert read_calibration(tmp_path / name).cameras.names == ("cam_2",)
        (tmp_path / name).rename(tmp_path / "cam_2.mp4-mocAligned.calib")


def test_metashape_without_a_reference_has_no_scale(tmp_path):
    rig = a_rig(19, 5)
    path = metashape(tmp_path, rig, placed=False)
    assert "Metashape has no scale" in refused(path)
    assert_same(read_calibration(path, unit=1.0).cameras, rig)


# A camera 3 m before the origin and 1 m high, which looks along +Y; its lens is 500 px long, its middle at (320, 240).
DOWN = "1 0 0\n0 0 -1\n0 1 0\n"
AHEAD = {
    "a.calibration": """Skeletool Camera Calibration File V1.0
name a
  sensor 10 10
  size 640 480
  animated 0
  intrinsic 500 0 320 0 0 500 240 0 0 0 1 0 0 0 0 1
  extrinsic 1 0 0 0 0 0 -1 1000 0 1 0 3000 0 0 0 1
  radial 0
""",
    "a.mp4-mocAligned.calib": "640\n480\n500 0 320\n0 500 240\n0 0 1\n\n2 0 0 0\n0 0 -2 2000\n0 2 0 6000\n0 0 0 1\n\n"
    "0 0 0 0 0\n",
    "calibration.cal": f"1 1\n0 479 0 639\n500 500 320 240\n0\n{DOWN}0 1 3\n",
    "a_par.txt": f"1\na.png 500 0 320 0 500 240 0 0 1 {DOWN.replace(chr(10), ' ')} 0 1 3\n",
    "theia.txt": """<calibration><cameras><camera serial="a">
<transform x="0" y="1000" z="3000" r11="1" r12="0" r13="0" r21="0" r22="0" r23="-1" r31="0" r32="1" r33="0"/>
<intrinsic sensorMinU="0" sensorMaxU="640" sensorMinV="0" sensorMaxV="480" focalLengthU="500" focalLengthV="500"
centerPointU="320" centerPointV="240" radialDistortion1="0" radialDistortion2="0" tangentalDistortion1="0"
tangentalDistortion2="0"/></camera></cameras></calibration>""",
    # Its y points up and its z back: they are the world's Z and -Y.
    "room.mcal": """<calibrationProfile><Calibration><Cameras><Camera Serial="a">
<Attributes ImagerPixelWidth="640" ImagerPixelHeight="480"/>
<IntrinsicStandardCameraModel LensCenterX="320" LensCenterY="240" HorizontalFocalLength="500" VerticalFocalLength="500"
k1="0" k2="0" k3="0" TangentialX="0" TangentialY="0"/>
<Extrinsic X="0" Y="-3" Z="1" OrientMatrix0="1" OrientMatrix1="0" OrientMatrix2="0" OrientMatrix3="0" OrientMatrix4="0"
OrientMatrix5="-1" OrientMatrix6="0" OrientMatrix7="1" OrientMatrix8="0"/></Camera></Cameras></Calibration>
</calibrationProfile>""",
    "cameras.xml": """<document><chunk><sensors><sensor id="0" type="frame"><resolution width="640" height="480"/>
<calibration type="frame"><f>500</f><cx>0.5</cx><cy>0.5</cy></calibration></sensor></sensors><cameras>
<camera sensor_id="0" label="a"><transform>1 0 0 0 0 0 1 -6 0 -1 0 2 0 0 0 1</transform></camera></cameras>
<transform><scale>0.5</scale></transform></chunk></document>""",
}


@pytest.mark.parametrize("name", AHEAD)
def test_a_camera_that_was_drawn_on_paper(name, tmp_path):
    (tmp_path / name).write_text(AHEAD[name])
    given = {"unit": 1.0, "sizes": {"a": (640, 480)}} if name == "a_par.txt" else {}
    cameras = read_calibration(tmp_path / name, **given).cameras
    np.testing.assert_allclose(cameras.centres, [[0, -3, 1]], atol=1e-9)
    assert cameras.size.tolist() == [[640, 480]]
    # Straight ahead; 30 cm to the right; 30 cm up.
    u, v, depth = project(cameras, np.array([[0, 0, 1], [0.3, 0, 1], [0, 0, 1.3]]))
    np.testing.assert_allclose(u[0], [320, 370, 320], atol=1e-6)
    np.testing.assert_allclose(v[0], [240, 240, 190], atol=1e-6)
    np.testing.assert_allclose(depth, 3, atol=1e-9)


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


def test_a_calibration_is_known_by_what_it_holds(tmp_path):
    rig = a_rig(20, 0)
    skeletool(tmp_path, rig).rename(tmp_path / "cameras.txt.txt")
    assert read_calibration(tmp_path / "cameras.txt.txt").format == "Skeletool"
    theia3d(tmp_path, rig).rename(tmp_path / "lab.qca.txt")
    assert read_calibration(tmp_path / "lab.qca.txt").format == "Theia3D"
    totalcapture(tmp_path, rig).rename(tmp_path / "calibration")
    assert read_calibration(tmp_path / "calibration").format == "TotalCapture"


def test_opencv_agrees_with_itself_on_what_it_wrote(tmp_path):
    rig = a_rig(21)
    opencv_xml(tmp_path, rig)
    cameras = read_calibration(tmp_path).cameras
    for i, name in enumerate(rig.names):
        file = cv2.FileStorage(str(tmp_path / f"{name}.xml"), cv2.FILE_STORAGE_READ)
        np.testing.assert_array_equal(cameras.K[i], file.getNode("camera_matrix").mat())
        np.testing.assert_array_equal(cameras.t[i], file.getNode("translation_vectors").mat()[:, 0])
