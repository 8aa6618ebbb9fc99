"""Whoever follows the page from Pose2Sim's demo to OpenSim gets there: its commands and its Python run as printed."""

import re
import shlex
import shutil
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest.mock import patch

import cv2
import numpy as np
import pytest
import trc
from support.command_line import jaxskel
from support.real_rigs import filled_up_to_eight
from support.shared_data import SHARED, needs

from jaxskel.io.poses import read_trc

DEMO = SHARED / "real" / "pose2sim_balancing"
pytestmark = [pytest.mark.slow, needs(DEMO)]

PAGE = (Path(__file__).parents[2] / "notebooks" / "from_pose2sim.md").read_text(encoding="utf-8")
SCRIPT, LOADED = re.findall(r"```python\n(.*?)```", PAGE, re.S)
COMMANDS = "".join(re.findall(r"```bash\n(.*?)```", PAGE, re.S)).splitlines()
# Of other programs; what they leave behind is in the folder that the test makes.
OTHERS = [
    "cd Demo_SinglePerson",
    "python -m venv segmenter",
    "segmenter/bin/python -m pip install mediapipe==0.10.21",
    "segmenter/bin/python masks.py",
]
CAMERAS, FRAMES = ("cam01", "cam02", "cam03", "cam04"), 12
# In `Markers_Halpe26.xml` of Pose2Sim 0.10.49.
HALPE_MARKERS = (
    "Nose", "Head", "Neck", "LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist", "Hip", "LHip", "RHip",
    "LKnee", "RKnee", "LAnkle", "RAnkle", "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel",
)  # fmt: skip
# Pose2Sim's names of the joints that mean the same; the palm and the ball of the foot are not among them.
SAME = {"l_elbow": "LElbow", "r_elbow": "RElbow", "l_knee": "LKnee", "r_knee": "RKnee", "l_shoulder": "LShoulder"}


def kept_masks(camera: str) -> np.ndarray:
    with np.load(DEMO / "masks_balance.npz") as kept:
        width = int(kept[f"{camera}_shape"][2])
        return np.unpackbits(kept[camera][:FRAMES], axis=2, count=width)


class KeptSegmenter:
    """Answers as MediaPipe does, by masks that it drew before: a soft mask of the size of the image."""

    cameras = iter(CAMERAS)

    def __init__(self, *, enable_segmentation: bool) -> None:
        assert enable_segmentation
        self.masks = iter(kept_masks(next(self.cameras)))

    def __enter__(self) -> "KeptSegmenter":
        return self

    def __exit__(self, *_: object) -> None:
        assert next(self.masks, None) is None  # all frames were asked for

    def process(self, image: np.ndarray) -> SimpleNamespace:
        mask = next(self.masks).astype(np.float32)
        assert mask.shape == image.shape[:2]
        return SimpleNamespace(segmentation_mask=0.9 * mask)


def cut_film(source: Path, target: Path) -> None:
    """The first frames of a film, at its rate and size."""
    film, out = cv2.VideoCapture(str(source)), None
    for _ in range(FRAMES):
        _, image = film.read()
        out = out or cv2.VideoWriter(str(target), cv2.VideoWriter.fourcc(*"mp4v"), 60.0, image.shape[1::-1])
        out.write(image)
    assert out is not None
    out.release()


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The demo's folder after all commands of the page, and what they printed."""
    folder = tmp_path_factory.mktemp("pose2sim") / "Demo_SinglePerson"
    (folder / "calibration").mkdir(parents=True)
    (folder / "videos").mkdir()
    shutil.copy(DEMO / "Calib.qca.txt", folder / "calibration")
    for camera in CAMERAS:
        cut_film(DEMO / "videos_balance" / f"{camera}.mp4", folder / "videos" / f"{camera}.mp4")
    pose = ModuleType("mediapipe.python.solutions.pose")
    pose.__dict__["Pose"] = KeptSegmenter
    parents = ("mediapipe", "mediapipe.python", "mediapipe.python.solutions")
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(folder)
        with patch.dict(sys.modules, {name: ModuleType(name) for name in parents} | {pose.__name__: pose}):
            exec(SCRIPT, {})
    printed = {}
    with filled_up_to_eight():
        for line in COMMANDS:
            name, *arguments = shlex.split(line)
            if name == "jaxskel":
                printed[line] = jaxskel(*arguments, cwd=folder)
                assert printed[line].returncode == 0, (line, printed[line].stderr)
    return folder, printed


def test_all_other_commands_are_known():
    assert [line for line in COMMANDS if not line.startswith("jaxskel ")] == OTHERS


def test_masks_are_those_of_the_segmenter(followed):
    folder, _ = followed
    for camera in CAMERAS:
        images = sorted((folder / "masks" / camera).iterdir())
        masks = np.stack([cv2.imread(str(image), cv2.IMREAD_GRAYSCALE) for image in images])
        np.testing.assert_array_equal(masks, 255 * kept_masks(camera))


def test_it_says_what_the_page_says(followed):
    folder, printed = followed
    said = {line.split()[1]: " ".join(done.stdout.split()) for line, done in printed.items()}
    assert "cam01, cam02: images are 1080 x 1920 px, calibrated are 1088 x 1920" in said["init"]
    assert (folder / "recording.toml").read_text().count("calibrated_size = [1088, 1920]") == 2
    assert said["check"].endswith("verdict from 8 frames: good")
    stature = re.search(r"stature (\d\.\d\d)", said["run"])
    assert stature is not None
    assert abs(float(stature[1]) - 1.72) < 0.05  # of twelve frames, not of a hundred
    assert f"{FRAMES} frames, {FRAMES} with a pose" in said["run"]
    assert "<html" in (folder / "report.html").read_text(encoding="utf-8")


def test_markers_are_read_by_others_and_near_those_of_pose2sim(followed):
    folder, _ = followed
    data = trc.TRCData()
    data.load(str(folder / "poses" / "demo.trc"))
    assert (data["NumFrames"], data["NumMarkers"], data["DataRate"], data["Units"]) == (FRAMES, 20, 60.0, "m")
    reference = read_trc(DEMO / "Demo_filt_0-100.trc")
    for joint, marker in SAME.items():
        true = reference.positions[:FRAMES, reference.names.index(marker)]
        assert np.median(np.linalg.norm(np.array(data[joint]) - true, axis=1)) < 0.08, joint
    up = {name: np.array(data[name])[:, 1].mean() for name in data["Markers"]}
    assert up["l_toetip"] < up["l_knee"] < up["pelvis"] < up["neck"] < up["head_top"]


def test_keypoints_have_the_names_of_pose2sims_markers(followed):
    folder, _ = followed
    data = trc.TRCData()
    data.load(str(folder / "poses" / "halpe.trc"))
    assert set(HALPE_MARKERS) - set(data["Markers"]) == {
        "Nose", "LHeel", "RHeel", "LSmallToe", "RSmallToe",
    }  # fmt: skip
    assert set(data["Markers"]) <= set(HALPE_MARKERS)


def test_opensim_loads_the_markers(followed, monkeypatch, capsys):
    opensim = pytest.importorskip("opensim")
    opensim.Logger.removeFileSink()
    monkeypatch.chdir(followed[0])
    exec(LOADED, {})
    assert f"{FRAMES} frames of pelvis, neck, head" in capsys.readouterr().out
