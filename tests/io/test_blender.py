"""BVH in Blender itself, where it is installed: the same joints, and no bone of length zero."""

from typing import Any

import numpy as np
import pytest
from support.acting import acting
from support.poses import points

from jaxskel import JOINT_NAMES
from jaxskel.io.poses import BVH_NAMES, write_bvh


@pytest.fixture(scope="module")
def bpy() -> Any:
    return pytest.importorskip("bpy")


# Blender leaves the file open.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_blender_finds_the_same_joints_and_no_bone_of_length_zero(tmp_path, bpy, capfd):
    poses = acting(12, 30.0)
    path = write_bvh(tmp_path / "act.bvh", poses).path
    capfd.readouterr()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    result = bpy.ops.import_anim.bvh(
        filepath=str(path), global_scale=0.01, axis_forward="-Z", axis_up="Y", use_fps_scale=False, frame_start=1
    )
    assert result == {"FINISHED"}
    said = "".join(capfd.readouterr())
    assert "zero length" not in said
    armature = bpy.context.object
    assert min(bone.length for bone in armature.data.bones) > 0.01
    found = np.empty((12, len(JOINT_NAMES), 3))
    for frame in range(12):
        bpy.context.scene.frame_set(frame + 1)
        bones = bpy.context.evaluated_depsgraph_get().objects[armature.name].pose.bones
        for j, name in enumerate(JOINT_NAMES):
            found[frame, j] = armature.matrix_world @ bones[BVH_NAMES[name]].head
    # Blender has Z up and turns a file whose Y is up about x: (x, y, z) of the file is (x, -z, y).
    file = points(poses, "+Y")[:, : len(JOINT_NAMES)]
    np.testing.assert_allclose(found, np.stack([file[..., 0], -file[..., 2], file[..., 1]], -1), atol=1e-4)
