"""Lists the changes that may explain why images differ in size from the calibrated ones."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...cameras import ImageChange
from ...outlines import ConvexOutline

Size = tuple[float, float]
# Horizontal and vertical scales closer than this (relative) count as one scale: sizes are rounded to even pixels.
_ONE_SCALE = 0.01
# Codecs and sensors pad sizes to a multiple of this (px).
_BLOCK = 16
# Two changes count as alike if no point moves by more than this share of the calibrated image's longer side: it shifts
# a joint at 4 m by a centimetre or two, as much as calibrations err.
_ALIKE = 0.005


@dataclass(frozen=True)
class Choice:
    """One possible change of images.

    Attributes:
        told: The change, in words that follow "the images are".
        mirrored: Left and right were exchanged before the change, which no camera model can express.
        usual: A usual change, beside which other changes that the sizes allow are very unlikely.
    """

    told: str
    change: ImageChange
    mirrored: bool = False
    usual: bool = False

    def in_calibrated(self, outline: ConvexOutline, image: Size, calibrated: Size) -> ConvexOutline:
        """Map an outline from the image (px) to the calibrated image (px)."""
        uv = outline.uv
        if self.mirrored:
            uv = np.stack([image[0] - 1 - uv[:, 0], uv[:, 1]], 1)
        return ConvexOutline(_moved(np.linalg.inv(self.change.matrix(calibrated)), uv), outline.cut)

    def is_alike(self, other: "Choice", image: Size, calibrated: Size) -> bool:
        """Whether the other choice has nearly the same effect."""
        if self.mirrored != other.mirrored:
            return False
        corners = np.array([(u, v) for u in (0, image[0]) for v in (0, image[1])], float)
        one, two = (_moved(np.linalg.inv(each.change.matrix(calibrated)), corners) for each in (self, other))
        return bool(np.abs(one - two).max() <= _ALIKE * max(calibrated))

    def lines(self, image: Size, calibrated: Size) -> list[str]:
        """Lines of a `recording.toml` for this choice."""
        change, found = self.change, []
        if change == ImageChange():
            return [] if image == calibrated else [f"calibrated_size = [{calibrated[0]:g}, {calibrated[1]:g}]"]
        if change.turn:
            found.append(f"turn = {change.turn}")
        if change.crop != (0.0, 0.0) or not _same(change.size_of_all(calibrated), image):
            found.append(f"crop = [{change.crop[0]:.10g}, {change.crop[1]:.10g}]")
        across, down = change.scale
        if (across, down) != (1.0, 1.0):
            found.append(f"scale = {across:.10g}" if across == down else f"scale = [{across:.10g}, {down:.10g}]")
        return found


def choices_for(calibrated: Size, image: Size) -> list[Choice]:
    """All choices for two sizes, likeliest first.

    The whole calibrated image was scaled; or turned by 90 or 270 degrees; or cut or padded, around the middle or at one
    side; or scaled until it fits or fills the image, and padded or cut.

    Args:
        calibrated: Width and height of the calibrated images (px).
        image: Width and height of the images now (px).
    """
    found: list[Choice] = []
    for turn in (0, 90, 270):
        width, height = ImageChange(turn).turned_size(calibrated)
        across, down = image[0] / width, image[1] / height
        turned = f"turned by {turn} degrees clockwise" if turn else ""
        is_one = abs(across / down - 1) < _ONE_SCALE
        if turn and (across, down) == (1, 1):
            found.append(Choice(turned, ImageChange(turn)))
            continue
        is_block = all(_is_block(*lengths) for lengths in ((width, image[0]), (height, image[1])))
        if is_block:
            told = f"cut or padded at the right or bottom to a multiple of {_BLOCK} px, as is usual"
            found.append(Choice(_joined(turned, told), ImageChange(turn), usual=True))
        if is_one or not turn:
            scaled = "scaled" if is_one else "scaled across and down by different factors"
            found.append(Choice(_joined(turned, scaled), ImageChange(turn, scale=(across, down))))
        if turn and not is_block:
            continue
        for where, part in (("on both sides", 0.5), ("at the right or bottom", 0.0), ("at the left or top", 1.0)):
            crop = part * (width - image[0]), part * (height - image[1])
            found.append(Choice(_joined(turned, f"cut or padded {where}"), ImageChange(turn, crop)))
        for factor, told in ((min(across, down), "scaled to fit and padded"), (max(across, down), "scaled and cut")):
            shown = image[0] / factor, image[1] / factor
            for where, part in (("on both sides", 0.5), ("at the right or bottom", 0.0)):
                crop = part * (width - shown[0]), part * (height - shown[1])
                found.append(Choice(_joined(turned, f"{told} {where}"), ImageChange(turn, crop, (factor, factor))))
    different: list[Choice] = []
    for choice in found:
        if not any(_same_change(choice.change, other.change) for other in different):
            different.append(choice)
    return different


def _is_block(calibrated: float, image: float) -> bool:
    """Whether two lengths are equal, or one is the other padded to whole blocks (px)."""
    less, more = sorted((calibrated, image))
    return less == more or more == _BLOCK * math.ceil(less / _BLOCK)


def _joined(*parts: str) -> str:
    return " and ".join(part for part in parts if part)


def _same(one: Size, other: Size) -> bool:
    return max(abs(one[0] - other[0]), abs(one[1] - other[1])) < 0.01


def _same_change(one: ImageChange, other: ImageChange) -> bool:
    numbers = [np.array([*change.crop, *(1000 * s for s in change.scale)]) for change in (one, other)]
    return one.turn == other.turn and bool(np.abs(numbers[0] - numbers[1]).max() < 0.01)


def _moved(matrix: Float[np.ndarray, "3 3"], uv: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    return uv @ matrix[:2, :2].T + matrix[:2, 2]
