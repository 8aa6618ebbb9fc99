"""Sets of keypoints by name, for `jaxskel export` and `jaxskel evaluate`."""

from ..body import BODY_25, BODY_25B, COCO_17, H36M_17, HALPE_26, KeypointSet

KEYPOINT_SETS = {each.name: each for each in (COCO_17, BODY_25, BODY_25B, HALPE_26, H36M_17)}


def named_keypoints(name: str) -> KeypointSet:
    """The set of a name."""
    if name not in KEYPOINT_SETS:
        raise ValueError(f"--keypoints {name}: give one of {', '.join(KEYPOINT_SETS)}")
    return KEYPOINT_SETS[name]
