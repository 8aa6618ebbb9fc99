"""Proposals for a folder, and refusals."""

import tomllib
from pathlib import Path

import pytest

from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording
from support import recording_folders as folders


def proposed(folder: Path, **given) -> tuple[dict, tuple[str, ...]]:
    """The proposed table, which must be readable, and the doubts."""
    proposal = propose_recording(folder, fps=given.pop("fps", 30.0), **given)
    (folder / "recording.toml").write_text(proposal.text)
    assert len(read_recording(folder)) > 0
    return tomllib.loads(proposal.text), proposal.doubts


def refusal(folder: Path, **given) -> str:
    with pytest.raises(ValueError, match=r"\S") as error:
        propose_recording(folder, **{"fps": 30.0, **given})
    assert "\n" not in str(error.value)
    return str(error.value)


def bare(folder: Path, kind: str) -> Path:
    """A folder of another scene that nobody has described yet."""
    (folders.write_folder(folder, kind) / "recording.toml").unlink()
    return folder
