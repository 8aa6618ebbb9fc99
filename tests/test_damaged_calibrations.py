import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from calibration_files import FORMATS, a_rig
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxskel.io import Calibration, read_calibration

WEIRD = [b"", b"nan", b"-1", b"1e999", b"1e308", b"1e-308", b"0", b"[", b"]", b'"', b"<", b">", b":", b"\n", b"\x00",
         b"\xff", b"!!opencv-matrix", b"9" * 400, b"&a;", b"- ", b"  ", b"{", b"="]  # fmt: skip


@st.composite
def damage(draw, content: bytes) -> bytes:
    """A file with some of its words or bytes exchanged, lost or doubled."""
    for _ in range(draw(st.integers(1, 4))):
        words = [m.span() for m in re.finditer(rb"[\w.+-]+", content)]
        start, stop = draw(st.sampled_from(words)) if words and draw(st.booleans()) else (
            sorted((draw(st.integers(0, len(content))), draw(st.integers(0, len(content)))))
        )  # fmt: skip
        new = draw(st.sampled_from(WEIRD) | st.binary(max_size=8) | st.just(content[start:stop] * 2))
        content = content[:start] + new + content[stop:]
    return content


def outcome(path: Path, unit: float | None) -> Calibration | str:
    try:
        return read_calibration(path, unit=unit)
    except ValueError as error:
        return str(error)


@pytest.mark.parametrize("form", [name for name in FORMATS if name != "freemocap"])
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused(form, data):
    with tempfile.TemporaryDirectory() as folder:
        path = FORMATS[form].write(Path(folder), a_rig(0, FORMATS[form].coefficients))
        file = data.draw(st.sampled_from(sorted(Path(folder).iterdir())))
        file.write_bytes(data.draw(damage(file.read_bytes())))
        found = outcome(path, FORMATS[form].unit)
        if isinstance(found, str):
            assert folder in found
            assert len(found.splitlines()) == 1
        else:
            cameras = found.cameras
            assert all(np.isfinite(a).all() for a in (cameras.K, cameras.R, cameras.t, cameras.dist))


@pytest.mark.parametrize(
    "name", ["a.toml", "a.yml", "intri.yml", "a.qca.txt", "a.xcp", "a.json", "a.txt", "a.xml", "a.npy", "a.npz",
             "cameras.txt"]
)  # fmt: skip
@settings(max_examples=60, deadline=None)
@given(content=st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_random_bytes_are_refused(name, content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        (Path(folder) / "images.txt").write_bytes(content)
        (Path(folder) / "extri.yml").write_bytes(content)
        found = outcome(path, None)
        assert isinstance(found, str)
        assert folder in found
        assert len(found.splitlines()) == 1
