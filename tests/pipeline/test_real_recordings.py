"""Real recordings, from the original files to poses. These tests are skipped without the shared data."""

import shutil

import cv2
import numpy as np
import pytest
from support.real_rigs import filled_up_to_eight
from support.shared_data import SHARED

from jaxskel import Settings, prepare, reconstruct
from jaxskel.body import JOINT_NAMES
from jaxskel.hull import agreement, carve, reproject
from jaxskel.io.calibrations import write_calibration
from jaxskel.io.poses import read_trc
from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording

REAL = SHARED / "real"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not REAL.is_dir(), reason=f"needs {REAL}, which is not part of the package"),
]

# Markers of the reference at the places of template joints: a hand is its palm, a foot its ball.
MARKERS = {
    "neck": "Neck", "l_shoulder": "LShoulder", "r_shoulder": "RShoulder", "l_elbow": "LElbow", "r_elbow": "RElbow",
    "l_hand": "LWrist", "r_hand": "RWrist", "l_hip": "LHip", "r_hip": "RHip", "l_knee": "LKnee", "r_knee": "RKnee",
    "l_foot": "LBigToe", "r_foot": "RBigToe",
}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def rigs_of_eight():
    with filled_up_to_eight():
        yield


def test_four_cameras_of_pose2sim_from_the_published_calibration_to_joints(tmp_path):
    source = REAL / "pose2sim_balancing"
    for name in ("masks_balance.npz", "Calib_qualisys.toml"):
        shutil.copy(source / name, tmp_path)
    proposal = propose_recording(tmp_path, fps=60.0)
    assert 'camera = "cam_01"' in proposal.text
    assert proposal.text.count("calibrated_size = [1088, 1920]") == 2
    (tmp_path / "recording.toml").write_text(proposal.text)
    recording = read_recording(tmp_path)[::40]
    poses = reconstruct(recording, Settings())
    assert poses.has_pose.all()
    reference = read_trc(source / "Demo_filt_0-100.trc")
    true = reference.positions[recording.frame_index][..., [2, 0, 1]]  # back to z up
    errors = [
        np.median(
            np.linalg.norm(poses.joints[:, JOINT_NAMES.index(joint)] - true[:, reference.names.index(marker)], axis=1)
        )
        for joint, marker in MARKERS.items()
    ]
    assert np.mean(errors) < 0.055
    assert max(errors) < 0.09


def test_a_seated_person_from_raw_videos_is_a_fat_hull_and_no_bold_pose(tmp_path):
    source = REAL / "utrecht_horseman"
    cameras = [f"cam{number}" for number in (1, 2, 3, 4)]
    for name in cameras:
        (tmp_path / name).symlink_to(source / name)
    given = np.load(source / "calibration.npz")
    np.savez(
        tmp_path / "calibration.npz", K=given["K"], R=given["R"], t=given["t_mm"] / 1000, dist=given["dist"],
        size=given["image_size_wh"], camera_names=cameras, up="+Z",
    )  # fmt: skip
    proposal = propose_recording(tmp_path)
    assert proposal.text.count("plate = ") == 4
    # The folders of the films also hold wrong extrinsics.
    (doubt,) = proposal.doubts
    assert doubt == "calibrations calibration.npz, the files in the folders of the views: the first is taken"
    (tmp_path / "recording.toml").write_text(proposal.text.replace("fps", "frames = [0, 12]\nfps", 1))
    recording = read_recording(tmp_path)[::8]
    masks = np.unpackbits(recording.silhouettes, axis=-1, count=644).astype(bool)
    packed = np.load(source / "masks.npz")["masks_packed"][:, :13:8].swapaxes(0, 1)
    theirs = np.unpackbits(packed, axis=-1, count=644).astype(bool)
    shared = (masks & theirs).sum((2, 3)) / (masks | theirs).sum((2, 3))
    # Theirs lie a pixel to the right and below of the outlines in the images, which alone costs 0.06.
    assert shared.min() > 0.88
    prepared = prepare(recording, Settings(), calibrate=False)
    assert prepared.table is not None
    hulls = carve(recording.silhouettes, prepared.table, np.zeros((len(recording), 4), bool), 0)
    for frame in range(len(recording)):
        seen = reproject(hulls, frame, recording.cameras, *masks.shape[2:])
        assert agreement(seen, masks[frame]).coverage.min() > 0.97
    assert (abs(1e3 * hulls.volumes - 207) < 20).all()
    # A frame without a pose, because no body explains person and chair, has a confidence of zero.
    assert reconstruct(recording, Settings()).confidence.mean() < 0.5


@pytest.mark.parametrize("kind", ["png", "avi"])
def test_eight_views_from_images_and_videos_are_the_recording_in_one_file(tmp_path, kind):
    wanted = read_recording(REAL / "vlasic_crane" / "vlasic_crane.npz")[:4]
    write_calibration(tmp_path / "calibration.npz", wanted.cameras, wanted.up)
    masks = np.unpackbits(wanted.silhouettes, axis=-1) * np.uint8(255)
    for camera, name in enumerate(wanted.cameras.names):
        if kind == "png":
            (tmp_path / name).mkdir()
            for frame in range(len(wanted)):
                cv2.imwrite(str(tmp_path / name / f"{frame:06d}.png"), masks[frame, camera])
        else:
            size = masks.shape[3], masks.shape[2]
            video = cv2.VideoWriter(str(tmp_path / f"{name}.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 25.0, size, False)
            for frame in range(len(wanted)):
                video.write(masks[frame, camera])
            video.release()
    (tmp_path / "recording.toml").write_text(propose_recording(tmp_path, fps=25.0).text)
    found = read_recording(tmp_path)
    np.testing.assert_array_equal(found.silhouettes[:], wanted.silhouettes)
    # The poses depend on nothing but these.
    for field in ("K", "R", "t", "dist", "size"):
        np.testing.assert_array_equal(getattr(found.cameras, field), getattr(wanted.cameras, field))
    assert (found.fps, found.up) == (wanted.fps, wanted.up)
