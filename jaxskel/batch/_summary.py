"""All results of a batch's folder, as a table."""

import csv
import io
from collections.abc import Iterable
from pathlib import Path

from .._files import written_whole
from ._folders import FAILED_SUFFIX
from ._manifest import MANIFEST_FILE, Manifest, read_manifest

COLUMNS = ("name", "outcome", "frames", "with_pose", "fps", "confidence", "seconds", "problem", "source")


def read_results(output: Path) -> dict[str, Manifest]:
    """The manifests of all results below a folder, and of the recordings that failed, by name, sorted.

    Where a recording has an older result and has failed since, the failure counts.

    Raises:
        ValueError: There are none, or one is damaged.
    """
    found = {}
    for path in output.rglob(MANIFEST_FILE):
        name = path.parent.relative_to(output)
        if not any(part.startswith(".") for part in name.parts):
            found[name.as_posix()] = read_manifest(path)
    for path in output.rglob(f"*{FAILED_SUFFIX}"):
        found[path.relative_to(output).as_posix().removesuffix(FAILED_SUFFIX)] = read_manifest(path)
    if not found:
        raise ValueError(f"{output}: holds no result of a batch; check the path")
    return {name: found[name] for name in sorted(found)}


def summary_row(name: str, manifest: Manifest) -> tuple[str, ...]:
    """The cells of `COLUMNS`."""
    fps, confidence = manifest.fps, manifest.confidence
    return (
        name, str(manifest.outcome), str(manifest.frames), str(manifest.with_pose),
        "" if fps is None else f"{fps:.1f}", "" if confidence is None else f"{confidence:.2f}",
        f"{sum(manifest.seconds.values()):.1f}", manifest.problem or "", manifest.work.source,
    )  # fmt: skip


def write_summary(path: Path, rows: Iterable[tuple[str, ...]]) -> None:
    """Write the table as CSV."""
    with written_whole(path) as file, io.TextIOWrapper(file, "utf-8", errors="surrogateescape", newline="") as text:
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS)
        table.writerows(rows)
