"""Calibrations in XML and text of other tools: read as the rig that they were made from."""

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.calibration_files import Format, Rig, a_rig, seen_by_opencv, sizes_of
from support.calibration_texts import (
    SPELLINGS,
    TEXT_FORMATS,
    biocv,
    kalibr,
    metashape,
    opencv_xml,
    skeletool,
    theia3d,
    totalcapture,
)
from support.refused_calibrations import edited, refused
from support.same_rigs import POINTS, assert_same, read

from jaxskel.cameras import project
from jaxskel.io.calibrations import contents_of, read_calibration

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


def test_opencv_writes_the_parts_of_a_camera_to_two_files(tmp_path):
    rig = a_rig(23)
    opencv_xml(tmp_path, rig, "words", "{}/intrinsics.xml")
    for folder in tmp_path.iterdir():
        text = (folder / "intrinsics.xml").read_text()
        pose = text[text.index("<CameraRotationVecs") :]
        edited(folder / "intrinsics.xml", pose, "</opencv_storage>")
        (folder / "extrinsics.xml").write_text(f'<?xml version="1.0"?>\n<opencv_storage>\n{pose}')
    assert_same(read_calibration(tmp_path).cameras, rig)


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
