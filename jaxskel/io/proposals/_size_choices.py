"""What may have been done to images whose size is not that of the calibrated ones."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...cameras import ImageChange
from ...outlines import ConvexOutline

Size = tuple[float, float]
# Scales across and down that differ by less are one: sizes are rounded to even numbers of pixels.
_ONE_SCALE = 0.01
# Codecs and sensors fill sizes up to a multiple of 16 px.
_BLOCK = 16
# Changes that move no point by more than this part of the calibrated image's longer side from each other are alike: a
# joint 4 m away is off by a centimetre or two, as much as calibrations are.
_ALIKE = 0.005


@dataclass(frozen=True)
class Choice:
    """One thing that may have been done to images."""

    told: str
    """In words that follow "the images are"."""
    change: ImageChange
    mirrored: bool = False
    """Left and right were exchanged before the change: no camera sees that."""
    usual: bool = False
    """What else the sizes allow is unheard of."""

    def in_calibrated(self, outline: ConvexOutline, image: Size, calibrated: Size) -> ConvexOutline:
        """An outline in the image (px) as it was in the calibrated image."""
        uv = outline.uv
        if self.mirrored:
            uv = np.stack([image[0] - 1 - uv[:, 0], uv[:, 1]], 1)
        return ConvexOutline(_moved(np.linalg.inv(self.change.matrix(calibrated)), uv), outline.cut)

    def is_alike(self, other: "Choice", image: Size, calibrated: Size) -> bool:
        """Whether it makes next to no difference which of two it is."""
        if self.mirrored != other.mirrored:
            return False
        corners = np.array([(u, v) for u in (0, image[0]) for v in (0, image[1])], float)
        one, two = (_moved(np.linalg.inv(each.change.matrix(calibrated)), corners) for each in (self, other))
        return bool(np.abs(one - two).max() <= _ALIKE * max(calibrated))

    def lines(self, image: Size, calibrated: Size) -> list[str]:
        """As a `recording.toml` says it."""
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
    """What may have been done, the likeliest first.

    Scaled, with all that was calibrated in the image; turned by 90 or 270 degrees; cut out of it or padded, at the
    middle or at one side; or scaled until it fits into the image or fills it, and padded or cut.

    Args:
        calibrated: Width and height of the calibrated images (px).
        image: Those of the images now (px).
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
    """Whether one length is the other, or the other filled up to whole blocks (px)."""
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
