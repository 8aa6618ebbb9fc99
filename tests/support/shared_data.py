"""The shared recordings beside the project, where they exist."""

from pathlib import Path

import equinox as eqx
import pytest

from jaxskel import Recording

SHARED = Path(__file__).parents[3] / "shared" / "data"


SEQUENCE = SHARED / "sequences" / "16_11_male.npz"


def eight_views(recording: Recording) -> Recording:
    """The same recording by its first eight cameras, the number in most tests, so that nothing is compiled again."""
    eight = recording.cameras[:8], recording.silhouettes[:, :8]
    return eqx.tree_at(lambda r: (r.cameras, r.silhouettes), recording, eight)


def needs(path: Path):
    return pytest.mark.skipif(not path.exists(), reason=f"needs {'/'.join(path.parts[-3:])} in ../shared/data")
