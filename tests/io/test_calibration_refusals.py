import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from support.calibration_files import FORMATS, a_rig, sizes_of
from support.refused_calibrations import edited, refused

from jaxskel.io.calibrations import Calibration, read_calibration

SIZES = sizes_of(a_rig(0))


def written(folder: Path, form: str) -> Path:
    return FORMATS[form].write(folder, a_rig(0, FORMATS[form].coefficients))


def line(path: Path, start: str) -> str:
    return next(line for line in path.read_text().splitlines() if line.lstrip().startswith(start))


@pytest.mark.parametrize("form", ["pose2sim", "anipose", "caliscope", "freemocap"])
def test_millimetres_taken_for_metres(form, tmp_path):
    path = written(tmp_path, form)
    assert "m away from the origin; give unit" in refused(path, unit=1000 * (0.001 if form == "freemocap" else 1.0))
    assert "camera cam_1 and all others stand within" in refused(path, unit=1e-6)


def test_a_file_in_millimetres_is_read_with_its_unit(tmp_path):
    path = written(tmp_path, "anipose")
    metres = read_calibration(path)
    path.write_text(re.sub(
        r"translation = \[(.*)\]",
        lambda found: f"translation = {[1000 * float(x) for x in found.group(1).split(',')]}",
        path.read_text(),
    ))  # fmt: skip
    assert "camera cam_1: stands" in refused(path)
    np.testing.assert_allclose(read_calibration(path, unit=0.001).cameras.t, metres.cameras.t, atol=1e-12)


@pytest.mark.parametrize("unit", [0.0, -1.0, float("nan"), float("inf")])
def test_a_unit_that_is_none(unit, tmp_path):
    with pytest.raises(ValueError, match="unit is .*; give metres per unit of the file"):
        read_calibration(written(tmp_path, "pose2sim"), unit=unit)


def test_colmap_has_no_scale(tmp_path):
    assert "COLMAP has no scale" in refused(written(tmp_path, "colmap"))


@pytest.mark.parametrize("form", ["easymocap", "projections"])
def test_a_format_without_image_sizes(form, tmp_path):
    path = written(tmp_path, form)
    assert "camera cam_2: " in refused(path, sizes={name: SIZES[name] for name in SIZES if name != "cam_2"})
    assert "sizes={'cam_1': (width, height)}" in refused(path)


@pytest.mark.parametrize("form", [name for name, form in FORMATS.items() if form.has_size])
def test_images_of_another_size_or_name(form, tmp_path):
    path = written(tmp_path, form)
    unit, (w, h) = FORMATS[form].unit, SIZES["cam_2"]
    assert f"camera cam_2: was calibrated at {w} x {h}, but its images are {h} x {w}" in refused(
        path, unit=unit, sizes=SIZES | {"cam_2": (h, w)}
    )
    assert "camera left: sizes names it, but the file has cam_1, cam_2" in refused(
        path, unit=unit, sizes={"left": (w, h)}
    )
    assert isinstance(read_calibration(path, unit=unit, sizes=SIZES), Calibration)


