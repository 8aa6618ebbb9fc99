import numpy as np
import pytest
from scipy.ndimage import binary_dilation
from support.phantoms import ring

from jaxskel import pack_silhouettes, unpack_silhouettes
from jaxskel.hull._widened_views import steps_for, widened

CAMERAS = ring(3, size=(93, 70))


def drawn(seed: int) -> np.ndarray:
    """Masks with some pixels set, also at the borders."""
    return np.random.default_rng(seed).random((2, 3, 70, 93)) < 0.004


@pytest.mark.parametrize("pixels", [(1, 1, 1), (2, 3, 1), (5, 8, 9), (1, 16, 4)])
def test_silhouettes_are_widened_by_at_least_so_many_pixels_and_at_most_by_two_reduced_ones(pixels):
    pixels, masks = np.array(pixels), drawn(pixels[0])
    steps = steps_for(pixels)
    reduced = CAMERAS.reduced(steps)
    found = unpack_silhouettes(widened(CAMERAS, pack_silhouettes(masks), pixels), int(reduced.size[:, 0].max()))
    for c, step in enumerate(steps):
        # Each pixel of the image, as its reduced pixel is.
        whole = found[:, c].repeat(step, 1).repeat(step, 2)[:, :70, :93]
        for frame in range(2):
            least, most = (
                binary_dilation(masks[frame, c], np.ones((2 * by + 1, 2 * by + 1)))
                for by in (pixels[c], pixels[c] if step == 1 else 2 * step)
            )
            assert not (least & ~whole[frame]).any()
            assert not (whole[frame] & ~most).any()


def test_few_pixels_leave_the_images_as_they_are_and_many_reduce_them_by_whole_bytes():
    np.testing.assert_array_equal(steps_for(np.array([1, 3, 4, 8, 9, 17])), [1, 1, 8, 8, 16, 24])
