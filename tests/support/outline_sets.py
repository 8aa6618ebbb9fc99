"""Outlines of a person in several views."""

import numpy as np

from jaxskel.outlines import ConvexOutline, convex_outline


def outlines(images: np.ndarray) -> dict[tuple[int, int], ConvexOutline]:
    height, width = images.shape[2:]
    found = {
        (frame, view): convex_outline(np.packbits(images[frame, view] > 0, axis=-1), width, height)
        for frame in range(images.shape[0])
        for view in range(images.shape[1])
    }
    return {key: outline for key, outline in found.items() if outline is not None}
