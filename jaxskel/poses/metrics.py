"""Scores of poses against ground truth, counted as in Table 1 and Figure 3 of Straka et al. (BMVC 2011).

A limb is wrong if its joint is farther than a threshold from the truth. In a frame without a pose, every limb is
wrong. Sides count: a left hand in the place of the right hand is an error. The swap-forgiving figures exchange the two
whole arms (shoulder, elbow, hand) or the two whole legs (hip, knee, foot) of a frame if that lowers the summed
distance of the two hands (feet) from the truth. So they do with each pair of limbs of another template.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Shaped
from rich import box
from rich.table import Table
from rich.text import Text

from .._runtime.plain_text import plain
from ..body import HUMAN_15, JOINT_NAMES, SkeletonTemplate
from ._poses import Poses

# In the order of Table 1, which lacks the head.
LimbPairs = list[tuple[list[int], list[int], list[bool]]]

LIMBS = ("r_foot", "l_foot", "r_hand", "l_hand", "head")
"""Joints that are counted by themselves, where a template has them."""
CURVE_THRESHOLDS_MM = tuple(range(0, 201, 5))
"""Thresholds (mm) of Figure 3(b)."""


class Score(eqx.Module):
    """Distances of poses from the truth in the frames whose truth is known. Made by [`score`][] or [`score_poses`][].

    Attributes:
        distances: Distance of each joint from the truth (m); infinite where there is no pose.
        forgiven: The same after arms or legs have been exchanged in frames where that is better.
        threshold: A joint farther than this from the truth is wrong (m).
        without_truth: Frames left out because their truth is not known.
        joint_names: The joints.
        left_out: Joints that are not scored because only poses or only truth have them.
    """

    distances: Float[np.ndarray, "frames joints"]
    forgiven: Float[np.ndarray, "frames joints"]
    has_pose: Bool[np.ndarray, " frames"]
    threshold: float
    without_truth: int = 0
    joint_names: tuple[str, ...] = eqx.field(static=True, default=JOINT_NAMES)
    left_out: tuple[str, ...] = eqx.field(static=True, default=())

    @property
    def limbs(self) -> tuple[str, ...]:
        """Those of `LIMBS` that are among the joints."""
        return tuple(limb for limb in LIMBS if limb in self.joint_names)

    def __len__(self) -> int:
        return len(self.distances)

    def wrong(self, joint: str, forgive_swaps: bool = False) -> int:
        """Number of frames in which a joint is wrong."""
        return int((self._counted(forgive_swaps)[:, self.joint_names.index(joint)] > self.threshold).sum())

    def all_correct(self, forgive_swaps: bool = False) -> float:
        """Share of frames with all joints within the threshold."""
        return float((self._counted(forgive_swaps) <= self.threshold).all(axis=1).mean())

    def percentile(self, q: int | float, joint: str | None = None, forgive_swaps: bool = False) -> float:
        """A percentile of the distances (m) of one joint or of all, over frames with a pose; NaN if there are none."""
        distances = self._counted(forgive_swaps)[self.has_pose]
        chosen = distances if joint is None else distances[:, self.joint_names.index(joint)]
        # By rank, without interpolation, because the distance of a missing joint is infinite.
        return float(np.percentile(chosen, q, method="inverted_cdf")) if chosen.size else float("nan")

    def curve(self, forgive_swaps: bool = False) -> Float[np.ndarray, "thresholds joints"]:
        """Share of frames in which each joint is within each of `CURVE_THRESHOLDS_MM`: Figure 3(b)."""
        thresholds = np.array(CURVE_THRESHOLDS_MM) / 1000
        return (self._counted(forgive_swaps)[None] <= thresholds[:, None, None]).mean(axis=1)

    def to_dict(self) -> dict[str, Any]:
        """All figures as plain numbers for JSON: mm, percent; None if no frame has a pose."""
        n = len(self)

        def counting(forgive: bool) -> dict[str, Any]:
            counts = {limb: self.wrong(limb, forgive) for limb in self.limbs}
            curve = 100 * self.curve(forgive)
            return {
                "wrong": {limb: {"count": k, "percent": 100 * k / n} for limb, k in counts.items()},
                "all_joints_correct_percent": 100 * self.all_correct(forgive),
                "median_mm": _mm(self.percentile(50, None, forgive)),
                "joints_mm": {
                    joint: {
                        name: _mm(self.percentile(q, joint, forgive))
                        for name, q in (("p25", 25), ("median", 50), ("p75", 75), ("p95", 95))
                    }
                    for joint in self.joint_names
                },
                "curve_percent": {"all": curve.mean(axis=1).tolist()}
                | {joint: curve[:, i].tolist() for i, joint in enumerate(self.joint_names)},
            }

        return {
            "frames": n,
            "frames_without_pose": int((~self.has_pose).sum()),
            "frames_without_truth": self.without_truth,
            "threshold_mm": 1000 * self.threshold,
            **({"joints_left_out": list(self.left_out)} if self.left_out else {}),
            "curve_threshold_mm": list(CURVE_THRESHOLDS_MM),
            "sides_counted": counting(False),
            "swaps_forgiven": counting(True),
        }

    def _counted(self, forgive_swaps: bool) -> np.ndarray:
        return self.forgiven if forgive_swaps else self.distances


def score(
    poses_joints: Float[np.ndarray, "frames joints 3"],
    truth_joints: Float[np.ndarray, "truth_frames joints 3"],
    has_pose: Shaped[np.ndarray, " flags"] | None = None,
    threshold: float = 0.1,
    template: SkeletonTemplate = HUMAN_15,
) -> Score:
    """Score joints against the truth of the same frames in the same world; for `Poses` see [`score_poses`][].

    To score several recordings as one, concatenate their joints, or use [`join_scores`][].

    Args:
        poses_joints: Estimated joints (m).
        truth_joints: True joints (m); a frame with a NaN is left out.
        has_pose: Which frames have a pose; by default those without a NaN.
        threshold: A joint farther than this from the truth is wrong (m).
        template: What both kinds of joints are of.

    Raises:
        ValueError: The arrays have different lengths, or no frame is left.
    """
    given, count = (poses_joints.shape[1], truth_joints.shape[1]), len(template.joint_names)
    if given != (count, count):
        raise ValueError(f"score: {given[0]} and {given[1]} joints, but {template.name} has {count}; give its template")
    pairs = limb_pairs(template, template.joint_names)
    return scored(poses_joints, truth_joints, has_pose, threshold, pairs, template.joint_names, ())


def score_poses(
    poses: Poses,
    truth_joints: Float[np.ndarray, "truth_frames joints 3"],
    truth_template: SkeletonTemplate = HUMAN_15,
    threshold: float = 0.1,
) -> Score:
    """Score poses against the truth of the same frames in the same world, by the names of the joints that both have.

    Args:
        poses: The poses.
        truth_joints: True joints (m); a frame in which one that both have is NaN is left out.
        truth_template: What these joints are of.
        threshold: A joint farther than this from the truth is wrong (m).

    Raises:
        ValueError: The numbers of frames differ, no frame is left, or no joint of the two has the same name.
    """
    ours, theirs = poses.template.joint_names, truth_template.joint_names
    names = tuple(name for name in ours if name in theirs)
    if not names:
        raise ValueError(
            f"score: no joint of the poses ({', '.join(ours)}) has the name of one of the truth ({', '.join(theirs)}); "
            "give both the same names"
        )
    return scored(
        poses.joints[:, [ours.index(name) for name in names]],
        truth_joints[:, [theirs.index(name) for name in names]],
        poses.has_pose,
        threshold,
        limb_pairs(poses.template, names),
        names,
        tuple(name for name in ours + theirs if (name in ours) != (name in theirs)),
    )


def scored(
    poses_joints: Float[np.ndarray, "frames joints 3"],
    truth_joints: Float[np.ndarray, "truth_frames joints 3"],
    has_pose: Shaped[np.ndarray, " flags"] | None,
    threshold: float,
    pairs: LimbPairs,
    names: tuple[str, ...],
    left_out: tuple[str, ...],
) -> Score:
    """The score of points of any names; the other arguments are as for `score`, or fields of the result."""
    if len(truth_joints) != len(poses_joints) or (has_pose is not None and len(has_pose) != len(poses_joints)):
        raise ValueError(
            f"score: {len(poses_joints)} frames of poses but {len(truth_joints)} of truth"
            + ("" if has_pose is None else f" and {len(has_pose)} flags of has_pose")
            + "; give the same frames"
        )
    if not 0 < threshold < np.inf:
        raise ValueError(f"score: threshold {threshold} must be a positive number of metres")
    known = np.isfinite(truth_joints).all(axis=(1, 2))
    if not known.any():
        raise ValueError("score: no frame has a known truth; give at least one")
    poses, truth = np.asarray(poses_joints, np.float64)[known], np.asarray(truth_joints, np.float64)[known]
    present = np.asarray(np.isfinite(poses).all(axis=(1, 2)) if has_pose is None else has_pose[known], bool)
    distances = _distances(poses, truth, present)
    forgiven = distances.copy()
    for group, others, ends in pairs:
        exchanged = _distances(poses[:, others], truth[:, group], present)
        better = exchanged[:, ends].sum(axis=1) < distances[:, group][:, ends].sum(axis=1)
        forgiven[np.ix_(better, group)] = exchanged[better]
    return Score(distances, forgiven, present, float(threshold), int((~known).sum()), names, left_out)


def limb_pairs(template: SkeletonTemplate, names: tuple[str, ...]) -> LimbPairs:
    """For each pair of limbs: its joints among the names, those on the other side, and whether they are its ends."""
    parents, mirror = template.joint_parents, template.mirror_joints.tolist()
    at = {joint: names.index(name) for joint, name in enumerate(template.joint_names) if name in names}
    found = []
    for pair in template.limb_pairs.tolist():
        limb = list(pair)
        for joint, parent in enumerate(parents):
            if parent in limb:
                limb.append(joint)
        limb = [joint for joint in limb if joint in at and mirror[joint] in at and mirror[joint] != joint]
        above = {up for joint in limb for up in _ancestors(joint, parents)}
        group, others = [at[joint] for joint in limb], [at[mirror[joint]] for joint in limb]
        if group:
            found.append((group, others, [joint not in above for joint in limb]))
    return found


def _ancestors(joint: int, parents: tuple[int, ...]) -> list[int]:
    found = []
    while (joint := parents[joint]) >= 0:
        found.append(joint)
    return found


def _distances(poses: np.ndarray, truth: np.ndarray, has_pose: np.ndarray) -> np.ndarray:
    distances = np.linalg.norm(poses - truth, axis=-1)
    return np.where(has_pose[:, None] & np.isfinite(distances), distances, np.inf)


def join_scores(scores: Iterable[Score]) -> Score:
    """Join the scores of several recordings into one.

    Raises:
        ValueError: There are no scores, or they differ in their threshold or their joints.
    """
    parts = list(scores)
    if not parts:
        raise ValueError("join_scores: no scores given")
    if len({part.threshold for part in parts}) > 1:
        raise ValueError(f"join_scores: the thresholds differ: {sorted({part.threshold for part in parts})}")
    if len({part.joint_names for part in parts}) > 1:
        raise ValueError("join_scores: the scores are of different joints; join those of one template")
    return Score(
        distances=np.concatenate([part.distances for part in parts]),
        forgiven=np.concatenate([part.forgiven for part in parts]),
        has_pose=np.concatenate([part.has_pose for part in parts]),
        threshold=parts[0].threshold,
        without_truth=sum(part.without_truth for part in parts),
        joint_names=parts[0].joint_names,
        left_out=tuple(dict.fromkeys(name for part in parts for name in part.left_out)),
    )


def score_table(scores: Mapping[str, Score]) -> Table:
    """Table 1 with the head and the rest of the body: a row for each recording, then one for all together."""
    total = join_scores(scores.values())
    table = Table(
        title=f"Frames in which a joint is more than {1000 * total.threshold:.0f} mm from the truth",
        caption="Second line: left and right exchanged where that is better."
        + (f" Not scored, because only one has it: {', '.join(total.left_out)}." if total.left_out else ""),
        box=box.HORIZONTALS,
        show_lines=True,
        padding=0,
    )
    table.add_column("recording", overflow="fold")
    for column in (
        "frames",
        "no\npose",
        *(limb.replace("_", "\n") for limb in total.limbs),
        f"all {len(total.joint_names)}\nright",
        "median\nmm",
    ):
        table.add_column(column, justify="right")
    for name, part in (*scores.items(), ("total", total)):
        limbs = [tuple(part.wrong(limb, forgive) for forgive in (False, True)) for limb in total.limbs]
        table.add_row(
            Text(plain(name)),
            str(len(part)),
            str(int((~part.has_pose).sum())),
            *("\n".join(f"{k} {100 * k / len(part):.1f}%" for k in both) for both in limbs),
            "\n".join(f"{100 * part.all_correct(forgive):.1f}%" for forgive in (False, True)),
            "\n".join(f"{1000 * part.percentile(50, None, forgive):.1f}" for forgive in (False, True)),
        )
    return table


def _mm(metres: float) -> float | None:
    return 1000 * metres if np.isfinite(metres) else None
