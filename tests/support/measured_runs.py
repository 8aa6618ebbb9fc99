"""Runs whose errors are known."""

import _runs
import numpy as np

from jaxskel import JOINT_NAMES, Recording


def run_of_truth(scene: Recording, code: str = "a") -> _runs.Run:
    """The truth as if reconstructed: in frame 1 the left hand 50 mm off, in frame 2 both hands 200 mm, 3 is lost."""
    joints = scene.truth.joints.astype(np.float32)
    joints[1, JOINT_NAMES.index("l_hand")] += np.array([0.03, 0.0, 0.04], np.float32)
    joints[2, [JOINT_NAMES.index("l_hand"), JOINT_NAMES.index("r_hand")]] += np.array([0.0, 0.2, 0.0], np.float32)
    joints[3] = np.nan
    return _runs.Run(joints, scene.truth.joints, np.array([1, 1, 1, 0], bool), scene.frame_index, code)
