"""`jaxskel summary`: tabulates the results of a batch."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from ..batch import (
    COLUMNS,
    SUMMARY_FILE,
    Outcome,
    ResultFolder,
    check_summary,
    read_results,
    summary_row,
    write_summary,
)
from ._outputs import check_output_file
from ._say import cell, say


def summary(
    folder: Annotated[Path, typer.Argument(help="Folder that `jaxskel batch` wrote to.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="CSV file to write.")] = None,
) -> None:
    """Tabulate frames, failures, speed and confidence of all recordings; write them as CSV."""
    found = read_results(folder)
    if output is None:
        output = folder / SUMMARY_FILE
        check_summary(output)
    check_output_file(output, [file for name in found for file in ResultFolder(folder, name).files])
    rows = [summary_row(name, manifest) for name, manifest in found.items()]
    shown = len(COLUMNS) - 1  # without the recording's path
    table = Table()
    for column in COLUMNS[:shown]:
        text = column in ("name", "outcome", "problem")
        table.add_column(column, justify="left" if text else "right", overflow="fold")
    for row in rows:
        table.add_row(*map(cell, row[:shown]))
    Console().print(table)
    write_summary(output, rows)
    outcomes = [manifest.outcome for manifest in found.values()]
    counts = ", ".join(f"{outcomes.count(each)} {each}" for each in Outcome if each in outcomes)
    frames, with_pose = (sum(getattr(m, key) for m in found.values()) for key in ("frames", "with_pose"))
    say(f"{output}: {len(rows)} recordings ({counts}), {frames} frames, {with_pose} with a pose")
