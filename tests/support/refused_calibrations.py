"""Calibrations that are edited and then refused."""

import re
from pathlib import Path

import pytest

from jaxskel.io.calibrations import read_calibration


def refused(path: Path, **given) -> str:
    """The one line with which a file is refused, which names it."""
    with pytest.raises(ValueError, match=re.escape(str(path.parent))) as caught:
        read_calibration(path, **given)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message


def edited(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path