@pytest.mark.parametrize(
    ("form", "start", "new", "says"),
    [
        ("anipose", "rotation", "rotation = [[1,0,0],[0,1,0],[0,0,1.1]]", "cam_1 .*: R is not a rotation"),
        ("anipose", "rotation", "rotation = [[1,0,0],[0,1,0],[0,0,-1]]", "cam_1 .*: R is a mirror"),
        ("anipose", "rotation", "rotation = [90.0, 0.0, 0.0]", "camera cam_1: rotation is not a rotation vector"),
        ("anipose", "rotation", "rotation = [1.0, 0.0]", "camera cam_1: rotation holds 2 numbers; give 3 or 9"),
        ("anipose", "rotation", "turn = [1.0, 0.0, 0.0]", "camera cam_1: rotation is missing"),
        ("anipose", "translation", "translation = [nan, 0.0, 0.0]", "camera cam_1: translation holds nan"),
        ("anipose", "translation", "translation = [1.0, 0.0, '2']", "camera cam_1: translation holds '2'"),
        ("anipose", "translation", f"translation = [1, 0, 0x{'f' * 3000}]", "holds a number of 12000 bits"),
        ("anipose", "matrix", "matrix = [[0, 0, 1], [0, 9, 1], [0, 0, 1]]", "cam_1 .*: the focal lengths"),
        ("anipose", "distortions", "distortions = [1, 2, 3]", "camera cam_1: 3 distortion coefficients"),
        ("anipose", "fisheye", "fisheye = true", "camera cam_1: is a fisheye lens of 5 .* give the four"),
        ("anipose", "name", 'name = "cam_2"', "camera cam_2: is there twice"),
        ("anipose", "size", "size = [640.5, 480]", "cam_1 .*: size .* whole numbers"),
        ("qualisys", "<transform", '<transform r11="1"/>', "camera cam_1: r12 is missing"),
        ("qualisys", "<fov_video", '<fov_video left="a"/>', "camera cam_1: left holds 'a'"),
        ("qualisys", "<fov_video", "", "camera cam_1: fov_video is missing"),
        ("qualisys", "<camera", '<camera serial="cam_1" video_resolution="540p">', "cam_1: video_resolution 540p"),
        ("vicon", "ORIENTATION", 'ORIENTATION="0 0 0 2"', "camera cam_1: ORIENTATION is not a rotation"),
        ("vicon", "ORIENTATION", "", "camera cam_1: ORIENTATION is missing"),
        ("vicon", "VICON_RADIAL2", 'VICON_RADIAL2="Vicon9Parameter 1"/></KeyFrames></Camera>', "'Vicon9Parameter'"),
        ("vicon", "FOCAL_LENGTH", 'FOCAL_LENGTH="0" PRINCIPAL_POINT="1 1" POSITION="0 0 0"', "FOCAL_LENGTH 0 px"),
    ],
)  # fmt: skip
def test_a_camera_that_is_none(form, start, new, says, tmp_path):
    path = written(tmp_path, form)
    assert re.search(says, refused(edited(path, line(path, start), new)))


def test_a_lens_that_folds_the_image(tmp_path):
    path = written(tmp_path, "vicon")
    path.write_text(re.sub('PIXEL_ASPECT_RATIO="[^"]*"', "", path.read_text()).replace(" 0.0 0.0 0.0", " -1e-5 0 0"))
    assert "camera cam_1: its lens folds the image" in refused(path)


@pytest.mark.parametrize(
    ("name", "old", "new", "says"),
    [
        ("cameras.txt", "FULL_OPENCV", "THIN_PRISM_FISHEYE", "CAMERA_ID 3: has the model THIN_PRISM_FISHEYE"),
        ("cameras.txt", "FULL_OPENCV", "OPENCV", "CAMERA_ID 3: OPENCV holds 14 numbers; give 10"),
        ("cameras.txt", "3 FULL", "2 FULL", "camera cam_1: its CAMERA_ID 3 is not in cameras.txt"),
        ("images.txt", "cam_2/", "cam_1/", "several images of one camera"),
        ("images.txt", " 3 cam_1/0001.jpg", "", "is cut off"),
    ],
)
def test_a_model_of_colmap_that_is_none(name, old, new, says, tmp_path):
    written(tmp_path, "colmap")
    assert says in refused(edited(tmp_path / name, old, new), unit=1.0)


@pytest.mark.parametrize(
    ("form", "file", "start", "new", "says"),
    [
        ("opencv", "cam_1.yml", "rvec:", "ropes: !!opencv-matrix", "camera cam_1: R or rotation_matrix .* is missing"),
        ("opencv", "cam_1.yml", "rvec:", "R: [0, 0, 0]\nrvec: !!opencv-matrix", "R and rvec are both there and differ"),
        ("opencv", "cam_1.yml", "calibration_time", "fisheye_model: 1", "camera cam_1: is a fisheye lens of 8"),
        ("opencv", "cam_1.yml", "image_width", "", "camera cam_1: image_height stands alone"),
        ("opencv", "cam_1.yml", "rows", "   rows: 4", "key 'camera_matrix': claims 4 x 3 numbers but holds 9"),
        ("opencv", "cam_1.yml", "rows", "   rows: .Nan", "key 'camera_matrix': is no matrix"),
        ("opencv", "cam_1.yml", "data", "   data: [ 1., .Nan, 1,", "camera_matrix"),
        ("easymocap", "intri.yml", "- cam_1", "   - cam_7", "camera cam_7: R_cam_7 is missing"),
        ("easymocap", "intri.yml", "names", "things:", "key 'names': is missing"),
        ("easymocap", "extri.yml", "T_cam_1", "S_cam_1: !!opencv-matrix", "camera cam_1: T_cam_1 is missing"),
        ("easymocap", "extri.yml", "data", "   data: [ 0., 0., 0. ]", "R_cam_1 and Rot_cam_1 are different"),
    ],
)
def test_yaml_that_is_no_calibration(form, file, start, new, says, tmp_path):
    written(tmp_path, form)
    path = tmp_path / file
    assert re.search(says, refused(edited(path, line(path, start), new)))


