"""The check that runs before poses are computed: it refuses hopeless recordings."""

from pathlib import Path

from ..recording import Recording
from ._judge import Severity, judge


def doubts_before_work(source: Path | str, recording: Recording, anyway: bool = False) -> list[str]:
    """Judge a few frames of a recording before any work.

    Args:
        source: Path of the recording, of several people with the name of one, for messages.
        recording: The recording.
        anyway: Whether to go on with a hopeless recording.

    Returns:
        Doubts, one line each.

    Raises:
        ValueError: The recording is hopeless; one line says why.
    """
    findings = judge(recording).findings
    for finding in findings:
        if finding.severity is Severity.HOPELESS and not anyway:
            raise ValueError(f"{source}: {finding.told}; jaxskel check draws it, --anyway goes on")
    return [f"{source}: {finding.told}" for finding in findings]
