"""The verdict where poses are about to be made: what nothing can come of is refused."""

from pathlib import Path

from ..recording import Recording
from ._judge import Severity, judge


def doubts_before_work(source: Path, recording: Recording, anyway: bool = False) -> list[str]:
    """Look at a few frames of a recording before any work.

    Args:
        source: The recording's path, for messages.
        recording: The recording.
        anyway: Whether to go on where nothing can come of it.

    Returns:
        What is doubtful, a line each.

    Raises:
        ValueError: Nothing can come of it, in one line that says why.
    """
    findings = judge(recording).findings
    for finding in findings:
        if finding.severity is Severity.HOPELESS and not anyway:
            raise ValueError(f"{source}: {finding.told}; jaxskel check draws it, --anyway goes on")
    return [f"{source}: {finding.told}" for finding in findings]