@pytest.mark.parametrize("name", ["a.pickle", "a.pkl", "A.PKL"])
def test_a_pickle_is_refused_by_its_name(name, tmp_path):
    (tmp_path / name).write_bytes(pickle.dumps({"intrinsicMat": np.eye(3)}))
    assert "is a pickle, which can run any program and is never read" in refused(tmp_path / name)


@pytest.mark.parametrize("name", ["a.npz", "a.npy"])
def test_a_pickle_inside_of_an_array_is_refused(name, tmp_path):
    array = np.array([{"K": 1}], object)
    np.savez(tmp_path / name, P=array) if name == "a.npz" else np.save(tmp_path / name, array, allow_pickle=True)
    refused(tmp_path / name)


@pytest.mark.parametrize("name", ["a.xcp", "a.qca.txt"])
def test_xml_with_entities_is_refused_before_it_is_read(name, tmp_path):
    laughs = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(12))
    text = f'<?xml version="1.0"?><!DOCTYPE c [<!ENTITY l0 "ha">{laughs}]><Cameras>&l12;</Cameras>'
    (tmp_path / name).write_text(text)
    assert "has a DOCTYPE" in refused(tmp_path / name)
    (tmp_path / name).write_bytes(text.encode("utf-16"))
    assert "is not text (UTF-8)" in refused(tmp_path / name)


@pytest.mark.parametrize("name", ["a.toml", "a.json", "a.yml", "a.xcp", "a.qca.txt", "a.txt", "a.npy"])
def test_a_file_that_is_too_long(name, tmp_path):
    with open(tmp_path / name, "wb") as file:
        file.truncate((16 << 20) + 1)
    assert "too long for a calibration" in refused(tmp_path / name)


@pytest.mark.parametrize("text", ["a." * 1500 + "a = 1", "[" + "a." * 150 + "a]"])
def test_toml_that_would_take_hours(text, tmp_path):
    (tmp_path / "a.toml").write_text(text)
    assert "is not TOML (a line is too long" in refused(tmp_path / "a.toml")


def test_a_file_of_no_known_format(tmp_path):
    (tmp_path / "a.csv").write_text("1,2")
    assert "is of no known format; these are read: TOML (Pose2Sim" in refused(tmp_path / "a.csv")
    (tmp_path / "folder").mkdir()
    assert "is a folder without a calibration" in refused(tmp_path / "folder")
    (tmp_path / "folder" / "cameras.bin").touch()
    assert "colmap model_converter" in refused(tmp_path / "folder")
    assert "cannot be opened" in refused(tmp_path / "missing.toml")


def test_a_folder_of_two_calibrations(tmp_path):
    written(tmp_path, "colmap")
    written(tmp_path, "easymocap")
    assert "of EasyMocap and of COLMAP" in refused(tmp_path)


@pytest.mark.parametrize("P", [np.zeros((3, 4)), np.ones((3, 4)), np.diag([1e-300, 1e-300, 1e-300, 0])[:3]])
def test_a_projection_matrix_that_is_none(P, tmp_path):
    np.save(tmp_path / "P.npy", P)
    assert "camera cam0: its matrix is no camera" in refused(tmp_path / "P.npy", sizes={"cam0": (4, 4)})
    np.save(tmp_path / "P.npy", P[:2])
    assert "give projection matrices" in refused(tmp_path / "P.npy")
