"""Which reader takes a path."""

import os
from collections.abc import Mapping
from pathlib import Path

from .._archive import fault, keys_of
from . import _biocv, _colmap, _easymocap
from ._by_content import SUFFIXES, read_by_content
from ._calibration import Calibration, Contents, validated
from ._kalibr import is_kalibr, read_kalibr
from ._opencv import camera_files, holds_camera, read_opencv
from ._panoptic import read_panoptic
from ._projections import read_projection_archive, read_projection_array
from ._sequence import read_sequence_calibration
from ._toml import read_toml

_PICKLES = (".pickle", ".pkl", ".p", ".joblib", ".pt", ".pth")
_KNOWN = (
    "TOML (Pose2Sim, Anipose, FreeMoCap, Caliscope), .yml (OpenCV, EasyMocap, Kalibr), .xml (OpenCV, Metashape), "
    ".qca.txt (Qualisys, Theia3D), .xcp (Vicon), .mcal (Motive), .calibration (Skeletool), .calib (BioCV), .cal "
    "(TotalCapture), par.txt (Middlebury), cameras.txt with images.txt (COLMAP), .json (OpenCV, CMU Panoptic), .npz, "
    ".npy or .txt (projection matrices)"
)


def read_calibration(
    path: str | Path, *, unit: float | None = None, sizes: Mapping[str, tuple[int, int]] | None = None
) -> Calibration:
    """Read the calibration of a rig from a file or a folder of another tool's.

    TOML of Pose2Sim, Anipose, FreeMoCap and Caliscope; OpenCV's YAML, XML and JSON, a file or a folder with one a
    camera; EasyMocap's `intri.yml` and `extri.yml`; Kalibr's `camchain.yaml`; Qualisys `.qca.txt` and what its
    real-time protocol sends; Theia3D; Vicon `.xcp`; Motive `.mcal`; Metashape's XML; Skeletool; BioCV; TotalCapture;
    Middlebury; COLMAP's `cameras.txt` and `images.txt`; CMU Panoptic's JSON; projection matrices 3 x 4 in `.npy`,
    `.npz` or `.txt`; and the calibration of a sequence file. A pickle is never read.

    Args:
        path: The file, or the folder of files that belong together (or one of a pair).
        unit: Metres per unit of the file. By default that of the format: millimetres for Qualisys, Theia3D, Vicon,
            Skeletool and BioCV, centimetres for Panoptic, metres elsewhere; COLMAP, Middlebury and a Metashape chunk
            without reference have no scale, so it must be given there.
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
        return read_opencv(path) if holds_camera(path) else read_panoptic(path)
    if suffix in (".yml", ".yaml"):
        return read_kalibr(path) if is_kalibr(path) else read_opencv(path)
    contents = read_by_content(path) if suffix in SUFFIXES else None
    if contents is not None:
        return contents
    raise fault(path, None, f"is of no known format; these are read: {_KNOWN}")


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
    if any(file.lower().endswith(_biocv.SUFFIX) for file in names):
        return _biocv.read_biocv(path)
    if camera_files(path):
        return read_opencv(path)
    raise fault(path, None, f"is a folder without a calibration; these are read: {_KNOWN}")
