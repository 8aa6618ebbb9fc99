"""Decides which values of a view's masks are the person, once for all images, from a few of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Shaped

from ..files import fault
from ._frames import Frames
from ._image_folder import ImageFolder
from ._indexed_folder import labelled
from ._mask_archive import MaskArchive
from ._mask_choice import Verdict, verdict_of_colours, verdict_of_grey
from ._mask_values import MOST_VALUES, Alpha, Brightest, Colours, Grey, Values, is_coloured, is_painted, told
from ._masks import Among, Masks
from ._tally import Tally
from ._video import Video

# Number of images examined; decoding them takes most of the time.
_SAMPLES = 8
# In videos, values up to the first may be codec noise, as may dim pixels up to the second share of a frame.
_NOISE, _MOST_NOISE = 48, 2e-3
# Largest share of grey pixels in masks; grey pictures consist of little else. Values below the second are dark.
_MOST_GREY, _DARK = 0.05, 32

Person = tuple[int, ...] | tuple[tuple[int, int, int], ...]
"""Mask values, or colours as (red, green, blue)."""


def person_text(person: Person) -> str:
    """Values or colours as TOML."""
    return str([list(value) if isinstance(value, tuple) else value for value in person])


@dataclass(frozen=True)
class MaskRule:
    """How a view's images are read as masks.

    Attributes:
        frames: The images that the matte applies to; for images with a palette, their indices.
        matte: The rule that finds the person; None if the values do not tell, or the images are no masks.
        told: Explanation for the user: which values there are and which are the person; empty for black and white
            masks.
        person: If the values do not tell, candidates for the person, for the user to check; empty if the images are no
            masks.
        is_picture: Whether the images look like pictures rather than masks, if the user has not said which.
    """

    frames: Frames
    matte: Masks | None
    told: str = ""
    person: Person = ()
    is_picture: bool = False

    def lines(self) -> list[str]:
        """Lines on the person for a `recording.toml`, besides the masks' path.

        Raises:
            ValueError: One line that names the folder, if no line would be right.
        """
        if self.matte is not None:
            return [f"# {self.told}"] if self.told else []
        if not self.person:
            raise fault(self.frames.path, None, self.told)
        return [f"person = {person_text(self.person)}  # CHECK: {self.told}"]


def rule_of(frames: Frames) -> MaskRule:
    """Decide which values of a view's masks are the person.

    Raises:
        ValueError: One line that names the file, if an image cannot be read or does not fit the others.
    """
    if isinstance(frames, Video):
        return _of_video(frames)
    if isinstance(frames, MaskArchive) and frames.is_binary:
        return MaskRule(frames, Masks())
    frames, values, tally = _looked_at(frames)
    try:
        of_kind = verdict_of_colours if isinstance(values, Colours) else verdict_of_grey
        found = of_kind(tally, frames.keeps_values(), values.told)
    except ValueError as error:
        raise fault(frames.path, None, str(error)) from None
    if found.choice is None:
        return MaskRule(frames, None, found.told, _named(found, values), found.grey_share > _MOST_GREY)
    matte = Masks(values, found.choice)
    if found.is_dim and tally.varies and not _is_anywhere(frames, matte):
        return MaskRule(frames, None, f"masks hold {values.told(tally.counts)}, none is white; write 0 and 255")
    return MaskRule(frames, matte, found.told, is_picture=found.grey_share > _MOST_GREY)


def rule_for(frames: Frames, person: Person, may_lack: bool = False) -> MaskRule:
    """The rule that takes these values of a view's masks for the person; masks without any are a fault or `may_lack`.

    Raises:
        ValueError: One line that names the file, if an image cannot be read.
    """
    if isinstance(frames, Video) or not frames.keeps_values():
        return MaskRule(frames, None, "their values are not kept exactly; person = [...] is for PNG and the like")
    inside, values, tally = _looked_at(frames)
    numbers = tuple(value for value in person if isinstance(value, int))
    if not numbers:
        values, inside = Colours(), frames
        numbers = tuple(value[0] << 16 | value[1] << 8 | value[2] for value in person if not isinstance(value, int))
    elif isinstance(values, Colours):
        found = values.told(tally.counts)
        return MaskRule(frames, None, f"are in colour, {found}; name colours, person = [[255, 0, 0]]")
    matte = Masks(values, Among(numbers))
    if not may_lack and not _is_anywhere(inside, matte):
        found = values.told(tally.counts)
        return MaskRule(inside, None, f"none of the masks holds {values.told(numbers)}; there are {found}")
    return MaskRule(inside, matte)


def _looked_at(frames: Frames) -> tuple[Frames, Values, Tally]:
    """The images to examine, how values are taken from them, and the counts of these values."""
    if isinstance(frames, ImageFolder):
        frames = labelled(frames, _spread(frames.numbers)) or frames
    alpha, colours, brightest, grey = Tally(), Tally(), Tally(), Tally()
    exact, painted, lit = frames.keeps_values(), False, np.zeros(3, bool)
    for image in _some(frames):
        if image.ndim == 3 and image.shape[2] == 4:
            alpha.add(Alpha().of(image))
        if image.ndim == 3 and (is_painted(image) if exact else is_coloured(image)):
            painted = True
            lit |= [bool(channel.any()) for channel in cv2.split(image)[:3]]
            colours.add(Colours().of(image))
            brightest.add(Brightest().of(image))
        else:
            grey.add(image if image.ndim == 2 else np.ascontiguousarray(image[..., 1]))
    if len(alpha.counts) > 1:
        return frames, Alpha(), alpha
    if not painted:
        return frames, Grey(), grey
    if lit.sum() == 1 and len(colours.counts) > MOST_VALUES:
        brightest.add_all(grey)
        return frames, Brightest(), brightest
    colours.add_all(grey, 0x010101)
    return frames, Colours(), colours


def _of_video(video: Video) -> MaskRule:
    """The rule for a video: white is the person, with a note if a few frames only have dim values."""
    tally, brightest, dim, coloured = Tally(), 0, 0.0, True
    noise = 0 if video.keeps_values() else _NOISE
    for image in video.glimpses():
        coloured &= is_coloured(image)
        green = np.ascontiguousarray(image[..., 1])
        tally.add(green)
        brightest = max(brightest, int(green.max()))
        dim = max(dim, np.count_nonzero(green > max(noise, int(green.min()))) / green.size)
        if brightest >= 128 and not coloured:
            break
    if coloured and tally.counts:
        return MaskRule(
            video, None, "are pictures in colour, not masks; give them as images with a background", is_picture=True
        )
    if brightest < 128 and dim > _MOST_NOISE:
        return MaskRule(
            video, None, f"masks hold {told(tally.counts)}, none is white; write white for the person, labels as PNG"
        )
    is_picture = tally.share(lambda value: _DARK <= value < 256 - _DARK) > _MOST_GREY
    return MaskRule(video, Masks(), is_picture=is_picture)


def _named(found: Verdict, values: Values) -> Person:
    if isinstance(values, Colours):
        return tuple((value >> 16, value >> 8 & 255, value & 255) for value in found.person)
    return found.person


def _some(frames: Frames) -> Iterator[Shaped[np.ndarray, "h w *channels"]]:
    """Images spread over the whole view; if these are empty, the first that is not, and some after it."""
    chosen, empty = _spread(frames.numbers), True
    for number in chosen:
        image = _read(frames, number)
        empty &= _is_empty(image)
        yield image
    if not empty:
        return
    others = sorted(set(frames.numbers) - set(chosen))
    for place, number in enumerate(others):
        image = _read(frames, number)
        if not _is_empty(image):
            yield image
            yield from (_read(frames, later) for later in _spread(others[place + 1 :]))
            return


def _is_anywhere(frames: Frames, matte: Masks) -> bool:
    """Whether any image shows the person; a few are tried first."""
    chosen = _spread(frames.numbers)
    for number in (*chosen, *sorted(set(frames.numbers) - set(chosen))):
        image = _read(frames, number)
        try:
            if matte.foreground(image).any():
                return True
        except ValueError as error:
            raise fault(frames.path, None, f"{frames.named(number)} {error}") from None
    return False


def _spread(numbers: Sequence[int]) -> list[int]:
    places = np.unique(np.linspace(0, len(numbers) - 1, min(_SAMPLES, len(numbers))).astype(int))
    return [numbers[place] for place in places.tolist()]


def _read(frames: Frames, number: int) -> Shaped[np.ndarray, "h w *channels"]:
    image = frames.read(number)
    assert image is not None  # the number is one of those that exist
    return image


def _is_empty(image: Shaped[np.ndarray, "h w *channels"]) -> bool:
    return bool((image == image[0, 0]).all())
