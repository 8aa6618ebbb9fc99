"""Deviations of tools from their formats: cameras without a pose, unknown sizes, other spellings of names."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.calibration_files import FORMATS, a_rig, easymocap, easymocap_with_size, sizes_of
from support.refused_calibrations import refused

from jaxskel.io.calibrations import choose_views, read_calibration
from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording

RIG = a_rig(20, 5)
SIZES = sizes_of(RIG)


def rewritten(path: Path, pattern: str, new: str, count: int = 0) -> Path:
    text, changes = re.subn(pattern, new, path.read_text(), count=count, flags=re.MULTILINE)
    assert changes
    path.write_text(text)
    return path


@pytest.mark.parametrize("form", ["caliscope", "anipose", "pose2sim", "freemocap"])
@pytest.mark.parametrize("null", [True, False])
def test_a_camera_that_was_not_posed_is_left_out_where_no_view_wants_it(form, null, tmp_path):
    path = FORMATS[form].write(tmp_path, a_rig(20, FORMATS[form].coefficients))
    for key in ("rotation", "translation"):
        rewritten(path, rf"^{key} = .*", f'{key} = "null"' if null else "", count=1)
    # The tables are sorted as text: that of cam_1 is the first.
    found = read_calibration(path)
    assert found.cameras.names == ("cam_2", "cam_9", "cam_10")
    assert found.unposed == ("cam_1",)
    np.testing.assert_allclose(found.cameras.t, RIG.t[1:], atol=1e-9)
    assert choose_views(found, ["cam_9", "cam_2"]).cameras.names == ("cam_9", "cam_2")
    with pytest.raises(ValueError, match="^camera cam_1: was not posed: .* leave out its view"):
        choose_views(found, ["cam_9", "cam_1"])
    told = refused(path, sizes={name: size for name, size in SIZES.items() if name in ("cam_1", "cam_2")})
    assert "camera cam_1: was not posed" in told
    assert ("ignore = true" in told) is (form == "caliscope")


def test_init_says_which_camera_was_not_posed(tmp_path):
    path = FORMATS["caliscope"].write(tmp_path, RIG)
    rewritten(path, r"^(rotation|translation) = .*", r'\1 = "null"', count=2)
    for name, (width, height) in list(SIZES.items())[1:]:
        (tmp_path / "masks" / name).mkdir(parents=True)
        cv2.imwrite(str(tmp_path / "masks" / name / "0.png"), np.eye(height, width, dtype=np.uint8) * 255)
    proposal = propose_recording(tmp_path, fps=25.0)
    assert "camera_array.toml: cam_1 without a pose, left out" in proposal.doubts
    (tmp_path / "recording.toml").write_text(proposal.text.replace("[views.cam_2]", "[views.cam_1]"))
    with pytest.raises(ValueError, match="camera cam_1: was not posed"):
        read_recording(tmp_path)


def test_a_rig_of_which_no_camera_was_posed(tmp_path):
    path = FORMATS["caliscope"].write(tmp_path, RIG)
    rewritten(path, r"^(rotation|translation) = .*", r'\1 = "null"')
    assert "none of its cameras (cam_1, cam_2, cam_9, cam_10) was posed" in refused(path)


def test_a_camera_of_caliscope_without_a_lens_has_no_pose_either(tmp_path):
    path = FORMATS["caliscope"].write(tmp_path, RIG)
    rewritten(path, r"^(matrix|distortions) = .*", r'\1 = "null"', count=2)
    assert "camera cam_1: matrix is missing" in refused(path)
    rewritten(path, r"^(rotation|translation) = .*", r'\1 = "null"', count=2)
    assert read_calibration(path).unposed == ("cam_1",)


@pytest.mark.parametrize(("word", "up"), [("aligned = true", "+Z"), ("groundplane_applied = true", "+Z"),
                                          ("aligned = false", None)])  # fmt: skip
def test_freemocap_2_has_millimetres_and_says_whether_z_is_up(word, up, tmp_path):
    path = FORMATS["freemocap"].write(tmp_path, RIG)
    rewritten(path, r"^\[metadata\][\s\S]*", f"[metadata]\n{word}\n[metadata.board]\nsquare_length_mm = 0.5\n")
    rewritten(path, r"^size = ", "image_size = ")
    found = read_calibration(path)
    assert (found.format, found.up) == ("FreeMoCap TOML", up)
    np.testing.assert_allclose(found.cameras.t, RIG.t, atol=1e-9)
    np.testing.assert_array_equal(found.cameras.size, RIG.size)


def read_easymocap(folder: Path):
    return read_calibration(folder, sizes=SIZES)


def test_easymocap_has_none_before_each_name_where_an_old_opencv_wrote_it(tmp_path):
    easymocap(tmp_path, RIG)
    for name in ("intri.yml", "extri.yml"):
        rewritten(tmp_path / name, r"^( *- )(\"?cam_\d+\"?)$", r"   - none\n\1\2")
    found = read_easymocap(tmp_path).cameras
    assert found.names == RIG.names
    np.testing.assert_allclose(found.t, RIG.t, atol=1e-9)


@pytest.mark.parametrize("sides", ["[WH]", "W", "H"])
@pytest.mark.parametrize("value", ["0", "-1"])
def test_easymocap_has_zero_where_it_did_not_know_the_size(sides, value, tmp_path):
    easymocap_with_size(tmp_path, RIG)
    rewritten(tmp_path / "intri.yml", rf"^({sides}_.*): .*", rf"\1: {value}")
    np.testing.assert_array_equal(read_easymocap(tmp_path).cameras.size, RIG.size)
    assert "camera cam_1: EasyMocap gives no image size here" in refused(tmp_path / "intri.yml")


def test_lenses_of_easymocap_have_two_names_or_none(tmp_path):
    easymocap(tmp_path, RIG)
    rewritten(tmp_path / "intri.yml", "^dist_", "D_")
    np.testing.assert_allclose(read_easymocap(tmp_path).cameras.dist, RIG.dist, atol=1e-12)
    rewritten(tmp_path / "intri.yml", "^D_", "other_")
    assert not read_easymocap(tmp_path).cameras.dist.any()


def test_easymocap_has_a_matrix_under_the_name_of_the_vector(tmp_path):
    easymocap(tmp_path, RIG)
    rewritten(tmp_path / "extri.yml", "^R_", "vector_")
    rewritten(tmp_path / "extri.yml", "^Rot_", "R_")
    np.testing.assert_allclose(read_easymocap(tmp_path).cameras.R, RIG.R, atol=1e-9)


@pytest.mark.parametrize(
    ("listed", "keyed"),
    [(["01", "02", "03", "10"], ["1", "2", "3", "10"]), (["a.mp4", "b.mp4", "c.1.mp4", "d"], ["a", "b", "c", "d"]),
     (["00", "1", "02", "3"], ["0", "1", "2", "3"]), (["x.1", "x.2", "x.3", "x.4"], ["x.1", "x.2", "x.3", "x.4"])],
)  # fmt: skip
def test_keys_of_easymocap_bear_the_names_as_it_reads_them(listed, keyed, tmp_path):
    easymocap(tmp_path, RIG)
    for name in ("intri.yml", "extri.yml"):
        for old, new, key in zip(RIG.names, listed, keyed, strict=True):
            rewritten(tmp_path / name, rf"^( *- )\"?{old}\"?$", rf"\g<1>{new}")
            rewritten(tmp_path / name, rf"_{old}:", f"_{key}:")
    found = read_calibration(tmp_path, sizes=dict(zip(listed, SIZES.values(), strict=True))).cameras
    assert found.names == tuple(listed)
    np.testing.assert_allclose(found.K, RIG.K, atol=1e-9)


def test_names_of_easymocap_may_be_numbers_in_a_line(tmp_path):
    easymocap(tmp_path, RIG)
    for name in ("intri.yml", "extri.yml"):
        rewritten(tmp_path / name, r"^names:[\s\S]*?(?=^\w+_cam)", "names: [ 1, 2, 9, 10 ]\n")
        rewritten(tmp_path / name, r"_cam_(\d+):", r"_\1:")
    found = read_calibration(tmp_path, sizes=dict(zip(("1", "2", "9", "10"), SIZES.values(), strict=True))).cameras
    np.testing.assert_allclose(found.t, RIG.t, atol=1e-9)
