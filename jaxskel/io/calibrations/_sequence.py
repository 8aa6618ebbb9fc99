"""The calibration in a sequence file, the project's own format: an `.npz` archive."""

from pathlib import Path
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...cameras import FISHEYE_COEFFICIENTS, Cameras
from ...recording import UP_AXES
from ..files import fault, numbers, short, switches, texts
from ._archives import checked_arrays
from ._calibration import CameraEntry, Contents


def read_sequence_calibration(path: Path) -> Contents:
    """Read ``K``, ``R``, ``t`` (m), and optionally ``size``, ``dist``, ``fisheye``, ``camera_names``, ``up``."""
    arrays = checked_arrays(path, ("K", "R", "t"), ("size", "dist", "fisheye", "camera_names", "up"))
    K = numbers(path, arrays, "K", (None, 3, 3))
    n = len(K)
    R = numbers(path, arrays, "R", (n, 3, 3))
    t = numbers(path, arrays, "t", None)
    if t.shape not in ((n, 3), (n, 3, 1)):
        raise fault(path, "t", f"has shape {t.shape}; give ({n}, 3)")
    dist = numbers(path, arrays, "dist", (n, None)) if "dist" in arrays else np.zeros((n, 0))
    wide = switches(path, arrays, "fisheye", n) if "fisheye" in arrays else np.zeros(n, bool)
    names = texts(path, arrays, "camera_names") if "camera_names" in arrays else [f"cam{i}" for i in range(n)]
    if len(names) != n:
        raise fault(path, "camera_names", f"holds {len(names)} names; give {n}, one for each camera of K")
    sizes: list[tuple[float, float] | None] = [None] * n
    if "size" in arrays:
        size = numbers(path, arrays, "size", None)
        if size.shape not in ((2,), (n, 2)):
            raise fault(path, "size", f"has shape {size.shape}; give (width, height) or one pair for each camera")
        sizes = [(float(width), float(height)) for width, height in np.broadcast_to(size, (n, 2))]
    # A rig with both kinds of lens has equally many coefficients of each, zero-padded behind the four of a fisheye.
    if dist.shape[1] > FISHEYE_COEFFICIENTS and not dist[wide, FISHEYE_COEFFICIENTS:].any():
        lenses = [row[:FISHEYE_COEFFICIENTS] if fish else row for row, fish in zip(dist, wide, strict=True)]
    else:
        lenses = list(dist)
    entries = [
        CameraEntry(*each) for each in zip(names, K, R, t.reshape(n, 3), lenses, sizes, wide.tolist(), strict=True)
    ]
    return Contents("sequence file", entries, 1.0, up_axis(path, arrays) if "up" in arrays else None)


def write_calibration(path: str | Path, cameras: Cameras, up: str | None = None) -> None:
    """Write a calibration under the keys of a sequence file.

    Args:
        path: File to write, `.npz`.
        cameras: The rig (world to camera, m).
        up: World axis that points up, such as "+Z", if known.
    """
    arrays: dict[str, Any] = {key: np.asarray(getattr(cameras, key)) for key in ("K", "R", "t", "size", "dist")}
    arrays["camera_names"] = np.array(cameras.names)
    if cameras.fisheye is not None:
        arrays["fisheye"] = np.asarray(cameras.fisheye)
    if up is not None:
        arrays["up"] = np.array(up)
    with written_whole(Path(path)) as file:
        np.savez_compressed(file, **arrays)


def up_axis(path: Path, arrays: dict[str, np.ndarray]) -> str:
    """Check `up`; the default is "+Z".

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    up = texts(path, arrays, "up") if "up" in arrays else ["+Z"]
    if len(up) != 1 or up[0] not in UP_AXES:
        raise fault(path, "up", f"give one of {', '.join(UP_AXES)}, not {short(arrays['up'])}")
    return up[0]
