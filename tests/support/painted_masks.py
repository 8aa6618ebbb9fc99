"""One walking figure in every kind of mask file that tools write, with the silhouettes that should be read."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

SIZE = (96, 72)  # width and height
FRAMES = 4
# The palette of DAVIS: each bit of an index goes to one of the colours in turn.
DAVIS = np.array([[(i & 1) << 7, (i >> 1 & 1) << 7, (i >> 2 & 1) << 7] for i in range(8)] + [[64, 0, 0]], np.uint8)


def parts(frame: int) -> np.ndarray:
    """A body's parts: 0 background, 1 head, 2 trunk, 3 legs; it walks 6 px a frame."""
    drawn = np.zeros(SIZE[::-1], np.uint8)
    left = 10 + 6 * frame
    drawn[6:16, left + 4 : left + 14] = 1
    drawn[16:40, left : left + 18] = 2
    drawn[40:66, left : left + 8] = 3
    drawn[40:66, left + 10 : left + 18] = 3
    return drawn


def body(frame: int) -> np.ndarray:
    """True where the person is."""
    return parts(frame) > 0


def soft(frame: int) -> np.ndarray:
    """Parts of 1, with edges a few pixels wide; half is where `body` ends, but for the corners."""
    return cv2.GaussianBlur(body(frame).astype(np.float32), (0, 0), 1.5)


def labels(*values: int, dtype: type = np.uint8) -> Callable[[int], np.ndarray]:
    """The parts, with these values in place of 0, 1, 2 and 3."""
    return lambda frame: np.array(values, dtype)[parts(frame)]


def painted(*colours: tuple[int, int, int]) -> Callable[[int], np.ndarray]:
    """The parts in red, green and blue."""
    return lambda frame: np.array(colours, np.uint8)[parts(frame)]


def written(suffix: str, drawn: Callable[[int], np.ndarray], mode: str | None = None, **options) -> Callable:
    """A function that writes images by Pillow, converted to another of its modes."""

    def write(folder: Path) -> Path:
        for frame in range(FRAMES):
            image = Image.fromarray(drawn(frame))
            (image if mode is None else image.convert(mode)).save(folder / f"{frame:06d}{suffix}", **options)
        return folder

    return write


def indexed(suffix: str, drawn: Callable[[int], np.ndarray], palette: np.ndarray = DAVIS, **options) -> Callable:
    """A function that writes indices with a palette."""

    def write(folder: Path) -> Path:
        for frame in range(FRAMES):
            image = Image.fromarray(drawn(frame))
            image = image.convert("P") if image.mode != "P" else image
            image.putdata(drawn(frame).ravel().tolist())
            image.putpalette(palette.ravel().tolist())
            image.save(folder / f"{frame:06d}{suffix}", **options)
        return folder

    return write


def with_alpha(grey: bool, colour: int = 255) -> Callable[[int], np.ndarray]:
    """Opaque where the person is, in one colour."""

    def draw(frame: int) -> np.ndarray:
        plane = np.full(SIZE[::-1], colour, np.uint8)
        return np.stack([plane] * (1 if grey else 3) + [255 * body(frame).astype(np.uint8)], axis=-1)

    return draw


def opaque(frame: int) -> np.ndarray:
    """White on black, with a constant alpha channel."""
    white = 255 * body(frame).astype(np.uint8)
    return np.stack([white, white, white, np.full_like(white, 255)], axis=-1)


def textual(folder: Path) -> Path:
    """PBM as text, in which 1 is black."""
    for frame in range(FRAMES):
        rows = "\n".join(" ".join(map(str, row)) for row in (~body(frame)).astype(int))
        (folder / f"{frame}.pbm").write_text(f"P1\n# a mask\n{SIZE[0]} {SIZE[1]}\n{rows}\n")
    return folder


def array(dtype: type, drawn: Callable[[int], np.ndarray]) -> Callable:
    """A function that writes an array of an archive."""

    def write(folder: Path) -> Path:
        np.savez(folder / "masks.npz", cam=np.array([drawn(frame) for frame in range(FRAMES)]).astype(dtype))
        return folder / "masks.npz"

    return write


