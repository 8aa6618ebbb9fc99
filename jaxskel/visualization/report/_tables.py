"""The text parts of the page: facts of the recording, bone lengths, score. All names are escaped."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.metadata import version

import numpy as np

from ..._runtime.plain_text import plain
from ...body import HUMAN_15, Skeleton
from ...poses import Poses, Score
from ...recording import Recording
from ._numbers import body_points


def facts(recording: Recording, poses: Poses) -> str:
    """Facts of the recording, and the status of its frames."""
    return _facts(poses, [("with a pose", _posed(poses))], recording, _stature(poses))


def facts_of_people(recording: Recording, people: Mapping[str, Poses]) -> str:
    """Facts of the recording, and the status of everybody's frames."""
    told = [
        (plain(name), ", ".join(f"{key} {value}" for key, value in (("with a pose", _posed(poses)), *_stature(poses))))
        for name, poses in people.items()
    ]
    return _facts(next(iter(people.values())), told, recording, [])


def _facts(poses: Poses, posed: list[tuple[str, str]], recording: Recording, stature: list[tuple[str, str]]) -> str:
    sizes = list(dict.fromkeys(f"{w} x {h}" for w, h in recording.cameras.size.tolist()))
    rows = (
        ("frames", f"{len(poses)} ({len(poses) / poses.fps:.2f} s at {poses.fps:g} fps)"),
        *posed,
        ("cameras", f"{len(recording.cameras)} of {', '.join(sizes)} px"),
        ("up", poses.up),
        *stature,
        ("page made by", ", ".join(f"{name} {version(name)}" for name in ("jaxskel", "jax", "numpy"))),
    )
    return "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in rows)


def _posed(poses: Poses) -> str:
    """How many frames have a pose, and the status of all."""
    counts = ", ".join(f"{count} {name}" for name, count in poses.counts().items())
    return f"{int(poses.has_pose.sum())} ({counts})"


def _stature(poses: Poses) -> list[tuple[str, str]]:
    """How tall a person is, and how surely where the run found it; how large any other subject is."""
    if poses.skeleton is None:
        return []
    if not poses.template.is_human:
        return [("size", f"{poses.skeleton.size:.2f} m")]
    told = f"{poses.skeleton.stature:.2f} m"
    return [
        ("stature", told if poses.stature_deviation is None else f"{told} ± {poses.stature_deviation:.2f} m, found")
    ]


def bone_lengths(poses: Poses, skeleton: Skeleton | None) -> str:
    """Table of bone lengths over the frames with a pose: median, 5th to 95th percentile, and the subject's own.

    Hand and foot rotate about wrist and ankle, so the lengths to palm and ball of the foot vary.
    """
    if not poses.has_pose.any():
        return "<p>No frame has a pose.</p>"
    names, parents = poses.template.point_names, poses.template.point_parents.tolist()
    ends, starts = range(1, len(names)), parents[1:]
    points = body_points(poses)[poses.has_pose]
    lengths = 1000 * np.linalg.norm(points[:, ends] - points[:, starts], axis=-1)
    middle, (low, high) = np.median(lengths, axis=0), np.percentile(lengths, (5, 95), axis=0)
    known = None
    if skeleton is not None and skeleton.template == poses.template:
        known = 1000 * np.concatenate([skeleton.bone_lengths, skeleton.tip_lengths])
    rows = []
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        row = [f"{names[start]} to {names[end]}", f"{middle[i]:.0f}", f"{low[i]:.0f} to {high[i]:.0f}"]
        rows.append(row if known is None else [*row, f"{known[i]:.0f}"])
    head = ["bone", "median mm", "5 to 95 %", *([] if known is None else ["subject mm"])]
    return _table(head, rows)


def bone_lengths_of_people(people: Mapping[str, Poses]) -> str:
    """Table of bone lengths of each person."""
    each = (f"<div><h3>{escape(plain(name))}</h3>{bone_lengths(poses, None)}</div>" for name, poses in people.items())
    return f"<div class='each'>{''.join(each)}</div>"


def varying_bones(poses: Poses) -> str:
    """Why the lengths of some bones vary: they have pivots."""
    template = poses.template
    if template == HUMAN_15:
        return (
            " Hand and foot turn about wrist and ankle, which are no joints of their own: so the\nlengths from elbow "
            "to palm (<code>hand</code>) and from knee to ball of the foot (<code>foot</code>) vary."
        )
    if not template.pivots:
        return ""
    bones = ", ".join(escape(template.joint_names[pivot.joint]) for pivot in template.pivots)
    return f" Bones that end in {bones} turn about points inside them, so their lengths vary."


def score_tables(score: Score | None) -> str:
    """Tables of the distances to the ground truth, as in `jaxskel evaluate`; empty without ground truth."""
    if score is None:
        return ""
    n = len(score)
    rows = []
    for name, forgive in (("sides counted", False), ("swaps forgiven", True)):
        wrong = [f"{100 * score.wrong(limb, forgive) / n:.1f} %" for limb in score.limbs]
        middle = score.percentile(50, None, forgive)
        rows.append([name, *wrong, f"{100 * score.all_correct(forgive):.1f} %", _mm(middle)])
    table = _table(["", *score.limbs, f"all {len(score.joint_names)} right", "median mm"], rows)
    joints = [[joint, *(_mm(score.percentile(q, joint)) for q in (25, 50, 75, 95))] for joint in score.joint_names]
    each = _table(["distance, mm", "25 %", "median", "75 %", "95 %"], joints)
    unknown = f", {score.without_truth} more without a truth" if score.without_truth else ""
    left_out = f" Not scored, because only one has it: {', '.join(score.left_out)}." if score.left_out else ""
    return (
        f"<section><h2>Score</h2><p>Frames in which a joint is more than {1000 * score.threshold:.0f} mm from the "
        f"truth: {n} frames scored, {int((~score.has_pose).sum())} without a pose{unknown}."
        f"{escape(left_out)}</p>{table}{each}</section>"
    )


def _mm(metres: float) -> str:
    return f"{1000 * metres:.1f}" if np.isfinite(metres) else "–"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def cells(tag: str, row: Sequence[str]) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row) + "</tr>"

    body = "".join(cells("td", row) for row in rows)
    return f"<div class='table'><table><thead>{cells('th', head)}</thead><tbody>{body}</tbody></table></div>"
