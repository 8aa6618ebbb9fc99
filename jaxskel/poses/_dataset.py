"""Points over time as an xarray dataset in the layout of `movement`, a package that analyses tracks of animals."""

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

if TYPE_CHECKING:
    import xarray


def poses_dataset(
    names: tuple[str, ...],
    positions: Float[np.ndarray, "frames points 3"],
    confidence: Float[np.ndarray, "frames points"],
    frame_index: Int[np.ndarray, " frames"],
    status: list[str],
    fps: float,
    up: str,
) -> "xarray.Dataset":
    """One individual, ``person``, by `movement`'s layout of poses; see `Poses.to_xarray`.

    Raises:
        ImportError: xarray is not installed.
    """
    xarray = _xarray()
    return xarray.Dataset(
        {
            "position": (("time", "space", "keypoints", "individuals"), positions.swapaxes(1, 2)[..., None]),
            "confidence": (("time", "keypoints", "individuals"), confidence[..., None]),
        },
        coords={
            "time": np.arange(len(positions)) / fps, "space": ["x", "y", "z"], "keypoints": list(names),
            "individuals": ["person"], "frame_index": ("time", frame_index), "status": ("time", np.array(status, str)),
        },
        attrs={
            "source_software": "jaxskel", "ds_type": "poses", "fps": float(fps), "time_unit": "seconds",
            "space_unit": "m", "up": up,
        },
    )  # fmt: skip


def _xarray() -> Any:
    try:
        import xarray  # an optional dependency
    except ImportError as error:
        raise ImportError('datasets are made by xarray, which is missing: pip install "jaxskel[xarray]"') from error
    return xarray
