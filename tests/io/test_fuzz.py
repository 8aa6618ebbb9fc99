"""Damaged files for every reader: the result is valid, or a `ValueError` of one line that begins with a file."""

import io
import re
import struct
import zipfile
import zlib
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.outcomes import outcome
from support.readers import READERS


# Replacements for a number, a word, or a length.
@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


WEIRD = [b"", b"nan", b"inf", b"-inf", b"-1", b"0", b"1e999", b"1e308", b"-1e308", b"1e-320", b"1000000000", b"9" * 30,
         b"9" * 400, b"1_0", "²".encode(), b"true", b"[", b"]", b"{", b"}", b'"', b"<", b">", b"&a;", b":", b"=",
         b"- ", b"#", b"\n", b"\t", b"  ", b"\x00", b"\xff", b"!!opencv-matrix", b"..", b"MOTION", b"End",
         b"begin"]  # fmt: skip
LENGTHS = [0, 1, -1, 100_000, 10**9, 2**31 - 1, -(2**31), 2**62]
PNG = b"\x89PNG\r\n\x1a\n"


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes of which some are changed, lost, doubled or moved; or entirely different bytes."""
    if draw(st.integers(0, 19)) == 0:
        return draw(st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
    for _ in range(draw(st.integers(1, 3))):
        content = draw(_damage(content))
    return content


@st.composite
def _damage(draw: st.DrawFn, content: bytes) -> bytes:
    # Damage is concentrated on headers and their beginnings, because sizes are stated there.
    near = min(len(content), draw(st.sampled_from([40, 400, len(content)])))
    start = draw(st.integers(0, near))
    stop = draw(st.integers(start, min(len(content), start + 40)))
    kind = draw(st.sampled_from("bytes length cut lost doubled moved word word words line".split()))
    if kind == "bytes":
        return content[:start] + draw(st.binary(min_size=1, max_size=4)) + content[start + 1 :]
    if kind == "length":
        form = draw(st.sampled_from(["<H", ">H", "<I", ">I", "<Q", ">Q"]))
        size = struct.calcsize(form)
        claim = draw(st.sampled_from(LENGTHS)) % 256**size
        return content[:start] + struct.pack(form, claim) + content[start + size :]
    if kind == "cut":
        return content[: draw(st.integers(0, len(content)))]
    if kind == "lost":
        return content[:start] + content[stop:]
    if kind == "doubled":
        return content[:stop] + content[start:]
    if kind == "moved":
        place = draw(st.integers(0, len(content)))
        return content[:place] + content[start:stop] + content[place + stop - start :]
    if kind == "line":
        lines = content.split(b"\n")
        line = draw(st.integers(0, len(lines) - 1))
        return b"\n".join(lines[:line] + lines[line : line + 1] * draw(st.sampled_from([0, 2])) + lines[line + 1 :])
    words = [found.span() for found in re.finditer(rb"[\w.+-]+", content[start : start + 2000])]
    if not words:
        return content + draw(st.sampled_from(WEIRD))
    first, last = (start + place for place in draw(st.sampled_from(words)))
    if kind == "word":
        return content[:first] + draw(st.sampled_from(WEIRD)) + content[last:]
    other = draw(st.sampled_from(words))
    (a, b), (c, d) = sorted([(first, last), (start + other[0], start + other[1])])
    return content if a == c else content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


@st.composite
def damaged_within(draw: st.DrawFn, content: bytes) -> bytes:
    """Correct the checksums, because they would detect most damage."""
    if content.startswith(PNG):
        content = PNG + draw(damaged(content[len(PNG) :]))
        return PNG + b"".join(_sealed_chunks(content[len(PNG) :]))
    with zipfile.ZipFile(io.BytesIO(content)) as old:
        members = {name: old.read(name) for name in old.namelist()}
    chosen = draw(st.sampled_from(sorted(members)))
    members[chosen] = draw(damaged(members[chosen]))
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", draw(st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]))) as new:
        for name, member in members.items():
            new.writestr(name, member)
    return file.getvalue()


def _sealed_chunks(content: bytes):
    while len(content) >= 12:
        length = struct.unpack(">I", content[:4])[0]
        if length > len(content) - 12:
            break
        yield content[: 8 + length] + struct.pack(">I", zlib.crc32(content[4 : 8 + length]))
        content = content[12 + length :]
    yield content


@cache
def whole(folder: Path, reader: str) -> tuple[Path, dict[Path, bytes]]:
    """Valid files in a separate folder: the path to read, and their contents."""
    folder = folder / reader
    folder.mkdir()
    path = READERS[reader].write(folder)
    READERS[reader].check(READERS[reader].read(path))
    return path, {file: file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


@st.composite
def cases(draw: st.DrawFn, files: dict[Path, bytes]) -> tuple[Path, bytes]:
    """One of the files, and its damaged contents."""
    file = draw(st.sampled_from(sorted(files)))
    content = files[file]
    is_sealed = content.startswith((PNG, b"PK"))
    within = is_sealed and draw(st.booleans())
    return file, draw(damaged_within(content) if within else damaged(content))


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused(folder: Path, reader: str, data: st.DataObject):
    path, files = whole(folder, reader)
    file, content = data.draw(cases(files))
    try:
        file.write_bytes(content)
        outcome(path, reader, folder / reader)
    finally:
        file.write_bytes(files[file])
