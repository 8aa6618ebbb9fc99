"""MVHumanNet's pair of calibration files, `camera_intrinsics.json` and `camera_extrinsics.json`."""

from pathlib import Path, PurePosixPath

from ..files import fault
from ._calibration import CameraEntry, Contents
from ._json import check_count, given, read_json, table_of
from ._text import natural_order

PAIR = ("camera_intrinsics.json", "camera_extrinsics.json")
_SCALE = (
    "its translations are in thousandths of what camera_scale.pkl holds, a pickle, which is never read; give unit = "
    "0.001 times that number"
)


def read_mvhumannet(folder: Path) -> Contents:
    """Read the pair of files in a folder: one lens for all cameras, poses from world to camera, no image sizes.

    A camera's name is the last word of its key, ``CC32871A004`` in ``1_CC32871A004.png``, like its folder of images.
    The scale of lengths is stored in a pickle, so the unit must be given. Intrinsics apply to the full images;
    ``images_lr`` and ``fmask_lr`` of the data set have half the width and height.
    """
    lens_path, path = (folder / name for name in PAIR)
    lens = table_of(lens_path, "of all files", "the lens", read_json(lens_path))
    poses = table_of(path, "of all files", "the list of cameras", read_json(path))
    check_count(path, len(poses))
    if not poses:
        raise fault(path, None, "holds no camera; download it again")
    K = given(lens_path, "of all files", lens, "intrinsics", 9).reshape(3, 3)
    dist = given(lens_path, "of all files", lens, "dist") if lens.get("dist") is not None else K[:0, 0]
    names = _names(list(poses))
    entries = []
    for name, key in sorted(zip(names, poses, strict=True), key=lambda pair: natural_order(pair[0])):
        pose = table_of(path, name, key, poses[key])
        R = given(path, name, pose, "rotation", 9).reshape(3, 3)
        entries.append(CameraEntry(name, K, R, given(path, name, pose, "translation", 3), dist, None))
    return Contents("MVHumanNet", entries, None, None, scale_is=_SCALE)


def _names(keys: list[str]) -> list[str]:
    stems = [PurePosixPath(key).stem for key in keys]
    words = [stem.split("_")[-1] for stem in stems]
    return next(names for names in (words, stems, keys) if len(set(names)) == len(keys) and all(names) or names is keys)
