"""Silhouettes of a sequence file: the header is checked at once, the bits of a frame when they are read."""

import numpy as np
from jaxtyping import Int, UInt8

from ...cameras import Cameras
from ...recording import AbstractSilhouettes
from ..files import StoredRows, check_pixels, fault

# Number of bytes read at once, but at least one frame.
_CHUNK = 16 << 20


class StoredSilhouettes(AbstractSilhouettes):
    """Silhouettes in the file, as packed bits or as masks of 0 and 1 or 255.

    Reading raises a `ValueError`, one line that names the file, the key and how to mend it.
    """

    def __init__(self, rows: StoredRows, cameras: Cameras):
        self._rows, self._cameras = rows, cameras
        path, shape, dtype = rows.path, rows.shape, rows.dtype
        if len(shape) != 4 or dtype not in (np.uint8, np.bool_):
            raise fault(path, "silhouettes", f"{dtype} of shape {shape}; give uint8 (frames, cams, h, w/8)")
        frames, cams, height, across = shape
        width, tallest = (int(n) for n in cameras.size.max(axis=0))
        if frames == 0:
            raise fault(path, "silhouettes", "no frames; record at least one")
        if cams != len(cameras):
            raise fault(path, "silhouettes", f"{cams} cameras but K holds {len(cameras)}; give one view a camera")
        check_pixels(path, width, tallest, "size")
        packed_width = -(-width // 8)
        if height != tallest or across not in (packed_width, width) or (dtype.kind == "b" and across != width):
            raise fault(
                path,
                "silhouettes",
                f"masks of {height} rows by {across} do not fit size {width} x {tallest}; give {tallest} rows by "
                f"{packed_width} bytes (numpy.packbits over the width) or by {width} pixels",
            )
        self._are_packed = across == packed_width and dtype == np.uint8
        self.shape = frames, cams, height, packed_width

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        """Read some frames; consecutive ones are read together."""
        found = np.empty((len(frames), *self.shape[1:]), np.uint8)
        most = max(1, _CHUNK // int(np.prod(self._rows.shape[1:])))
        for run in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames) != 1) + 1):
            for start in range(0, len(run), most):
                some = run[start : start + most]
                first = int(frames[some[0]])
                found[some] = self._packed(self._rows.read(first, first + len(some)), first)
        return found

    def _packed(self, masks: np.ndarray, first: int) -> UInt8[np.ndarray, "some cams h w8"]:
        if self._are_packed:
            packed = masks
        else:
            if masks.dtype == np.uint8 and ((masks > 1) & (masks < 255)).any():
                raise self._fault("unpacked masks hold values between 1 and 255; threshold them first")
            packed = np.packbits(masks != 0, axis=-1)
        for camera, (w, h) in enumerate(self._cameras.size.tolist()):
            view = packed[:, camera]
            split = view[:, :, w // 8] & (0xFF >> w % 8) if w % 8 else view[:, :, :0]
            if split.any() or view[:, :, -(-w // 8) :].any() or view[:, h:].any():
                raise self._fault(
                    f"camera {self._cameras.names[camera]} has person bits outside of its {w} x {h} image in frame "
                    f"{first} or soon after; correct size, or pack with numpy.packbits in its usual bit order"
                )
        return packed

    def _fault(self, message: str) -> ValueError:
        return fault(self._rows.path, self._rows.key, message)
