"""The shared recordings beside the project, where they exist."""

from pathlib import Path

import pytest

SHARED = Path(__file__).parents[3] / "shared" / "data"


SEQUENCE = SHARED / "sequences" / "16_11_male.npz"


def needs(path: Path):
    return pytest.mark.skipif(not path.exists(), reason=f"needs {'/'.join(path.parts[-3:])} in ../shared/data")