WHITE = labels(0, 255, 255, 255)
READ: dict[str, Callable[[Path], Path]] = {
    "black and white": written(".png", WHITE),
    "ones": written(".png", labels(0, 1, 1, 1)),
    "class labels": written(".png", labels(0, 2, 13, 18)),
    "one dark instance": written(".png", labels(0, 38, 38, 38)),
    "one bright instance": written(".png", labels(0, 200, 200, 200)),
    "dark and bright labels": written(".png", labels(0, 60, 120, 200)),
    "labels in three channels": written(".png", painted((0, 0, 0), (2, 2, 2), (9, 9, 9), (18, 18, 18))),
    "ones of 16 bits": written(".png", labels(0, 1, 1, 1, dtype=np.uint16)),
    "bytes in 16 bits": written(".png", labels(0, 255, 255, 255, dtype=np.uint16)),
    "white of 16 bits": written(".png", labels(0, 65535, 65535, 65535, dtype=np.uint16)),
    "instance just below half": written(".png", labels(0, 32800, 32800, 32800, dtype=np.uint16)),
    "large instance": written(".png", labels(0, 300, 300, 300, dtype=np.uint16)),
    "coded instances": written(".png", labels(0, 24001, 26000, 40003, dtype=np.uint16)),
    "16 bits in a TIFF": written(".tif", labels(0, 24001, 26000, 40003, dtype=np.uint16)),
    "palette, one object": indexed(".png", labels(0, 1, 1, 1)),
    "palette, several objects": indexed(".png", labels(0, 1, 2, 3)),
    "palette, background not opaque": indexed(".png", labels(0, 1, 2, 3), transparency=0),
    "palette with one colour for all": indexed(".png", labels(0, 1, 2, 3), np.zeros((4, 3), np.uint8)),
    "palette that is too short": indexed(".png", labels(0, 1, 2, 3), np.zeros((1, 3), np.uint8)),
    "palette, white is the background": indexed(".png", labels(0, 1, 2, 3), 255 - DAVIS),
    "palette of greys, exchanged": indexed(
        ".png", labels(1, 0, 0, 0), np.array([[255] * 3, [0] * 3], np.uint8)
    ),
    "palette in a BMP": indexed(".bmp", labels(0, 1, 2, 3)),
    "palette in a TIFF": indexed(".tif", labels(0, 1, 2, 3)),
    "palette in a GIF": indexed(".gif", labels(0, 1, 2, 3)),
    "grey in a GIF": written(".gif", WHITE),
    "bits in a PNG": written(".png", WHITE, "1"),
    "bits in a BMP": written(".bmp", WHITE, "1"),
    "bits in a TIFF": written(".tif", WHITE, "1", compression="group4"),
    "bits in a PBM": written(".pbm", WHITE, "1"),
    "text in a PBM": textual,
    "PGM": written(".pgm", WHITE),
    "labels in a PGM": written(".pgm", labels(0, 2, 13, 18)),
    "PPM": written(".ppm", WHITE, "RGB"),
    "PNM": written(".pnm", WHITE),
    "capitals": written(".PNG", WHITE),
    "WebP": written(".webp", WHITE, quality=80),
    "WebP without loss": written(".webp", WHITE, lossless=True),
    "labels in a WebP": written(".webp", labels(0, 38, 38, 38), lossless=True),
    "WebP with alpha": written(".webp", with_alpha(grey=False, colour=90), lossless=True, exact=True),
    "JPEG": written(".jpg", WHITE, quality=70),
    "grey with alpha": written(".png", with_alpha(grey=True)),
    "colours with alpha": written(".png", with_alpha(grey=False, colour=90)),
    "black with alpha": written(".png", with_alpha(grey=False, colour=0)),
    "alpha that says nothing": written(".png", opaque),
    "red on black": written(".png", painted((0, 0, 0), *[(255, 0, 0)] * 3)),
    "dark blue on black": written(".png", painted((0, 0, 0), *[(0, 0, 60)] * 3)),
    "a colour for each part": written(".png", painted((0, 0, 0), (255, 0, 0), (0, 128, 0), (20, 40, 10))),
    "bools": array(bool, body),
    "zeros and ones": array(np.uint8, body),
    "bytes": array(np.uint8, WHITE),
    "labels of 64 bits": array(np.int64, labels(0, 2, 13, 18)),
    "labels with a point": array(np.float32, labels(0, 2, 13, 18)),
    "ones with a point": array(np.float64, body),
    "white with a point": array(np.float16, WHITE),
}  # fmt: skip
"""Masks whose silhouettes are exactly `body`; for JPEG and WebP, except for a pixel or two."""

