"""Reads a calibration in any supported format: chooses the reader for a path."""

import os
from collections.abc import Mapping
from pathlib import Path

from ..files import fault, keys_of
from . import _biocv, _colmap, _easymocap, _mvhumannet
from ._by_content import SUFFIXES, read_by_content
from ._calibration import Calibration, Contents, validated
from ._folder import sorted_files
from ._json_kinds import read_json_file, read_json_folder
from ._kalibr import is_kalibr, read_kalibr
from ._opencv import camera_files, holds_camera, read_opencv
from ._projections import read_projection_archive, read_projection_array
from ._sequence import read_sequence_calibration
from ._toml import read_toml

# Pairs of files that belong together; either may be given.
_PAIRS = {
    "EasyMocap": (_easymocap.PAIR, _easymocap.read_easymocap),
    "COLMAP": (_colmap.PAIR, _colmap.read_colmap),
    "MVHumanNet": (_mvhumannet.PAIR, _mvhumannet.read_mvhumannet),
}
_PICKLES = (".pickle", ".pkl", ".p", ".joblib", ".pt", ".pth")
_KNOWN = (
    "TOML (Pose2Sim, Anipose, FreeMoCap, Caliscope), .yml (OpenCV, EasyMocap, Kalibr), .xml (OpenCV, Metashape), "
    ".qca.txt (Qualisys, Theia3D), .xcp (Vicon), .mcal (Motive), .calibration (Skeletool), .calib (BioCV), .cal "
    "(TotalCapture), par.txt (Middlebury), cameras.txt with images.txt (COLMAP), .json (OpenCV, CMU Panoptic, "
    "VoxelPose, multical, calib.io, Open3D, AIST++, MVHumanNet, nerfstudio, or K, R and t by their names), .npz, .npy, "
    ".txt or .json (projection matrices)"
)


def read_calibration(
    path: str | Path, *, unit: float | None = None, sizes: Mapping[str, tuple[int, int]] | None = None
) -> Calibration:
    """Read the calibration of a rig from a file or a folder of another tool.

    Formats: TOML of Pose2Sim, Anipose, FreeMoCap and Caliscope; OpenCV's YAML, XML and JSON, a file or a folder with
    one for each camera; EasyMocap's `intri.yml` and `extri.yml`; Kalibr's `camchain.yaml`; Qualisys `.qca.txt` and the
    parameters of its real-time protocol; Theia3D; Vicon `.xcp`; Motive `.mcal`; Metashape's XML; Skeletool; BioCV;
    TotalCapture; Middlebury; COLMAP's `cameras.txt` and `images.txt`; JSON of CMU Panoptic, VoxelPose (Campus, Shelf),
    multical, calib.io, Open3D, AIST++, MVHumanNet (`camera_intrinsics.json` and `camera_extrinsics.json`), nerfstudio
    and instant-ngp, or written by hand (K, R and t, one object or file for each camera); 3 x 4 projection matrices in
    `.npy`, `.npz`, `.txt` or JSON; and the calibration of a sequence file. Pickles are never read. Cameras without a
    pose are left out.

    Args:
        path: The file, or the folder of files that belong together (or one of a pair).
        unit: Metres per unit of the file. The default is that of the format: millimetres for Qualisys, Theia3D, Vicon,
            Skeletool, BioCV and VoxelPose, centimetres for Panoptic and AIST++, metres elsewhere. COLMAP, Middlebury,
            MVHumanNet, nerfstudio and a Metashape chunk without reference have no scale and need it.
        sizes: Width and height of each camera's images (px) by its name, for formats without them. If the file has
            them too, they must be equal.

    Raises:
        ValueError: One line that names the file, the camera and how to mend it.
    """
    path = Path(path)
    return validated(path, contents_of(path), unit, sizes)


def contents_of(path: Path) -> Contents:
    """Unvalidated content of a file or folder; the reader is chosen by name, or else by content.

    Raises:
        ValueError: No reader takes the file; pickles are never read.
    """
    name, suffix = path.name.lower(), path.suffix.lower()
    if suffix in _PICKLES:
        raise fault(path, None, "is a pickle, which can run any program and is never read; save numpy.savez instead")
    if os.path.isdir(path):
        return _of_folder(path)
    for pair, read in _PAIRS.values():
        if name in pair:
            return read(path.parent)
    if suffix == ".npz":
        is_ours = {"K", "R", "t"} <= set(keys_of(path))
        return read_sequence_calibration(path) if is_ours else read_projection_archive(path)
    if suffix == ".npy":
        return read_projection_array(path)
    if suffix == ".toml":
        return read_toml(path)
    if suffix == ".json":
        return read_opencv(path) if holds_camera(path) else _known(path, read_json_file(path))
    if suffix in (".yml", ".yaml"):
        return read_kalibr(path) if is_kalibr(path) else read_opencv(path)
    return _known(path, read_by_content(path) if suffix in SUFFIXES else None)


def _known(path: Path, contents: Contents | None) -> Contents:
    if contents is None:
        what = "a folder without a calibration" if os.path.isdir(path) else "of no known format"
        raise fault(path, None, f"is {what}; these are read: {_KNOWN}")
    return contents


def beside(name: str) -> list[str]:
    """The other file of a pair, as a path like the given one; empty if the file has no partner."""
    folder, _, last = name.rpartition("/")
    pair = next((pair for pair, _ in _PAIRS.values() if last.lower() in pair), ())
    return [f"{folder}/{other}" if folder else other for other in pair if other != last]


def _of_folder(path: Path) -> Contents:
    try:
        names = {file.name for file in path.iterdir()}
    except OSError as error:
        raise fault(path, None, f"cannot be opened ({error.strerror}); check the path") from None
    found = {tool: read for tool, (pair, read) in _PAIRS.items() if names >= set(pair)}
    if len(found) > 1:
        raise fault(path, None, f"holds the calibrations of {' and of '.join(found)}; give one of the files")
    if found:
        return next(iter(found.values()))(path)
    if "cameras.bin" in names:
        raise fault(path, None, "is a binary COLMAP model; run colmap model_converter --output_type TXT first")
    if any(file.lower().endswith(_biocv.SUFFIX) for file in names):
        return _biocv.read_biocv(path)
    if camera_files(path):
        return read_opencv(path)
    files = sorted_files(path, ".json")
    return _known(path, read_json_folder(path, files) if files else None)
