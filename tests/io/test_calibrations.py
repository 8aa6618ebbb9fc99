import cv2
import numpy as np
import pytest
from support.calibration_files import FORMATS, a_rig, seen_by_opencv, sizes_of, vicon
from support.same_rigs import POINTS, assert_same, read
from support.shared_data import SHARED

from jaxskel.cameras import make_cameras, project
from jaxskel.io.calibrations import (
    choose_views,
    read_calibration,
    write_calibration,
    write_easymocap_calibration,
    write_pose2sim_calibration,
)

REAL = SHARED / "real" / "pose2sim_balancing"

every_format = pytest.mark.parametrize("form", FORMATS.values(), ids=FORMATS.keys())


@every_format
@pytest.mark.parametrize("seed", range(3))
def test_a_file_is_read_as_the_rig_it_was_written_from(form, seed, tmp_path):
    rig = a_rig(seed, form.coefficients)
    calibration = read(form, tmp_path, rig)
    assert_same(calibration.cameras, rig)
    assert (calibration.up, calibration.format) == (form.up, form.format)


@every_format
@pytest.mark.parametrize("seed", range(3, 6))
def test_points_are_seen_where_opencv_sees_them(form, seed, tmp_path):
    rig = a_rig(seed, form.coefficients)
    u, v, _ = project(read(form, tmp_path, rig).cameras, POINTS)
    for i in range(len(rig.names)):
        off = np.stack([u[i], v[i]], 1) - seen_by_opencv(rig, i, POINTS)
        assert np.isfinite(off).all(1).mean() > 0.9
        assert np.nanmax(np.abs(off)) < 1e-3


@every_format
def test_a_calibration_is_the_same_after_conversion(form, tmp_path):
    cameras = read(form, tmp_path, a_rig(11, min(form.coefficients, 5))).cameras
    write_pose2sim_calibration(tmp_path / "out" / "Calib.toml", cameras)
    write_easymocap_calibration(tmp_path / "out", cameras)
    write_calibration(tmp_path / "out" / "rig.npz", cameras, "-Y")
    for name, up in (("Calib.toml", "+Z"), ("intri.yml", "+Z"), ("rig.npz", "-Y")):
        again = read_calibration(tmp_path / "out" / name)
        assert_same(again.cameras, cameras)
        assert again.up == up
    assert not [file for file in (tmp_path / "out").iterdir() if file.name.startswith(".")]


def test_a_rational_lens_goes_through_toml_and_not_into_easymocap(tmp_path):
    rig = a_rig(12)
    cameras = make_cameras(rig.K, rig.R, rig.t, rig.size, rig.dist, rig.names)
    write_pose2sim_calibration(tmp_path / "rig.toml", cameras)
    assert_same(read_calibration(tmp_path / "rig.toml").cameras, cameras)
    with pytest.raises(ValueError, match="camera cam_1: EasyMocap has no lens with k4"):
        write_easymocap_calibration(tmp_path, cameras)
    assert not (tmp_path / "intri.yml").exists()


def test_names_of_any_letters_go_through_toml(tmp_path):
    rig = a_rig(13, 5, 2)
    cameras = make_cameras(rig.K, rig.R, rig.t, rig.size, rig.dist, ('a "b" \\ \x7f\n=', "größer.1"))
    write_pose2sim_calibration(tmp_path / "rig.toml", cameras)
    assert_same(read_calibration(tmp_path / "rig.toml").cameras, cameras)
    with pytest.raises(ValueError, match="rename it"):
        write_easymocap_calibration(tmp_path, cameras)


@pytest.mark.parametrize("radial", [(4e-8, 2e-15, -1e-21), (-6e-8, 3e-15, 0.0), (1e-7, 0.0, 0.0)])
def test_the_lens_of_vicon_takes_seen_pixels_to_those_of_a_pinhole(radial, tmp_path):
    rig = a_rig(14, 0)
    rig.K[:, 1, 1] = rig.K[:, 0, 0]
    u, v, _ = project(read_calibration(vicon(tmp_path, rig, radial)).cameras, POINTS)
    for i in range(len(rig.names)):
        middle = rig.K[i, :2, 2]
        inside = ((u[i] >= 0) & (u[i] < rig.size[i, 0]) & (v[i] >= 0) & (v[i] < rig.size[i, 1])).nonzero()[0]
        assert len(inside) > 100
        seen = np.stack([u[i], v[i]], 1)[inside] - middle
        r2 = (seen**2).sum(1, keepdims=True)
        ideal = seen * (1 + radial[0] * r2 + radial[1] * r2**2 + radial[2] * r2**3) + middle
        np.testing.assert_allclose(ideal, seen_by_opencv(rig, i, POINTS[inside]), atol=1e-3)


