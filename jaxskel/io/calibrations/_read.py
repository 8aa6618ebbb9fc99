"""Which reader takes a path."""

import os
from collections.abc import Mapping
from pathlib import Path

from .._archive import fault, keys_of
from . import _colmap, _easymocap
from ._calibration import Calibration, Contents, validated
from ._opencv import read_opencv
from ._panoptic import read_panoptic
from ._projections import read_projection_archive, read_projection_array, read_projection_text
from ._qualisys import read_qualisys
from ._sequence import read_sequence_calibration
from ._text import read_text
from ._toml import read_toml
from ._vicon import read_vicon

_PICKLES = (".pickle", ".pkl", ".p", ".joblib", ".pt", ".pth")
_KNOWN = (
    "TOML (Pose2Sim, Anipose, FreeMoCap, Caliscope), .yml (OpenCV, EasyMocap), .qca.txt (Qualisys), .xcp (Vicon), "
    "cameras.txt with images.txt (COLMAP), .json (CMU Panoptic), .npz, .npy or .txt (projection matrices)"
)


def read_calibration(
    path: str | Path, *, unit: float | None = None, sizes: Mapping[str, tuple[int, int]] | None = None
) -> Calibration:
    """Read the calibration of a rig from a file or a folder of another tool's.

    TOML of Pose2Sim, Anipose, FreeMoCap and Caliscope; OpenCV's YAML, a file or a folder with one a camera;
    EasyMocap's `intri.yml` and `extri.yml`; Qualisys `.qca.txt`; Vicon `.xcp`; COLMAP's `cameras.txt` and
    `images.txt`; CMU Panoptic's JSON; projection matrices 3 x 4 in `.npy`, `.npz` or `.txt`; and the calibration of
    a sequence file. A pickle is never read.

    Args:
        path: The file, or the folder of files that belong together (or one of a pair).
        unit: Metres per unit of the file. By default that of the format: millimetres for Qualisys and Vicon,
            centimetres for Panoptic, metres elsewhere; COLMAP has no scale, so it must be given there.
        sizes: Width and height of each camera's images (px) by its name, for formats without them. Where the file
            has them too they must be the same.

    Raises:
        ValueError: One line that names the file, the camera and how to mend it.
    """
    path = Path(path)
    return validated(path, contents_of(path), unit, sizes)


def contents_of(path: Path) -> Contents:
    """What a file or a folder holds; its reader is chosen by name where that settles it, otherwise by content."""
    name, suffix = path.name.lower(), path.suffix.lower()
    if suffix in _PICKLES:
        raise fault(path, None, "is a pickle, which can run any program and is never read; save numpy.savez instead")
    if os.path.isdir(path):
        return _of_folder(path)
    if name in _easymocap.PAIR:
        return _easymocap.read_easymocap(path.parent)
    if name in _colmap.PAIR:
        return _colmap.read_colmap(path.parent)
    if suffix == ".npz":
        is_ours = {"K", "R", "t"} <= set(keys_of(path))
        return read_sequence_calibration(path) if is_ours else read_projection_archive(path)
    if suffix == ".npy":
        return read_projection_array(path)
    if suffix == ".toml":
        return read_toml(path)
    if suffix == ".json":
        return read_panoptic(path)
    if suffix in (".yml", ".yaml"):
        return read_opencv(path)
    if suffix == ".xcp":
        return read_vicon(path)
    if name.endswith(".qca.txt"):
        return read_qualisys(path)
    if suffix in (".txt", ".xml"):
        start = read_text(path).lstrip()
        if not start.startswith("<"):
            return read_projection_text(path)
        return read_vicon(path) if "<Cameras" in start else read_qualisys(path)
    raise fault(path, None, f"is of no known format; these are read: {_KNOWN}")


def beside(name: str) -> list[str]:
    """Of a pair of files that belong together, the other one, as a path like the one that is given."""
    folder, _, last = name.rpartition("/")
    pair = next((pair for pair in (_easymocap.PAIR, _colmap.PAIR) if last.lower() in pair), ())
    return [f"{folder}/{other}" if folder else other for other in pair if other != last]


def _of_folder(path: Path) -> Contents:
    try:
        names = {file.name for file in path.iterdir()}
    except OSError as error:
        raise fault(path, None, f"cannot be opened ({error.strerror}); check the path") from None
    found = [reader for pair, reader in (
        (_easymocap.PAIR, _easymocap.read_easymocap), (_colmap.PAIR, _colmap.read_colmap)
    ) if names >= set(pair)]  # fmt: skip
    if len(found) > 1:
        raise fault(path, None, "holds the calibrations of EasyMocap and of COLMAP; give one of the files")
    if found:
        return found[0](path)
    if "cameras.bin" in names:
        raise fault(path, None, "is a binary COLMAP model; run colmap model_converter --output_type TXT first")
    if any(file.lower().endswith((".yml", ".yaml")) for file in names):
        return read_opencv(path)
    raise fault(path, None, f"is a folder without a calibration; these are read: {_KNOWN}")
