"""Cases that are calibrations of other tools, all for the rig of the good scene."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from _case import Act, Case, NotAsExpected, Rows, good_scene, wanted

from jaxskel import Cameras
from jaxskel.io.calibrations import choose_views, read_calibration

# Files have 12 digits or more; other rigs differ by much more than this (m, px).
_SAME = 1e-6


def aligned(cameras: Cameras, good: Cameras) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and shift from the world of the good rig to that of another one, by their first cameras."""
    own = np.asarray(cameras.R[0]).T
    return own @ np.asarray(good.R[0]), own @ (np.asarray(good.t[0]) - np.asarray(cameras.t[0]))


def difference(cameras: Cameras, good: Cameras, same_world: bool = True) -> float:
    """Largest difference between the numbers of two rigs (m, px)."""
    turn, shift = (np.eye(3), np.zeros(3)) if same_world else aligned(cameras, good)
    pairs = [(cameras.K, good.K), (cameras.size, good.size), (cameras.dist, good.dist)]
    pairs += [(cameras.R @ turn, good.R), (cameras.R @ shift + cameras.t, good.t)]
    return max(float(np.abs(one - other).max()) for one, other in pairs)


def meeting(cameras: Cameras) -> float:
    """Largest distance (m) of the optical axes from the point that is nearest to all of them."""
    across = np.eye(3) - np.einsum("ci,cj->cij", cameras.R[:, 2], cameras.R[:, 2])
    point = np.linalg.solve(across.sum(0), np.einsum("cij,cj->i", across, cameras.centres))
    return float(np.linalg.norm(np.einsum("cij,cj->ci", across, point - cameras.centres), axis=1).max())


def same_rig(
    *files: str,
    unit: float | None = None,
    sizes: str = "",
    as_format: str = "",
    only: tuple[int, ...] | None = None,
    same_world: bool = True,
) -> Act:
    """The files are read as the rig of the good scene.

    Args:
        files: Paths in the case.
        unit: Metres per unit, where the format has none.
        sizes: Names of the cameras whose image sizes must be given.
        as_format: Format that must be detected.
        only: The cameras that the file has; all by default.
        same_world: Whether the world is that of the good scene; otherwise that of the first camera.
    """

    def act(case: Case) -> str:
        good = good_scene(case.root).cameras
        good = good if only is None else good[list(only)]
        given: Mapping[str, tuple[int, int]] = {name: (640, 480) for name in sizes.split()}
        told, worst = set(), 0.0
        for file in files:
            found = read_calibration(case.path / file, unit=unit, sizes=given)
            wanted(len(found.cameras) == len(good), f"{file}: {len(found.cameras)} cameras")
            off = difference(found.cameras, good, same_world)
            axes = meeting(found.cameras)
            wanted(off < _SAME, f"{file}: read as {found.format}, off by {off:.3g}; axes meet within {axes:.3g} m")
            wanted(as_format in found.format, f"{file}: read as {found.format}")
            told.add(found.format)
            worst = max(worst, off)
        return f"{', '.join(sorted(told))}: the rig, to {worst:.0e}"

    return act


def _unposed(case: Case) -> str:
    file = "camera_array.toml"
    told = same_rig(file, only=(0, 1, 2, 4))(case)
    names = tuple(f"cam_{i}" for i in range(5))
    try:
        choose_views(read_calibration(case.path / file), names)
    except ValueError as error:
        wanted("cam_3" in str(error) and "ignore = true" in str(error), str(error))
        return f"{told}; a view of cam_3: not posed"
    raise NotAsExpected("a view of cam_3 is taken")


def _mvhumannet(case: Case) -> str:
    try:
        read_calibration(case.path)
    except ValueError as error:
        wanted("camera_scale.pkl" in str(error) and "give unit" in str(error), str(error))
    else:
        raise NotAsExpected("read without a scale")
    # The extrinsics of the case are in metres.
    names = " ".join(f"CC32871A{i:03d}" for i in range(5))
    return f"without unit refused; {same_rig('.', unit=1.0, sizes=names)(case)}"


def _spelt(case: Case) -> str:
    folders = sorted(path.name for path in case.path.iterdir() if path.is_dir())
    wanted(len(folders) == 3, f"holds {os.listdir(case.path)}")
    names = " ".join(sorted(path.name for path in Path(case.path, folders[0]).iterdir()))
    return f"{len(folders)} spellings, {same_rig(*folders, unit=1e-3, sizes=names)(case)}"


_RIG = "the rig of the good scene"
RIGS: Rows = {
    "aist_settings": (f"{_RIG}, from cm", same_rig("setting1.json")),
    "biocv": (f"{_RIG}, 0.998 taken out", same_rig(".")),
    "caliscope_unposed": ("4 cameras; cam_3 not posed", _unposed),
    "multical": (f"{_RIG}, from its first camera", same_rig("calibration.json", same_world=False)),
    "mvhumannet": ("asks for unit; no pickle is read", _mvhumannet),
    "open3d_trajectory": (_RIG, same_rig("trajectory.json")),
    "opencv_xml": (f"{_RIG}, three times", _spelt),
    "qualisys_1440p": (_RIG, same_rig("a.qca.txt")),
    "qualisys_hybrid": (f"{_RIG}, all five", same_rig("a.qca.txt")),
    "qualisys_rt_parameters": (_RIG, same_rig("a.xml")),
    "skeletool": (f"{_RIG}, from mm", same_rig("camera.calibration")),
    "theia3d": (f"{_RIG}, not as Qualisys", same_rig("Subject_2_calibration.txt", as_format="Theia3D")),
    "totalcapture": (_RIG, same_rig("calibration.cal")),
    "voxelpose_shelf": (f"{_RIG}, from mm", same_rig("calibration_shelf.json", sizes="0 1 2 3 4")),
}
