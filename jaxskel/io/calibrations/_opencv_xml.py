"""Reads the XML that OpenCV's FileStorage writes."""

from pathlib import Path
from xml.etree.ElementTree import Element

from ..files import fault
from ._opencv_yaml import Value, checked_matrix, scalar, words_of
from ._xml import read_xml

ROOT = "opencv_storage"


def read_opencv_xml(path: Path) -> dict[str, Value]:
    """The content by name: matrices, lists and single values. Nested elements are left out."""
    root = read_xml(path)
    if root.tag != ROOT:
        raise fault(path, None, f"is no XML of OpenCV, which begins with <{ROOT}>; export it again")
    found: dict[str, Value] = {}
    for element in root:
        if element.tag in found:
            raise fault(path, element.tag, "is there twice; keep one")
        if element.get("type_id") is not None or len(element) == 0:
            found[element.tag] = _value(path, element)
    return found


def _value(path: Path, element: Element) -> Value:
    if element.get("type_id") in ("opencv-matrix", "opencv-nd-matrix"):
        return _matrix(path, element)
    text = (element.text or "").strip()
    # A text with blanks is quoted, and so is each of several words.
    if text[:1] in ('"', "'") and text.count(text[0]) == 2 or len(text.split(maxsplit=1)) < 2:
        return scalar(text)
    return words_of(path, element.tag, text)


def _matrix(path: Path, element: Element) -> Value:
    key = element.tag
    data = words_of(path, key, element.findtext("data", ""))
    if element.get("type_id") == "opencv-nd-matrix":
        return data
    rows, columns = (element.findtext(word, "").strip() for word in ("rows", "cols"))
    if not all(count.isascii() and count.isdigit() and len(count) < 8 for count in (rows, columns)):
        raise fault(path, key, "is no matrix of rows, cols and data; export it again")
    data_type = element.findtext("dt", "d").strip().strip("\"'")
    return checked_matrix(path, key, int(rows), int(columns), data_type, data)
