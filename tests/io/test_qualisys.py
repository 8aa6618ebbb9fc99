"""Calibrations with Qualisys' elements: sensors, resolutions, hybrid cameras, and Theia3D's."""

import re
from dataclasses import replace

import pytest
from support.calibration_files import a_rig
from support.calibration_texts import qualisys_sensors, theia3d
from support.refused_calibrations import edited, refused
from support.same_rigs import assert_same

from jaxskel.io.calibrations import read_calibration


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
