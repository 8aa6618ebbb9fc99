"""`jaxskel run --template`: one TOML file and no Python, from silhouettes to report and files."""

import numpy as np
import pytest
from support.command_line import jaxskel

import jaxskel as js
from jaxskel.io import read_poses, read_trc
from jaxskel.io.templates import quadruped
from jaxskel.synthetic import make_scene

# 17 joints: the paper's without hands and feet, with wrists, ankles, and two more in the back.
HUMAN_17 = """
described_by = ["head_top", "l_toetip", "r_toetip"]

[joints]
pelvis = { inner = true }
spine = { parent = "pelvis", is = { pelvis = 0.5, neck = 0.5 }, segment = "chest", firmness = 1.0 }
thorax = { parent = "spine", is = { pelvis = 0.2, neck = 0.8 }, segment = "chest" }
neck = { parent = "thorax", segment = "chest", inner = true }
head = { parent = "neck", segment = "head", firmness = 0.5 }
l_shoulder = { parent = "neck", firmness = 3.0, along = false }
l_elbow = { parent = "l_shoulder", firmness = 0.05, bends = "front" }
l_wrist = { parent = "l_elbow", firmness = 0.1 }
r_shoulder = { parent = "neck", firmness = 3.0, along = false }
r_elbow = { parent = "r_shoulder", firmness = 0.05, bends = "front" }
r_wrist = { parent = "r_elbow", firmness = 0.1 }
l_hip = { parent = "pelvis", segment = "pelvis", along = false }
l_knee = { parent = "l_hip", bends = "back" }
l_ankle = { parent = "l_knee" }
r_hip = { parent = "pelvis", segment = "pelvis", along = false }
r_knee = { parent = "r_hip", bends = "back" }
r_ankle = { parent = "r_knee" }

[tips]
head_top = { parent = "head", segment = "head" }
l_fingertip = { parent = "l_wrist" }
r_fingertip = { parent = "r_wrist" }
l_toetip = { parent = "l_ankle" }
r_toetip = { parent = "r_ankle" }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("templates")
    js.io.write_recording(folder / "scene.npz", make_scene(frames=4))
    (folder / "human-17.toml").write_text(HUMAN_17, encoding="utf-8")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_a_human_with_17_joints(folder, preset):
    options = ("--template", "human-17.toml", "--preset", preset)
    done = jaxskel("run", "scene.npz", "-o", preset, *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    poses = read_poses(folder / preset / "poses.npz")
    assert poses.has_pose.all()
    assert poses.joints.shape == (4, 17, 3)
    assert poses.template.name == "human-17"
    truth = js.read_recording(folder / "scene.npz").truth
    for name in ("head", "l_elbow", "r_knee"):
        apart = poses.joints[:, poses.template.joint_names.index(name)] - truth.joints[:, js.JOINT_NAMES.index(name)]
        assert np.median(np.linalg.norm(apart, axis=-1)) < (0.02 if preset == "default" else 0.1)
    scored = jaxskel("evaluate", f"{preset}/poses.npz", "scene.npz", cwd=folder)
    assert scored.returncode == 0, scored.stderr
    assert "all 11" in scored.stdout
    assert jaxskel("report", "scene.npz", f"{preset}/poses.npz", "-o", f"{preset}.html", cwd=folder).returncode == 0
    for name in ("a.trc", "a.c3d", "a.bvh", "a.csv", "angles.csv"):
        made = jaxskel("export", f"{preset}/poses.npz", f"{preset}/{name}", cwd=folder)
        assert made.returncode == 0, made.stderr
    assert read_trc(folder / preset / "a.trc").names == poses.template.point_names


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("hand",), "--template: 'hand' has points that are not on the human body, as the search needs; add --preset"),
        (("horse",), "--template horse: is no file; give a TOML file, or one of human-21, hand, quadruped"),
        (("scene.npz",), "scene.npz: is not TOML"),
    ],
)
def test_templates_that_cannot_be(folder, options, told):
    done = jaxskel("run", "scene.npz", "-o", "none", "--template", *options, cwd=folder)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert told in done.stderr
    assert not (folder / "none").exists()


@pytest.mark.slow
def test_a_quadruped_says_its_size(folder):
    from templates import scene_of

    js.io.write_recording(folder / "dog.npz", scene_of(quadruped(), 3))
    done = jaxskel("run", "dog.npz", "-o", "dog", "--template", "quadruped", "--preset", "paper", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "unknown subject: quadruped, 1." in done.stdout
    assert read_poses(folder / "dog" / "poses.npz").has_pose.all()
    # Its truth goes through the sequence file, and all joints are scored.
    scored = jaxskel("evaluate", "dog/poses.npz", "dog.npz", cwd=folder)
    assert scored.returncode == 0, scored.stderr
    assert "all 18" in scored.stdout
