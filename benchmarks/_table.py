"""Table 1 of Straka et al. (BMVC 2011): the paper's numbers, with those of our presets beside them."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from _presets import Preset

from jaxskel.poses import LIMBS, Score
from jaxskel.poses.metrics import join_scores


class PaperRow(NamedTuple):
    """A row of the paper's Table 1: in how many frames each limb is more than 100 mm from the truth."""

    frames: int
    r_foot: int
    l_foot: int
    r_hand: int
    l_hand: int


PAPER_TABLE_1 = {
    "01_01": PaperRow(2750, 0, 0, 51, 36),
    "02_01": PaperRow(342, 0, 0, 10, 47),
    "02_05": PaperRow(1854, 1, 0, 5, 85),
    "03_01": PaperRow(431, 0, 0, 11, 5),
    "05_02": PaperRow(1122, 8, 5, 5, 7),
    "06_04": PaperRow(395, 1, 0, 6, 10),
    "13_17": PaperRow(4839, 29, 28, 119, 48),
    "13_18": PaperRow(2999, 37, 41, 162, 129),
    "13_29": PaperRow(4591, 75, 96, 172, 90),
    "16_11": PaperRow(533, 0, 0, 0, 0),
}
"""M. Straka, S. Hauswiesner, M. Rüther, H. Bischof: Skeletal Graph Based Human Pose Estimation in Real-Time,
BMVC 2011, Table 1 (Sect. 4.2), by the names of the clips in the CMU Motion Capture Database."""

PAPER_LIMBS = ("r_foot", "l_foot", "r_hand", "l_hand")
"""The columns of the paper's Table 1."""

Scores = Mapping[str, Mapping[str, Score]]
"""The scores of one set of sequences: by preset, then by sequence."""


def clip_and_body(stem: str) -> tuple[str, str]:
    """Split a file stem such as 13_18_male into the clip of Table 1, "" if it is none, and the body that acts it."""
    found = re.fullmatch(r"(\d\d_\d\d)(?:_(.+))?", stem)
    if found is None or found[1] not in PAPER_TABLE_1:
        return "", ""
    return found[1], found[2] or ""


def paper_total(clips: Sequence[str]) -> PaperRow:
    """The paper's counts over some of its clips; over all ten they are the last row of its table."""
    return PaperRow(*(sum(column) for column in zip(*(PAPER_TABLE_1[clip] for clip in clips), strict=True)))


def table_markdown(name: str, scores: Scores, presets: Sequence[Preset]) -> str:
    """The table of one set of sequences: a row for each sequence and for each body, then the totals in full."""
    stems = sorted(scores[presets[0].name])
    heads = ["sequence", "frames", "frames in the paper", "the paper", *(preset.title for preset in presets)]
    lines = [
        f"## {name}", "",
        "Frames (%) in which right foot / left foot / right hand / left hand is more than 100 mm from the truth,",
        "left and right counted apart. The paper's numbers are those of its Table 1, for its own body and cameras.", "",
        f"| {' | '.join(heads)} |", f"|---{'|---:' * (len(heads) - 1)}|",
    ]  # fmt: skip
    for label, group in _groups(stems):
        clips = [clip_and_body(stem)[0] for stem in group]
        paper = paper_total(sorted(set(clips))) if all(clips) else None
        totals = [join_scores(scores[preset.name][stem] for stem in group) for preset in presets]
        shares = [" / ".join(f"{_percent(total, limb):.1f}" for limb in PAPER_LIMBS) for total in totals]
        cells = [label, str(len(totals[0])), str(paper.frames) if paper else "–", _paper_shares(paper), *shares]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", *_totals(stems, scores, presets), ""])


def table_dict(scores: Scores) -> dict[str, Any]:
    """Every figure of one set of sequences for JSON: by preset and sequence, and of all sequences as one."""
    return {
        preset: {"sequences": {stem: part.to_dict() for stem, part in sorted(parts.items())}}
        | {"all": join_scores(parts.values()).to_dict()}
        for preset, parts in scores.items()
    }


def paper_dict() -> dict[str, Any]:
    """The paper's Table 1 for JSON."""
    rows = PAPER_TABLE_1 | {"all": paper_total(list(PAPER_TABLE_1))}
    return {
        clip: {
            "frames": row.frames,
            "wrong": {limb: {"count": k, "percent": 100 * k / row.frames} for limb, k in _counts(row).items()},
        }
        for clip, row in rows.items()
    }


def _groups(stems: list[str]) -> list[tuple[str, list[str]]]:
    """The rows: each sequence by itself, each body where there are several, all."""
    rows = [(stem, [stem]) for stem in stems]
    by_body: dict[str, list[str]] = {}
    for stem in stems:
        by_body.setdefault(clip_and_body(stem)[1], []).append(stem)
    if len(by_body) > 1:
        rows += [(f"**all {body or 'others'}**", group) for body, group in by_body.items()]
    return [*rows, ("**all**", stems)]


def _totals(stems: list[str], scores: Scores, presets: Sequence[Preset]) -> list[str]:
    """All sequences of a set pooled: counts as in the paper's last row, and the other figures of a score."""
    lines = [
        "| all sequences | frames | no pose | right foot | left foot | right hand | left hand | head "
        "| all 15 within 100 mm | median (mm) |",
        f"|---{'|---:' * 9}|",
    ]
    clips = sorted({clip_and_body(stem)[0] for stem in stems} - {""})
    if clips:
        row = paper_total(clips)
        limbs = [f"{k} ({100 * k / row.frames:.1f} %)" for k in _counts(row).values()]
        lines.append(f"| the paper | {row.frames} | – | {' | '.join(limbs)} | – | – | – |")
    for preset in presets:
        total = join_scores(scores[preset.name].values())
        lost = str(int((~total.has_pose).sum()))
        for forgive in (False, True):
            label = f"{preset.title}, swaps forgiven" if forgive else preset.title
            limbs = [f"{total.wrong(limb, forgive)} ({_percent(total, limb, forgive):.1f} %)" for limb in LIMBS]
            right = f"{100 * total.all_correct(forgive):.1f} %"
            median = f"{1e3 * total.percentile(50, None, forgive):.0f}"
            lines.append(f"| {' | '.join([label, str(len(total)), lost, *limbs, right, median])} |")
    return lines


def _counts(row: PaperRow) -> dict[str, int]:
    return {limb: getattr(row, limb) for limb in PAPER_LIMBS}


def _paper_shares(row: PaperRow | None) -> str:
    return " / ".join(f"{100 * k / row.frames:.1f}" for k in _counts(row).values()) if row else "–"


def _percent(score: Score, limb: str, forgive_swaps: bool = False) -> float:
    return 100 * score.wrong(limb, forgive_swaps) / len(score)
