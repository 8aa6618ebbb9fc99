"""Commands that make recordings out of folders, what others do with these, and with recordings of hardly anybody."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from support.command_line import jaxskel
from support.recordings import with_masks
from support.scenes import frames_of_scene

from jaxskel import Status, unpack_silhouettes
from jaxskel.cameras import compare_rigs
from jaxskel.io.calibrations import read_calibration, write_calibration, write_pose2sim_calibration
from jaxskel.io.poses import read_poses
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.synthetic import camera_ring, make_scene


@pytest.fixture(scope="module")
def scene():
    return frames_of_scene(24, slice(None, None, 8))


@pytest.fixture
def folder(tmp_path, scene):
    """Images of the package's scene, with a calibration in two formats, whose cameras have other names."""
    write_pose2sim_calibration(tmp_path / "Calib.toml", scene.cameras)
    write_calibration(tmp_path / "calibration.npz", scene.cameras, scene.up)
    for camera, (width, height) in enumerate(scene.cameras.size.tolist()):
        view = tmp_path / "masks" / f"CAM_{camera:02d}"
        view.mkdir(parents=True)
        masks = unpack_silhouettes(scene.silhouettes[:, camera], width)[:, :height]
        for frame, mask in enumerate(masks):
            cv2.imwrite(str(view / f"{frame}.png"), mask.astype(np.uint8) * 255)
    return tmp_path


def test_init_writes_what_it_found_and_where_it_had_to_choose(folder):
    done = jaxskel("init", folder, "--fps", 25, cwd=folder)
    assert done.returncode == 0, done.stderr
    first, last = done.stdout.strip().splitlines()
    assert first == "check: calibrations Calib.toml, calibration.npz: the first is taken"
    assert last == f"{folder / 'recording.toml'}: 8 views; next: jaxskel check {folder}"
    recording = read_recording(folder)
    assert (len(recording), recording.fps, recording.cameras.names[0]) == (3, 25.0, "CAM_00")


@pytest.mark.parametrize(
    ("options", "why"),
    [((), "give --fps"), (("--fps", 0), "--fps 0: give a positive"), (("--views", "*"), "there are masks/*"),
     (("--calibration", "none.toml"), "none.toml: cannot be opened"),
     (("--fps", 25, "--turn", 45), "'--turn': is 45; give 90, 180 or 270"),
     (("--fps", 25, "--crop", "3"), "'--crop': is 3.0; give [x, y]"),
     (("--fps", 25, "--scale", "half"), "'--scale': is 'half'; give a positive number")],
)  # fmt: skip
def test_init_refuses_what_it_cannot_know(folder, options, why):
    done = jaxskel("init", folder, *options, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert why in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (folder / "recording.toml").exists()


def test_init_takes_the_stated_change_of_the_images(folder):
    done = jaxskel("init", folder, "--fps", 25, "--crop", "-60,0", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "silhouettes do not agree" in done.stdout
    assert (folder / "recording.toml").read_text().count("crop = [-60, 0]  # CHECK: as stated") == 8


def test_init_leaves_alone_what_somebody_wrote_unless_told(folder):
    (folder / "recording.toml").write_text("mine")
    done = jaxskel("init", folder, "--fps", 25, cwd=folder)
    assert done.returncode == 2
    assert "--force" in done.stderr
    assert (folder / "recording.toml").read_text() == "mine"
    assert jaxskel("init", folder, "--fps", 25, "--force", cwd=folder).returncode == 0
    assert len(read_recording(folder)) == 3


@pytest.mark.slow
def test_refined_cameras_can_be_used_in_place_of_the_given_ones(folder):
    jaxskel("init", folder, "--fps", 25, cwd=folder)
    done = jaxskel("refine-cameras", folder, "-o", "refined.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[-1].startswith("refined.toml: 8 cameras from 3 frames, outlines miss by")
    refined, given = read_calibration(folder / "refined.toml").cameras, read_recording(folder).cameras
    assert refined.names == given.names
    assert np.degrees(compare_rigs(refined, given).angles).max() < 0.3


@pytest.mark.parametrize(
    ("options", "why"),
    [(("-o", "refined.yml"), ".toml or .npz"), (("--rotation", 0), "--rotation 0: give"), (("--frames", 0), "frames")],
)
def test_refine_cameras_refuses(folder, options, why):
    jaxskel("init", folder, "--fps", 25, cwd=folder)
    done = jaxskel("refine-cameras", folder, *options, cwd=folder)
    assert done.returncode == 2
    assert why in done.stderr
    assert not list(folder.glob("refined*"))


@pytest.mark.slow
def test_a_world_with_another_axis_up_keeps_it_in_a_file_that_can(folder):
    jaxskel("init", folder, "--fps", 25, cwd=folder)
    text = (folder / "recording.toml").read_text()
    (folder / "recording.toml").write_text(text.replace('up = "+Z"', 'up = "-Y"'))
    done = jaxskel("refine-cameras", folder, "-o", "refined.toml", cwd=folder)
    assert done.returncode == 2
    assert "write a .npz" in done.stderr
    done = jaxskel("refine-cameras", folder, "-o", "refined.npz", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert read_calibration(folder / "refined.npz").up == "-Y"


@pytest.fixture(scope="module")
def lonely(tmp_path_factory) -> Path:
    """Small recordings with hardly anybody in them."""
    folder = tmp_path_factory.mktemp("lonely")
    scene = make_scene(33, cameras=camera_ring(4, size=(160, 120)))
    black = np.zeros_like(scene.silhouettes)
    last, one_view = black.copy(), black.copy()
    last[32], one_view[:, 1] = scene.silhouettes[32], scene.silhouettes[:, 1]
    for name, masks in (("black", black), ("last", last), ("one view", one_view), ("one", scene.silhouettes)):
        write_recording(folder / f"{name}.npz", with_masks(scene, masks)[: 1 if name == "one" else 33])
        done = jaxskel("run", f"{name}.npz", "-o", name, "--preset", "paper", cwd=folder)
        assert done.returncode == (0 if name in ("last", "one") else 1), done.stderr
        assert f"{33 - 32 * (name == 'one')} frames, {int(name in ('last', 'one'))} with a pose" in done.stdout
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["black", "one view", "last", "one"])
def test_every_command_takes_recordings_with_hardly_anybody(lonely, name):
    someone, poses = name in ("last", "one"), f"{name}/poses.npz"
    status = set(read_poses(lonely / poses).status[:32].tolist())
    wanted = {"black": Status.EMPTY, "one view": Status.TOO_FEW_VIEWS, "last": Status.EMPTY, "one": Status.OK}
    assert status == {int(wanted[name])}
    here = f"{name}.npz"
    ends = {
        ("report", here, poses, "-o", f"{name}.html"): 0 if someone else 1,
        ("export", poses, f"{name}.trc", f"{name}.csv"): 0 if someone else 1,
        ("export", poses, f"{name}.bvh"): 0 if someone else 2,
        ("evaluate", poses, here, "-o", f"{name} score"): 0 if someone else 1,
        ("check", here, "-o", f"{name}.png"): 0 if someone else 2,
        ("refine-cameras", here, "-o", f"{name}.toml"): 0 if someone else 2,
        ("calibrate-body", here, "-o", f"{name} subject.toml"): 2,
    }
    for arguments, code in ends.items():
        done = jaxskel(*arguments, cwd=lonely)
        assert (arguments[0], done.returncode, done.stderr) == (arguments[0], code, done.stderr)
        assert ("no frame has a pose" in done.stderr) == (
            not someone and arguments[0] in ("report", "export", "evaluate")
        )