SOFT: dict[str, Callable[[Path], Path]] = {
    "soft": written(".png", lambda frame: np.uint8(255 * soft(frame))),
    "soft, 16 bits": written(".png", lambda frame: np.uint16(65535 * soft(frame))),
    "soft, as alpha": written(
        ".png", lambda frame: np.stack([np.full(SIZE[::-1], 9, np.uint8), np.uint8(255 * soft(frame))], -1)
    ),
    "soft and red": written(
        ".png", lambda frame: np.uint8(255 * soft(frame))[..., None] * np.array([1, 0, 0], np.uint8)
    ),
    "soft, bytes in 16 bits": written(".png", lambda frame: np.uint16(255 * soft(frame))),
    "sureness": array(np.float32, soft),
    "sureness in bytes": array(np.float64, lambda frame: 255 * soft(frame)),
}
"""Masks that are cut where they are half white."""

ASKED: dict[str, tuple[Callable[[Path], Path], str, list]] = {
    "unknown is 255": (
        written(".png", labels(0, 1, 1, 255)), "masks hold 0, 1 and 255; name those of the person", [1]),
    "a trimap": (written(".png", labels(0, 128, 255, 255)), "masks hold 0, 128 and 255", [128]),
    "labels from 1": (written(".png", labels(1, 2, 3, 4)), "masks hold 1 to 4", [2, 3, 4]),
    "palette with unknown": (
        indexed(".png", labels(0, 1, 1, 255), np.resize(DAVIS, (256, 3))), "masks hold 0, 1 and 255", [1]),
    "white ground": (
        written(".png", painted((255, 255, 255), (255, 0, 0), (0, 0, 255), (0, 0, 255))),
        "masks hold [0, 0, 255], [255, 0, 0] and [255, 255, 255]", [[0, 0, 255], [255, 0, 0]]),
    "a scene": (
        written(".png", lambda frame: np.where(body(frame), 12, np.arange(96) // 60 + 3).astype(np.uint8)),
        "masks hold 3, 4 and 12", [4, 12]),
}  # fmt: skip
"""Masks whose person values must be stated, with the message and the proposal."""


def noise(frame: int) -> np.ndarray:
    """A picture in grey."""
    return cv2.GaussianBlur(np.random.default_rng(frame).integers(0, 256, SIZE[::-1]).astype(np.uint8), (0, 0), 1)


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "a picture in grey": (written(".png", noise), "all levels of grey, as pictures do"),
    "a picture in colour": (
        written(".png", lambda frame: cv2.applyColorMap(noise(frame), cv2.COLORMAP_JET)), "are pictures in colour"),
    "a JPEG in colour": (
        written(".jpg", painted((0, 0, 0), *[(255, 0, 0)] * 3)), "are pictures in colour"),
    "labels in a JPEG": (written(".jpg", labels(0, 38, 38, 38)), "none is white"),
    "a dim ramp": (
        written(".png", lambda frame: np.uint8(100 * soft(frame))), "none is white"),
    "a TIFF of 32 bits": (written(".tif", labels(0, 1, 1, 1, dtype=np.int32)), "32 bits a pixel, which are not read"),
    "a TIFF of floats": (written(".tif", soft), "32 bits a pixel, which are not read"),
    "negative": (array(np.int16, labels(0, 1, -1, 2, dtype=np.int16)), "holds -1 in frame 0"),
    "not a number": (array(np.float32, lambda frame: np.where(body(frame), np.nan, 0)), "holds nan in frame 0"),
    "too large": (array(np.int64, labels(0, 70000, 1, 1, dtype=np.int64)), "holds 70000 in frame 0"),
}  # fmt: skip
"""Masks that cannot be used, and the messages about them."""
