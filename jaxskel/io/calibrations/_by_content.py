"""Chooses the reader of XML and text files, whose suffixes many formats share, by their content."""

import re
from pathlib import Path

from ..files import fault
from . import _biocv, _middlebury, _motive, _skeletool, _totalcapture
from ._calibration import Contents
from ._metashape import read_metashape
from ._opencv import read_opencv
from ._opencv_xml import ROOT as OPENCV
from ._projections import read_projection_text
from ._qualisys import PROTOCOL, read_qualisys
from ._text import read_text, to_number
from ._theia import is_theia, read_theia
from ._vicon import read_vicon
from ._xml import parse_xml

SUFFIXES = (".txt", ".xml", ".xcp", ".mcal", ".cal", ".calib", ".calibration", ".par", "")
_CAPTURY = "tc camera calibration"
# Number of words that are examined: those of a matrix.
_BEGIN = 12


def read_by_content(path: Path) -> Contents | None:
    """Read a file of XML or text; None if its format is unknown."""
    suffix = path.suffix.lower()
    if suffix == _motive.SUFFIX:
        return _motive.read_motive(path)
    text = read_text(path, otherwise=_motive.BINARY if suffix == ".cal" else None)
    if text.lstrip().startswith("<"):
        return _of_xml(path, parse_xml(path, text).tag)
    if text.startswith(_skeletool.HEADER):
        return _skeletool.read_skeletool(path)
    if text.startswith(_CAPTURY):
        raise fault(path, None, "is a calibration of The Captury, which is not read; export Skeletool's or OpenCV's")
    for is_it, read in (
        (_biocv.is_biocv, _biocv.read_biocv),
        (_totalcapture.is_totalcapture, _totalcapture.read_totalcapture),
        (_middlebury.is_middlebury, _middlebury.read_middlebury),
    ):
        if is_it(text):
            return read(path)
    if suffix == _biocv.SUFFIX:
        return _biocv.read_biocv(path)  # to get a message about what is wrong with it
    return read_projection_text(path) if suffix == ".txt" and _is_matrix(text) else None


def _of_xml(path: Path, root: str) -> Contents | None:
    if root == "calibration" or root.startswith(PROTOCOL):
        return read_theia(path) if is_theia(path) else read_qualisys(path)
    read = {"Cameras": read_vicon, OPENCV: read_opencv, "document": read_metashape, _motive.ROOT: _motive.read_motive}
    return read[root](path) if root in read else None


def _is_matrix(text: str) -> bool:
    """Whether a text begins with the numbers of a matrix, possibly after the word CONTOUR."""
    words = [found[0] for found, _ in zip(re.finditer(r"\S+", text), range(_BEGIN + 1), strict=False)]
    words = words[words[:1] == ["CONTOUR"] :]
    return bool(words) and all(isinstance(to_number(word), float) for word in words[:_BEGIN])
