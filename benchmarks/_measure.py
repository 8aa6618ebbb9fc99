"""Times contenders for the same work in turns, so that the load of the machine affects all of them equally."""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

_TURN = 0.1  # s


@dataclass(frozen=True)
class Contender:
    """An implementation of the work of a stage, ours or another library's."""

    name: str
    run: Callable[[], Any]
    frames: int
    """Frames that one call processes."""
    required: float | None = None
    """Least ratio of its time to ours that is wanted; None for ours."""


@dataclass(frozen=True)
class Row:
    """A contender's time, or another measured number of a stage."""

    stage: str
    name: str
    value: float
    unit: str = "ms/frame"
    ratio: float | None = None
    """Its time relative to ours."""
    required: float | None = None
    """Least ratio, or the bound of a number."""
    largest: bool = False
    """Whether the bound is an upper one."""

    @property
    def met(self) -> bool | None:
        """Whether the bound holds; None if there is none."""
        if self.required is None:
            return None
        number = self.value if self.ratio is None else self.ratio
        return bool(number <= self.required if self.largest else number >= self.required)


@dataclass
class Report:
    """All rows of a run."""

    machine: str
    sequence: str
    rows: list[Row] = field(default_factory=list)

    def race(self, stage: str, contenders: Sequence[Contender], repeat: int) -> list[Any]:
        """Run contenders in turns, ours first, and record medians. Returns the result of each.

        A turn is repeated runs for at least a tenth of a second: after another contender's turn the caches hold other
        data, which would dominate the time of a single short run.
        """
        results = [contender.run() for contender in contenders]  # compiles, and warms up
        times = np.empty((repeat, len(contenders)))
        for turn in times:
            for i, contender in enumerate(contenders):
                start, runs = time.perf_counter(), 0
                while runs == 0 or time.perf_counter() < start + _TURN:
                    contender.run()
                    runs += 1
                turn[i] = 1e3 * (time.perf_counter() - start) / (runs * contender.frames)
        medians = np.median(times, 0)
        for contender, median in zip(contenders, medians, strict=True):
            ratio = None if contender is contenders[0] else float(median / medians[0])
            self.add(Row(stage, contender.name, float(median), ratio=ratio, required=contender.required))
        return results

    def add(self, row: Row) -> None:
        """Add a row and print it."""
        self.rows.append(row)
        print(as_line(row), flush=True)

    def write(self, file: Path) -> None:
        """As JSON."""
        rows = [asdict(row) | {"met": row.met} for row in self.rows]
        file.write_text(json.dumps({"machine": self.machine, "sequence": self.sequence, "rows": rows}, indent=1) + "\n")


HEADER = "| stage | who | time or number | ratio | bound |\n|---|---|---|---|---|"


def as_line(row: Row) -> str:
    """A row of the Markdown table."""
    ratio = "" if row.ratio is None else f"{row.ratio:.1f}"
    bound = ""
    if row.required is not None:
        bound = f"{'<=' if row.largest else '>='} {row.required:g}{'' if row.met else ' **missed**'}"
    return f"| {row.stage} | {row.name} | {row.value:.3g} {row.unit} | {ratio} | {bound} |"


# Largest relative change for the worse, by kind. Ratios hardly depend on the machine; frames per second do, so their
# tolerance is twice as large.
_TOLERANCES = {"ratio": 0.15, "frames/s": 0.3, "mm": 0.05, "MB": 0.2, "s": 0.5}


def regressions(report: Report, baseline: Path) -> list[str]:
    """The rows that are worse than in a stored run by more than their tolerance."""
    before = {(row["stage"], row["name"]): row for row in json.loads(baseline.read_text())["rows"]}
    found = []
    for row in report.rows:
        old = before.get((row.stage, row.name))
        if old is None:
            continue
        kind = row.unit if row.ratio is None else "ratio"
        tolerance = _TOLERANCES.get(kind)
        if tolerance is None:
            continue
        new, stored = (row.value, old["value"]) if row.ratio is None else (row.ratio, old["ratio"])
        better_small = kind in ("mm", "MB", "s")
        if (new > stored * (1 + tolerance)) if better_small else (new < stored * (1 - tolerance)):
            found.append(f"{row.stage}, {row.name}: {new:.3g} {kind}, was {stored:.3g}")
    return found
