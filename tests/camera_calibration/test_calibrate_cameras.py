"""Camera poses from pictures of a board, by the library and by the command."""

import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import cv2
import jaxtyping
import numpy as np
import pytest
from support.checkerboards import BOARD, SIZE, SYMMETRIC, column, lenses, off, pictures, rig
from support.shared_data import SHARED

from jaxskel import make_cameras
from jaxskel.camera_calibration.from_boards import Board, Intrinsics, calibrate_cameras
from jaxskel.cameras import compare_rigs
from jaxskel.cli._app import main
from jaxskel.io.calibrations import read_calibration, write_pose2sim_calibration

pytestmark = pytest.mark.slow

UTRECHT = SHARED / "real" / "utrecht_horseman"


@pytest.fixture(scope="module")
def films(tmp_path_factory) -> dict[str, Path]:
    return pictures(tmp_path_factory.mktemp("board"), rig(), BOARD)


@pytest.fixture(scope="module")
def symmetric_films(tmp_path_factory) -> dict[str, Path]:
    return pictures(tmp_path_factory.mktemp("symmetric"), rig(), SYMMETRIC)


def test_cameras_come_back_from_pictures_of_a_board_through_strong_lenses(films):
    found = calibrate_cameras(films, BOARD, lenses(rig()))
    angle, distance = off(found.cameras, rig())
    assert angle < 0.05
    assert distance < 0.002
    assert found.rms.max() < 0.1
    assert found.cameras.names == ("c0", "c1", "c2")
    assert found.turned == ()
    assert found.coverage is None


def test_a_symmetric_board_alone_is_refused_with_how_to_mend_it(symmetric_films):
    with pytest.raises(ValueError, match="looks the same.*give silhouettes.*9 x 6"):
        calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()))


def test_a_person_beside_the_middle_settles_which_end_is_which(symmetric_films):
    found = calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()), column(rig(), (0.5, 0.3)))
    difference = compare_rigs(found.cameras, rig())
    assert np.degrees(difference.angles).max() < 0.05
    assert difference.distances.max() < 0.002
    assert found.coverage is not None
    assert found.coverage > 0.9
    # The same by hand.
    given = calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()), turned_cameras=found.turned)
    assert np.array_equal(given.cameras.R, found.cameras.R)
    # And every camera on the face of the board.
    assert (found.cameras.centres[:, 2] > 1).all()


def test_a_person_in_the_middle_settles_nothing(symmetric_films):
    with pytest.raises(ValueError, match="beside the board's middle"):
        calibrate_cameras(symmetric_films, SYMMETRIC, lenses(rig()), column(rig(), (0.0, 0.0)))


def test_a_film_without_a_board_is_refused_by_camera_and_file(films, tmp_path):
    empty = tmp_path / "empty.png"
    cv2.imwrite(str(empty), np.full((SIZE[1], SIZE[0], 3), 120, np.uint8))
    with pytest.raises(ValueError, match=r"camera c1: .*empty\.png: no board of 7 x 6"):
        calibrate_cameras(films | {"c1": empty}, BOARD, lenses(rig()))
    with pytest.raises(ValueError, match=r"camera c1: .*nowhere\.avi: cannot be opened"):
        calibrate_cameras(films | {"c1": tmp_path / "nowhere.avi"}, BOARD, lenses(rig()))
    text = tmp_path / "text.avi"
    text.write_text("no video")
    with pytest.raises(ValueError, match=r"camera c1: .*text\.avi: is no video"):
        calibrate_cameras(films | {"c1": text}, BOARD, lenses(rig()))


def test_names_sizes_and_lenses_that_do_not_fit_are_refused(films):
    good = lenses(rig())
    with pytest.raises(ValueError, match="two cameras or more"):
        calibrate_cameras({"c0": films["c0"]}, BOARD, good)
    with pytest.raises(ValueError, match="intrinsics: there are none of c2"):
        calibrate_cameras(films, BOARD, {name: good[name] for name in ("c0", "c1")})
    with pytest.raises(ValueError, match="no camera c9"):
        calibrate_cameras(films, BOARD, good, turned_cameras=["c9"])
    with pytest.raises(ValueError, match="camera c0: .*640 x 480.*1280 x 960"):
        calibrate_cameras(films, BOARD, good | {"c0": replace(good["c0"], size=(1280, 960))})
    with pytest.raises(ValueError, match="camera c0: .*fits to"):
        calibrate_cameras(films, BOARD, good | {"c0": replace(good["c0"], dist=np.array([2.0, 0, 0, 0, 0]))})


