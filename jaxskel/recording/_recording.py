"""A recording: synchronised silhouettes of one person in calibrated views, with what is known about the subject."""

from dataclasses import replace
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from .._math.up_axes import rotation_to_z_up
from .._runtime.kinds import told
from ..body import HUMAN_15, Skeleton, SkeletonTemplate
from ..cameras import Cameras
from ._silhouettes import Silhouettes


class Truth(eqx.Module):
    """Ground truth of a recording, for scoring only.

    Attributes:
        joints: Joints in the recording's world (m).
        tips: Limb tips in the recording's world (m).
        template: What these joints and tips are; the subject's skeleton may be of another template.

    Raises:
        ValueError: The template has another number of joints or tips.
    """

    joints: Float[np.ndarray, "frames joints 3"]
    tips: Float[np.ndarray, "frames tips 3"] | None = None
    template: SkeletonTemplate = eqx.field(static=True, default=HUMAN_15)

    def __check_init__(self):
        """Reject a template of other points."""
        for key, points, names in (
            ("joints", self.joints, self.template.joint_names),
            ("tips", self.tips, self.template.tip_names),
        ):
            if points is not None and points.shape[1] != len(names):
                raise ValueError(
                    f"{key}: are {points.shape[1]}, but the template {self.template.name} has {len(names)}; give the "
                    "template that they are of"
                )

    def __getitem__(self, index: slice | Int[np.ndarray, " some"]) -> "Truth":
        """The frames of a slice, or those of some indices."""
        return replace(self, joints=self.joints[index], tips=None if self.tips is None else self.tips[index])


