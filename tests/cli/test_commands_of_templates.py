"""Commands with poses of other skeletons than the paper's human."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.command_line import jaxskel
from support.poses import moving
from support.templates import acting, animal, hand

from jaxskel.io.poses import read_trc, write_poses


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("others")
    for name, poses in (("hand", acting(hand())), ("animal", acting(animal())), ("human", moving(24, 30.0))):
        write_poses(folder / name, poses)
    some = acting(animal())
    write_poses(folder / "near", replace(some, joints=some.joints + np.float32(0.01)))
    return folder


def test_poses_are_evaluated_against_truth_of_their_template(folder):
    done = jaxskel("evaluate", "near/poses.npz", "animal/poses.npz", "-o", "score", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "Not scored" not in done.stdout
    figures = json.loads((folder / "score" / "score.json").read_text())
    assert figures["sides_counted"]["median_mm"] == pytest.approx(1000 * 0.01 * 3**0.5, abs=0.01)
    assert list(figures["sides_counted"]["joints_mm"]) == list(animal().template.joint_names)


def test_joints_that_only_one_has_are_told(folder):
    done = jaxskel("evaluate", "animal/poses.npz", "human/poses.npz", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "Not scored, because only one has it: chest, neck," in " ".join(done.stdout.split())


def test_truth_without_a_common_joint_is_refused_in_one_line(folder):
    done = jaxskel("evaluate", "hand/poses.npz", "human/poses.npz", cwd=folder)
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert "human/poses.npz: score: no joint of the poses (wrist, thumb," in done.stderr


def test_every_kind_of_file_is_written(folder):
    pytest.importorskip("ezc3d")
    files = ("a.trc", "a.sigma.trc", "a.c3d", "a.bvh", "a.csv", "angles.csv", "a.mot", "a.npz")
    done = jaxskel("export", "hand/poses.npz", *files, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert read_trc(folder / "a.trc").names == hand().template.point_names
    done = jaxskel("export", "animal/poses.npz", "b.trc", "b.mot", cwd=folder)
    assert "b.mot: the skeleton of animal/poses.npz has no hinges, so there are no angles; leave it out" in done.stderr
    assert not (folder / "b.trc").exists()


def test_keypoints_of_a_set_are_written(folder):
    done = jaxskel("export", "human/poses.npz", "k.trc", "k.csv", "--keypoints", "HALPE_26", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert {"LWrist", "RBigToe", "Hip"} <= set(read_trc(folder / "k.trc").names)
    assert (folder / "k.csv").read_text().startswith("frame_index,time_s,status,LShoulder_x")


@pytest.mark.parametrize(
    ("poses", "output", "name", "message"),
    [
        ("human", "k.trc", "BODY_26", "--keypoints BODY_26: give one of COCO_17, BODY_25"),
        ("human", "k.bvh", "BODY_25", "k.bvh cannot hold them"),
        ("human", "angles.csv", "BODY_25", "angles.csv cannot hold them"),
        ("hand", "k.trc", "BODY_25", "is of a human, and hand/poses.npz of three-fingered hand"),
    ],
)
def test_keypoints_that_cannot_be_written_are_refused(folder, poses, output, name, message):
    done = jaxskel("export", f"{poses}/poses.npz", output, "--keypoints", name, cwd=folder)
    assert done.returncode != 0
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