def command(*arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of `jaxskel calibrate-cameras`."""
    line = ["jaxskel", "--no-cache", "calibrate-cameras", *map(str, arguments)]
    out, err, code = io.StringIO(), io.StringIO(), 0
    unchecked = patch.object(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    with unchecked, patch("sys.argv", line), redirect_stdout(out), redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
    return code, out.getvalue(), err.getvalue()


def test_the_command_writes_a_calibration_that_the_package_reads(films, tmp_path):
    lens, output = tmp_path / "Calib_lens.toml", tmp_path / "calibration.toml"
    write_pose2sim_calibration(lens, rig())
    given = [f"{name}={film}" for name, film in films.items()]
    code, out, err = command(*given, "--board", "7x6", "--square", 0.11, "--intrinsics", lens, "-o", output)
    assert (code, err) == (0, "")
    assert out.splitlines()[-1].startswith(f"{output}: 3 cameras, corners fit to 0.0")
    found = read_calibration(output)
    assert found.cameras.names == rig().names
    angle, distance = off(found.cameras, rig())
    assert angle < 0.05
    assert distance < 0.002


def test_the_command_takes_masks_where_the_board_looks_the_same_turned(symmetric_films, tmp_path):
    lens, output = tmp_path / "Calib_lens.toml", tmp_path / "calibration.toml"
    write_pose2sim_calibration(lens, rig())
    person = np.unpackbits(column(rig(), (0.5, 0.3))[0], axis=-1) * np.uint8(255)
    arguments = [f"{name}={film}" for name, film in symmetric_films.items()]
    for name, mask in zip(rig().names, person, strict=True):
        cv2.imwrite(str(tmp_path / f"{name}.png"), mask)
        arguments += ["--mask", f"{name}={tmp_path / name}.png"]
    code, out, err = command(*arguments, "--board", "8x6", "--square", 0.11, "--intrinsics", lens, "-o", output)
    assert (code, err) == (0, "")
    assert "% of the silhouettes" in out
    assert compare_rigs(read_calibration(output).cameras, rig()).distances.max() < 0.002


@pytest.mark.parametrize(
    ("films_given", "board", "told"),
    [
        (["left.png", "right.png"], "7x6", "give CAM=FILE once for each camera"),
        (["a=left.png", "a=right.png"], "7x6", "give CAM=FILE once for each camera"),
        (["a=left.png", "b=right.png"], "7", "--board 7: give inner corners"),
        (["a=left.png", "b=right.png"], "6x6", "two different numbers"),
    ],
)
def test_the_command_refuses_in_one_line(films_given, board, told, tmp_path):
    lens, output = tmp_path / "Calib_lens.toml", tmp_path / "calibration.toml"
    write_pose2sim_calibration(lens, rig())
    code, _, err = command(*films_given, "--board", board, "--square", 0.11, "--intrinsics", lens, "-o", output)
    assert code == 2
    assert told in err
    assert err.count("\n") == 1
    assert not output.exists()


@pytest.mark.skipif(not UTRECHT.exists(), reason="needs real/utrecht_horseman in ../shared/data")
def test_real_cameras_from_a_board_on_the_floor_and_silhouettes():
    names = [f"cam{i}" for i in range(1, 5)]
    with np.load(UTRECHT / "calibration.npz") as given:
        size = tuple(int(n) for n in given["image_size_wh"])
        reference = make_cameras(given["K"], given["R"], given["t_mm"] / 1000, size, given["dist"], names)
        lens = {name: Intrinsics(given["K"][i], given["dist"][i], size) for i, name in enumerate(names)}
    with np.load(UTRECHT / "masks.npz") as archive:
        masks = np.ascontiguousarray(archive["masks_packed"][:, ::200].transpose(1, 0, 2, 3))
    films = {name: UTRECHT / name / "checkerboard.avi" for name in names}
    found = calibrate_cameras(films, Board(8, 6, 0.115), lens, masks)
    assert found.rms.max() < 0.3
    assert found.coverage is not None
    assert found.coverage > 0.95
    # The given extrinsics were found from the same films, to a rms of 0.7 px at worst.
    difference = compare_rigs(found.cameras, reference)
    assert np.degrees(difference.angles).max() < 0.6
    assert difference.distances.max() < 0.04
    assert abs(difference.scale - 1) < 0.01
