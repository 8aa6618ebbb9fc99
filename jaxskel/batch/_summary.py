"""A table of all results in a batch's folder."""

import csv
import io
import os
from collections.abc import Iterable
from pathlib import Path

from .._runtime.atomic_files import written_whole
from ..io.files import fault, open_regular
from ._manifest import Manifest, is_manifest, read_manifest
from ._names import FAILED_SUFFIX, MANIFEST_FILE

COLUMNS = ("name", "outcome", "frames", "with_pose", "fps", "confidence", "seconds", "problem", "source")


def read_results(output: Path) -> dict[str, Manifest]:
    """The manifests of all results below a folder, and of the recordings that failed, by name, sorted.

    If a recording has an older result and has failed since, the failure counts. Other files of the same names are left
    out.

    Raises:
        ValueError: There are no manifests, or one is damaged.
    """
    found = {}
    for path in (*output.rglob(MANIFEST_FILE), *output.rglob(f"*{FAILED_SUFFIX}")):
        place = path.relative_to(output)
        if any(part.startswith(".") for part in place.parts) or not is_manifest(path):
            continue
        is_result = path.name == MANIFEST_FILE
        name = place.parent.as_posix() if is_result else place.as_posix().removesuffix(FAILED_SUFFIX)
        found[name] = read_manifest(path)
    if not found:
        raise ValueError(f"{output}: holds no result of a batch; check the path")
    return {name: found[name] for name in sorted(found)}


def summary_row(name: str, manifest: Manifest) -> tuple[str, ...]:
    """The cells of a row, in the order of `COLUMNS`."""
    fps, confidence = manifest.fps, manifest.confidence
    return (
        name, str(manifest.outcome), str(manifest.frames), str(manifest.with_pose),
        "" if fps is None else f"{fps:.1f}", "" if confidence is None else f"{confidence:.2f}",
        f"{sum(manifest.seconds.values()):.1f}", manifest.problem or "", manifest.work.source,
    )  # fmt: skip


def check_summary(path: Path) -> None:
    """Refuse to replace a file that is not such a table.

    Raises:
        ValueError: It is another file; one line that names it.
    """
    if not os.path.lexists(path):
        return
    start = ",".join(COLUMNS).encode()
    try:
        with open_regular(path) as file:
            is_table = file.read(len(start)) == start
    except ValueError:
        is_table = False
    if not is_table:
        raise fault(path, None, "was not written by jaxskel summary, which would replace it; give another --output")


def write_summary(path: Path, rows: Iterable[tuple[str, ...]]) -> None:
    """Write the table as CSV."""
    with written_whole(path) as file, io.TextIOWrapper(file, "utf-8", errors="surrogateescape", newline="") as text:
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS)
        table.writerows(rows)
