"""What is the person in a view's masks: decided once for all of its images, by the values of a few of them."""

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

# Images that are looked at: to decode them is what it costs.
_SAMPLES = 8
# Of a video, what is darker than this may be a codec's noise; and so much of a frame that is not white is none.
_NOISE, _MOST_NOISE = 48, 2e-3
# Of masks, no more is between dark and bright, of pictures in grey nearly all.
_MOST_GREY, _DARK = 0.05, 32

Person = tuple[int, ...] | tuple[tuple[int, int, int], ...]
"""Values of masks, or colours: red, green, blue."""


def person_text(person: Person) -> str:
    """Values or colours as TOML."""
    return str([list(value) if isinstance(value, tuple) else value for value in person])


@dataclass(frozen=True)
class MaskRule:
    """What a view's images are, as masks."""

    frames: Frames
    """The images that the matte is for: of those with a palette, the indices."""
    matte: Masks | None
    """None where values do not tell what is the person, or the images are no masks."""
    told: str = ""
    """What there is to say: which values there are, what is taken for the person; nothing for black and white."""
    person: Person = ()
    """Where values do not tell, what may be the person, to be looked at; empty where the images are no masks."""
    is_picture: bool = False
    """Whether the images are pictures rather than masks, if nobody has said which."""

    def lines(self) -> list[str]:
        """What a `recording.toml` should say of the person beside the masks' name.

        Raises:
            ValueError: One line that names the folder, where it can say nothing that would do.
        """
        if self.matte is not None:
            return [f"# {self.told}"] if self.told else []
        if not self.person:
            raise fault(self.frames.path, None, self.told)
        return [f"person = {person_text(self.person)}  # CHECK: {self.told}"]


def rule_of(frames: Frames) -> MaskRule:
    """Decide what is the person in a view's masks.

    Raises:
        ValueError: One line that names the file, where an image cannot be read, or does not go with the others.
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


def rule_for(frames: Frames, person: Person) -> MaskRule:
    """Take these values of a view's masks for the person.

    Raises:
        ValueError: One line that names the file, where an image cannot be read.
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
    if not _is_anywhere(inside, matte):
        found = values.told(tally.counts)
        return MaskRule(inside, None, f"none of the masks holds {values.told(numbers)}; there are {found}")
    return MaskRule(inside, matte)


def _looked_at(frames: Frames) -> tuple[Frames, Values, Tally]:
    """What is looked at in the images, and which values it has there."""
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
    """White is the person; but what is only dim, in a few of its frames, is told."""
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
    """Images spread over all; where these are empty, the first that is not, and some after it."""
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
    """Whether any image shows the person: a few are looked at first."""
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
    assert image is not None  # it is one of those that are there
    return image


def _is_empty(image: Shaped[np.ndarray, "h w *channels"]) -> bool:
    return bool((image == image[0, 0]).all())