# A camera 3 m before the origin and 1 m high, which looks along +Y; its lens is 500 px long, its middle at (320, 240).
AHEAD = {
    "lab.qca.txt": """<calibration><cameras><camera serial="a"><fov_video left="10" top="20" right="649" bottom="499"/>
<transform x="0" y="-3000" z="1000" r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0"/>
<intrinsic focalLengthU="32000" focalLengthV="32000" centerPointU="21120" centerPointV="16640"
radialDistortion1="0" radialDistortion2="0" tangentalDistortion1="0" tangentalDistortion2="0"/></camera>
</cameras></calibration>""",
    "trial.xcp": """<Cameras><Camera DEVICEID="a" SENSOR_SIZE="640 480"><KeyFrames><KeyFrame FOCAL_LENGTH="500"
PRINCIPAL_POINT="320 240" POSITION="0 -3000 1000" ORIENTATION="0.70710678118 0 0 0.70710678118" VICON_RADIAL="0 0"/>
</KeyFrames></Camera></Cameras>""",
    "images.txt": "1 0.70710678118 0.70710678118 0 0 0 1 3 1 a.png\n",
    "P.txt": "CONTOUR\n500 320 0 960\n0 240 -500 1220\n0 1 0 3\n",
}


@pytest.mark.parametrize("name", AHEAD)
def test_a_camera_that_was_drawn_on_paper(name, tmp_path):
    (tmp_path / name).write_text(AHEAD[name])
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 640 480 500 320.5 240.5\n")
    sizes = {"cam0": (640, 480)} if name == "P.txt" else None
    cameras = read_calibration(tmp_path / name, unit=1.0 if name == "images.txt" else None, sizes=sizes).cameras
    np.testing.assert_allclose(cameras.centres, [[0, -3, 1]], atol=1e-9)
    assert cameras.size.tolist() == [[640, 480]]
    # Straight ahead; 30 cm to the right; 30 cm up.
    u, v, depth = project(cameras, np.array([[0, 0, 1], [0.3, 0, 1], [0, 0, 1.3]]))
    np.testing.assert_allclose(u[0], [320, 370, 320], atol=1e-6)
    np.testing.assert_allclose(v[0], [240, 240, 190], atol=1e-6)
    np.testing.assert_allclose(depth, 3, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "lens"),
    [("SIMPLE_PINHOLE 640 480 500 320 240", []), ("PINHOLE 640 480 500 510 320 240", []),
     ("SIMPLE_RADIAL 640 480 500 320 240 0.1", [0.1]), ("RADIAL 640 480 500 320 240 0.1 0.2", [0.1, 0.2]),
     ("OPENCV 640 480 500 510 320 240 0.1 0.2 0.3 0.4", [0.1, 0.2, 0.3, 0.4])],
)  # fmt: skip
def test_images_of_colmap_share_a_lens(model, lens, tmp_path):
    (tmp_path / "cameras.txt").write_text(f"4 {model}\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 0 4 left.png\n\n7 1 0 0 0 1 0 0 4 right.png\n\n")
    cameras = read_calibration(tmp_path, unit=1.0).cameras
    assert cameras.names == ("left", "right")
    for i in range(2):
        assert cameras.K[i, 0, 0] == 500
        assert cameras.K[i, 1, 1] == (510 if "OPENCV" in model or model.startswith("PINHOLE") else 500)
        np.testing.assert_array_equal(cameras.K[i, :2, 2], [319.5, 239.5])
        np.testing.assert_array_equal(cameras.dist[i], lens + [0] * (8 - len(lens)))