class Recording(eqx.Module):
    """Silhouettes of one person in all views, with the cameras that define the world.

    Attributes:
        silhouettes: Packed bits (1 = person), as from `numpy.packbits` over the width; in memory, or read frame by
            frame.
        fps: Frames per second of these frames.
        up: World axis that points up: one of `UP_AXES`.
        frame_index: Number of each frame in the original material.
        skeleton: The subject's dimensions, if known.
        turns: Rotation of each camera's images after its calibration (degrees, clockwise), where known. `cameras`
            describe the images as they are now.
        data: What else is known of each frame, by names of your own, see `with_data`.
        hidden: Packed bits of the pixels where somebody else may stand before the person, so that nothing is known of
            the person there. None where all pixels are known.

    Raises:
        ValueError: The silhouettes are not packed bits of these cameras, or `fps` or `up` makes no sense.
    """

    cameras: Cameras
    silhouettes: Silhouettes
    fps: float
    up: str
    frame_index: Int[np.ndarray, " frames"]
    skeleton: Skeleton | None = None
    truth: Truth | None = None
    name: str = "recording"
    turns: Int[np.ndarray, " cams"] | None = None
    data: dict[str, Float[np.ndarray, "_ ..."]] = eqx.field(default_factory=dict)
    hidden: Silhouettes | None = None

    def __check_init__(self):
        """Reject silhouettes that are not those of the cameras, and facts that make no sense."""
        width, height = np.asarray(self.cameras.size).max(0).tolist()
        shape, wanted = self.silhouettes.shape, (len(self.cameras), height, -(-width // 8))
        kind = getattr(self.silhouettes, "dtype", np.dtype(np.uint8))
        if len(shape) != 4 or shape[1:] != wanted or kind != np.uint8:
            raise ValueError(
                f"{self.name}: silhouettes of shape {tuple(shape)}, {kind}; give packed bits of shape (frames, "
                f"{', '.join(map(str, wanted))}), as pack_silhouettes makes them of masks"
            )
        if self.hidden is not None and self.hidden.shape != shape:
            raise ValueError(
                f"{self.name}: hidden: has shape {self.hidden.shape}; give that of the silhouettes, {shape}"
            )
        if len(self.frame_index) != shape[0]:
            raise ValueError(f"{self.name}: frame_index holds {len(self.frame_index)} numbers for {shape[0]} frames")
        if not 0 < self.fps < np.inf:
            raise ValueError(f"{self.name}: fps is {self.fps}; give a positive number of frames per second")
        rotation_to_z_up(self.up)  # refuses what is no axis
        for name, array in self.data.items():
            if array.shape[:1] != shape[:1]:
                raise ValueError(
                    f"{self.name}: {name}: has shape {array.shape}, but there are {shape[0]} frames; give one row for "
                    "each frame, NaN where nothing is known"
                )

    def __len__(self) -> int:
        return len(self.silhouettes)

    def __getitem__(self, index: slice | Int[np.ndarray, " some"]) -> "Recording":
        """The frames of a slice, or those of some indices."""
        truth = None if self.truth is None else self.truth[index]
        data = {name: array[index] for name, array in self.data.items()}
        return replace(
            self, silhouettes=self.silhouettes[index], frame_index=self.frame_index[index], truth=truth, data=data,
            hidden=None if self.hidden is None else self.hidden[index],
        )  # fmt: skip

    def named(self, name: str) -> "Recording":
        """The same with another name."""
        return replace(self, name=name)

    def with_data(self, /, **data: Any) -> "Recording":
        """The same with more data, for terms of your own: numbers with the frames axis first, NaN where missing.

        A term finds the row of its frame in ``observed.data``, see [`Observed`][jaxskel.refinement.terms.Observed].
        Positions must be in a world with z up, see `rotation_to_z_up`: that is where terms see the body.

        Raises:
            ValueError: An array is not of numbers, or has not one row for each frame.
        """
        return replace(self, data=self.data | {name: _numbers(name, array) for name, array in data.items()})


def _numbers(name: str, given: Any) -> Float[np.ndarray, "frames ..."]:
    array = np.asarray(given)
    if array.dtype.kind not in "biuf" or array.ndim == 0:
        what = f"of {array.dtype}, shape {array.shape}" if isinstance(given, np.ndarray) else told(given)
        raise ValueError(f"{name}: is {what}; give an array of numbers with one row for each frame")
    return array.astype(np.float32)


def pack_silhouettes(masks: Bool[np.ndarray, "frames cams h w"]) -> UInt8[np.ndarray, "frames cams h w8"]:
    """Pack boolean masks (True = person) into the bits that a `Recording` holds.

    Raises:
        ValueError: The masks are no array of that shape and kind.
    """
    if not isinstance(masks, np.ndarray) or masks.ndim != 4 or masks.dtype.kind not in "biu":
        what = f"of shape {masks.shape}, {masks.dtype}" if isinstance(masks, np.ndarray) else told(masks)
        raise ValueError(f"masks: are {what}; give booleans of shape (frames, cams, h, w)")
    return np.packbits(masks, axis=-1)


def unpack_silhouettes(packed: UInt8[np.ndarray, "*batch h w8"], width: int) -> Bool[np.ndarray, "*batch h w"]:
    """Unpack bits into boolean masks of the given width (px).

    Raises:
        ValueError: Rows of this length do not hold that width; masks that are not packed, for example.
    """
    if packed.dtype != np.uint8 or not 8 * packed.shape[-1] - 7 <= width <= 8 * packed.shape[-1]:
        raise ValueError(
            f"packed: {packed.shape[-1]} of {packed.dtype} in a row do not hold {width} pixels; give its width"
        )
    return np.unpackbits(packed, axis=-1, count=width).view(bool)


def unpack_view(
    packed: UInt8[np.ndarray, "*batch h w8"], size: Int[np.ndarray, "2"]
) -> Bool[np.ndarray, "*batch height width"]:
    """Unpack the masks of one view, of its own width and height (px): those of a rig are padded to the largest."""
    width, height = size.tolist()
    return unpack_silhouettes(packed[..., :height, : -(-width // 8)], width)
