"""Points of other templates on the human body: where they are, and which of its segments carries them."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from ._human import HUMAN_15, PIVOT_NAMES, SEGMENT_OF_PIVOT
from ._keypoint_sets import POINT_NAMES
from ._skeleton import Skeleton
from ._template import SkeletonTemplate

Meanings = Sequence[Sequence[tuple[str, float]]]


def shares_of(meanings: Meanings) -> Float[np.ndarray, "points human"]:
    """Shares of each of `POINT_NAMES` in each point."""
    shares = np.zeros((len(meanings), len(POINT_NAMES)))
    for row, meaning in enumerate(meanings):
        for name, share in meaning:
            shares[row, POINT_NAMES.index(name)] = share
    return shares


def human_points(skeleton: Skeleton, meanings: Meanings) -> Float[np.ndarray, "points 3"]:
    """Where points are on a human skeleton at rest (m)."""
    return shares_of(meanings) @ np.concatenate([skeleton.rest_joints, skeleton.rest_tips, skeleton.pivots])


def carriers_of(template: SkeletonTemplate) -> Int[np.ndarray, " segments"]:
    """The segment of the human body that each segment of a template turns with: the one that carries its first bone."""
    outer = dict(zip((pivot.joint for pivot in HUMAN_15.pivots), SEGMENT_OF_PIVOT, strict=True))
    inner = {pivot.name: HUMAN_15.segment_of_joint[pivot.joint] for pivot in HUMAN_15.pivots}
    carriers = list(template.segment_of_joint + template.segment_of_tip)
    found = [0]
    for segment in range(1, len(template.segment_names)):
        point = carriers.index(segment)
        name = _main(template.meanings[point])
        begin = _main(template.meanings[template.point_parents[point]])
        if name in inner:
            found.append(inner[name])
        elif name in HUMAN_15.joint_names:
            joint = HUMAN_15.joint_names.index(name)
            # Beyond a wrist or an ankle, a bone turns with hand or foot.
            found.append(outer[joint] if begin in PIVOT_NAMES else HUMAN_15.segment_of_joint[joint])
        else:
            found.append(HUMAN_15.segment_of_tip[HUMAN_15.tip_names.index(name)])
    return np.array(found, np.int32)


def _main(meaning: Sequence[tuple[str, float]]) -> str:
    """The outermost of the points that a point is a mean of."""
    return max((name for name, share in meaning if share > 0), key=_OUTWARDS.index)


_OUTWARDS = (*HUMAN_15.joint_names, *PIVOT_NAMES, *HUMAN_15.tip_names)
