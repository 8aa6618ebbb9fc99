"""Reads untrusted XML."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..files import fault
from ._calibration import camera_fault
from ._text import read_text, split_numbers

# Largest file (bytes): a camera takes 3 kB; elements take a hundred times the memory of their text.
_MAX_BYTES = 2_000_000


def read_xml(path: Path) -> ElementTree.Element:
    """The root of a file without a document type, whose entities could fill the memory or name other files."""
    return parse_xml(path, read_text(path, _MAX_BYTES))


def parse_xml(path: Path, text: str) -> ElementTree.Element:
    """The root of XML text."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise fault(path, None, "has a DOCTYPE, which no calibration needs; take it out")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise fault(path, None, f"is not XML ({error}); export the calibration again") from None


def attribute(path: Path, camera: str, attributes: Mapping[str, str], key: str, count: int = 1) -> np.ndarray:
    """The numbers of an attribute, separated by blanks."""
    if key not in attributes:
        raise camera_fault(path, camera, f"{key} is missing; calibrate the camera, or take it out")
    return split_numbers(path, camera, key, attributes[key], count)
