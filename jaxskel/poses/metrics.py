"""Scores of poses against ground truth, counted as in Table 1 and Figure 3 of Straka et al. (BMVC 2011).

A limb is wrong if its joint is farther than a threshold from the truth. In a frame without a pose, every limb is
wrong. Sides count: a left hand in the place of the right hand is an error. The swap-forgiving figures exchange the two
whole arms (shoulder, elbow, hand) or the two whole legs (hip, knee, foot) of a frame if that lowers the summed
distance of the two hands (feet) from the truth.
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
from ..body import JOINT_NAMES, MIRROR_JOINTS

# Limbs in the order of Table 1, which lacks the head.
LIMBS = ("r_foot", "l_foot", "r_hand", "l_hand", "head")
CURVE_THRESHOLDS_MM = tuple(range(0, 201, 5))
"""Thresholds (mm) of Figure 3(b)."""

_ARMS = tuple(i for i, name in enumerate(JOINT_NAMES) if name[2:] in ("shoulder", "elbow", "hand"))
_LEGS = tuple(i for i, name in enumerate(JOINT_NAMES) if name[2:] in ("hip", "knee", "foot"))
_HANDS = tuple(JOINT_NAMES.index(name) for name in ("l_hand", "r_hand"))
_FEET = tuple(JOINT_NAMES.index(name) for name in ("l_foot", "r_foot"))


class Score(eqx.Module):
    """Distances of poses from the truth in the frames whose truth is known. Made by [`score`][].

    Attributes:
        distances: Distance of each joint from the truth (m); infinite where there is no pose.
        forgiven: The same after arms or legs have been exchanged in frames where that is better.
        threshold: A joint farther than this from the truth is wrong (m).
        without_truth: Frames left out because their truth is not known.
    """

    distances: Float[np.ndarray, "frames joints"]
    forgiven: Float[np.ndarray, "frames joints"]
    has_pose: Bool[np.ndarray, " frames"]
    threshold: float
    without_truth: int = 0

    def __len__(self) -> int:
        return len(self.distances)

    def wrong(self, joint: str, forgive_swaps: bool = False) -> int:
        """Number of frames in which a joint is wrong."""
        return int((self._counted(forgive_swaps)[:, JOINT_NAMES.index(joint)] > self.threshold).sum())

    def all_correct(self, forgive_swaps: bool = False) -> float:
        """Share of frames with all 15 joints within the threshold."""
        return float((self._counted(forgive_swaps) <= self.threshold).all(axis=1).mean())

    def percentile(self, q: int | float, joint: str | None = None, forgive_swaps: bool = False) -> float:
        """A percentile of the distances (m) of one joint or of all, over frames with a pose; NaN if there are none."""
        distances = self._counted(forgive_swaps)[self.has_pose]
        chosen = distances if joint is None else distances[:, JOINT_NAMES.index(joint)]
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
            counts = {limb: self.wrong(limb, forgive) for limb in LIMBS}
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
                    for joint in JOINT_NAMES
                },
                "curve_percent": {"all": curve.mean(axis=1).tolist()}
                | {joint: curve[:, i].tolist() for i, joint in enumerate(JOINT_NAMES)},
            }

        return {
            "frames": n,
            "frames_without_pose": int((~self.has_pose).sum()),
            "frames_without_truth": self.without_truth,
            "threshold_mm": 1000 * self.threshold,
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
) -> Score:
    """Score poses against the truth of the same frames in the same world.

    To score several recordings as one, concatenate their joints, or use [`join_scores`][].

    Args:
        poses_joints: Estimated joints (m).
        truth_joints: True joints (m); a frame with a NaN is left out.
        has_pose: Which frames have a pose; by default those without a NaN.
        threshold: A joint farther than this from the truth is wrong (m).

    Raises:
        ValueError: The arrays have different lengths, or no frame is left.
    """
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
    present = np.isfinite(poses).all(axis=(1, 2)) if has_pose is None else np.asarray(has_pose, bool)[known]
    present = np.asarray(present)
    distances = _distances(poses, truth, present)
    exchanged = _distances(poses[:, list(MIRROR_JOINTS)], truth, present)
    forgiven = distances.copy()
    for group, ends in ((_ARMS, _HANDS), (_LEGS, _FEET)):
        better = exchanged[:, ends].sum(axis=1) < distances[:, ends].sum(axis=1)
        forgiven[np.ix_(better, group)] = exchanged[np.ix_(better, group)]
    return Score(distances, forgiven, present, float(threshold), int((~known).sum()))


def _distances(poses: np.ndarray, truth: np.ndarray, has_pose: np.ndarray) -> np.ndarray:
    distances = np.linalg.norm(poses - truth, axis=-1)
    return np.where(has_pose[:, None] & np.isfinite(distances), distances, np.inf)


def join_scores(scores: Iterable[Score]) -> Score:
    """Join the scores of several recordings into one."""
    parts = list(scores)
    if not parts:
        raise ValueError("join_scores: no scores given")
    if len({part.threshold for part in parts}) > 1:
        raise ValueError(f"join_scores: the thresholds differ: {sorted({part.threshold for part in parts})}")
    return Score(
        distances=np.concatenate([part.distances for part in parts]),
        forgiven=np.concatenate([part.forgiven for part in parts]),
        has_pose=np.concatenate([part.has_pose for part in parts]),
        threshold=parts[0].threshold,
        without_truth=sum(part.without_truth for part in parts),
    )


def score_table(scores: Mapping[str, Score]) -> Table:
    """Table 1 with the head and the rest of the body: a row for each recording, then one for all together."""
    total = join_scores(scores.values())
    table = Table(
        title=f"Frames in which a joint is more than {1000 * total.threshold:.0f} mm from the truth",
        caption="Second line: left and right exchanged where that is better.",
        box=box.HORIZONTALS,
        show_lines=True,
        padding=0,
    )
    table.add_column("recording", overflow="fold")
    for column in (
        "frames",
        "no\npose",
        *(limb.replace("_", "\n") for limb in LIMBS),
        "all 15\nright",
        "median\nmm",
    ):
        table.add_column(column, justify="right")
    for name, part in (*scores.items(), ("total", total)):
        limbs = [tuple(part.wrong(limb, forgive) for forgive in (False, True)) for limb in LIMBS]
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