@pytest.mark.skipif(not REAL.exists(), reason="needs real/pose2sim_balancing in ../shared/data")
def test_a_recording_of_qualisys_and_its_conversion_by_pose2sim():
    qualisys = read_calibration(REAL / "Calib.qca.txt").cameras
    converted = read_calibration(REAL / "Calib_qualisys.toml").cameras
    published = read_calibration(REAL / "calibration.npz", sizes={f"cam{i}": (1088, 1920) for i in range(4)}).cameras
    for other in (converted, published):
        np.testing.assert_array_equal(qualisys.size, other.size)
        np.testing.assert_allclose(qualisys.K, other.K, rtol=1e-14)
        np.testing.assert_allclose(qualisys.R, other.R, atol=1e-14)
        np.testing.assert_allclose(qualisys.t, other.t, atol=1e-14)
    # Pose2Sim divides the lens's coefficients by 64 as if they were lengths in parts of a pixel.
    np.testing.assert_allclose(qualisys.dist, 64 * np.asarray(converted.dist), rtol=1e-14)


def test_views_choose_their_cameras_in_their_order(tmp_path):
    calibration = read(FORMATS["anipose"], tmp_path, a_rig(15))
    chosen = choose_views(calibration, ["cam_10", "cam_2"])
    assert chosen.cameras.names == ("cam_10", "cam_2")
    np.testing.assert_array_equal(chosen.cameras.K, np.asarray(calibration.cameras.K)[[3, 1]])
    for views in (["cam_2", "Cam1"], ["cam_2", "cam_2"]):
        with pytest.raises(ValueError, match="has cam_1, cam_2, cam_9, cam_10"):
            choose_views(calibration, views)


def test_a_folder_of_opencv_files_is_sorted_by_number_and_quoted_names_are_kept(tmp_path):
    FORMATS["opencv"].write(tmp_path, a_rig(16))
    (tmp_path / "cam_2.yml").write_text((tmp_path / "cam_2.yml").read_text() + 'camera_name: "007"\n')
    assert read_calibration(tmp_path).cameras.names == ("cam_1", "007", "cam_9", "cam_10")
    assert read_calibration(tmp_path / "cam_9.yml").cameras.names == ("cam_9",)


def test_projection_matrices_come_in_several_files(tmp_path):
    rig = a_rig(17, 0)
    P = np.load(FORMATS["projections"].write(tmp_path, rig))
    stack = np.stack([P[name] for name in rig.names])
    np.save(tmp_path / "P.npy", stack)
    np.savez(tmp_path / "stack.npz", P=stack)
    np.savetxt(tmp_path / "P.txt", stack.reshape(-1, 4), fmt="%.17g")
    sizes = {f"cam{i}": size for i, size in enumerate(sizes_of(rig).values())}
    for name in ("P.npy", "stack.npz", "P.txt"):
        cameras = read_calibration(tmp_path / name, sizes=sizes).cameras
        np.testing.assert_allclose(cameras.K, rig.K, rtol=1e-9, atol=1e-7)
        np.testing.assert_allclose(cameras.R, rig.R, atol=1e-9)
        np.testing.assert_allclose(cameras.t, rig.t, atol=1e-9)


def test_opencv_agrees_with_itself_on_what_a_written_easymocap_pair_says(tmp_path):
    rig = a_rig(18, 5)
    write_easymocap_calibration(tmp_path, make_cameras(rig.K, rig.R, rig.t, rig.size, rig.dist, rig.names))
    intri = cv2.FileStorage(str(tmp_path / "intri.yml"), cv2.FILE_STORAGE_READ)
    extri = cv2.FileStorage(str(tmp_path / "extri.yml"), cv2.FILE_STORAGE_READ)
    names = [intri.getNode("names").at(i).string() for i in range(4)]
    assert tuple(names) == rig.names
    for i, name in enumerate(names):
        np.testing.assert_array_equal(intri.getNode(f"K_{name}").mat(), rig.K[i])
        np.testing.assert_array_equal(intri.getNode(f"dist_{name}").mat(), rig.dist[i, None, :5])
        np.testing.assert_array_equal(extri.getNode(f"T_{name}").mat()[:, 0], rig.t[i])
        np.testing.assert_allclose(cv2.Rodrigues(extri.getNode(f"R_{name}").mat())[0], rig.R[i], atol=1e-12)
        assert intri.getNode(f"W_{name}").real() == rig.size[i, 0]
