"""Cameras whose images have different sizes: each view is shown, and judged, by its own part of the padded bits."""

from unittest.mock import Mock

import cv2
import equinox as eqx
import numpy as np
import pytest
from support.spoilt_rigs import good, masks_of

from jaxskel.recording import unpack_view
from jaxskel.verdict._views import reduce_views
from jaxskel.visualization.report._overlays import make_overlays

# More than a byte less than the others, on which nobody is seen.
NARROWER, LOWER = 36, 10


@pytest.fixture(scope="module")
def rig():
    return good(3, 2)


@pytest.fixture(scope="module")
def smaller(rig):
    """The same, but the first camera's images lack some columns and rows at the right and bottom."""
    width, height = (rig.cameras.size[0] - (NARROWER, LOWER)).tolist()
    masks = masks_of(rig)[:, 0]
    assert masks.any((1, 2)).all()
    assert not masks[:, height:].any()
    assert not masks[:, :, width:].any()
    size = rig.cameras.size.copy()
    size[0] = width, height
    return eqx.tree_at(lambda r: r.cameras.size, rig, size)


def test_a_mask_has_the_size_of_its_view(rig, smaller):
    for view, (width, height) in enumerate(smaller.cameras.size):
        mask = unpack_view(smaller.silhouettes[:, view], smaller.cameras.size[view])
        np.testing.assert_array_equal(mask, masks_of(rig)[:, view, :height, :width])


def test_they_are_judged_alike(rig, smaller):
    found, wanted = (reduce_views(each.cameras, each.silhouettes) for each in (smaller, rig))
    np.testing.assert_array_equal(found.masks, wanted.masks)


def test_the_report_draws_the_same_outlines(rig, smaller):
    nobody = np.full((1, 2, 20, 3), np.nan, np.float32)
    found, wanted = (make_overlays(each, np.arange(2), nobody, 10**6) for each in (smaller, rig))
    assert len(wanted.points) > 50
    np.testing.assert_array_equal(found.points, wanted.points)


def test_the_viewer_shows_each_at_its_size(smaller):
    pytest.importorskip("rerun", reason='needs rerun: pip install "jaxskel[view]"')
    from jaxskel.visualization.viewer import _views as views

    stream = Mock(spec=views.rr.RecordingStream)
    views.log_silhouettes(stream, smaller.cameras, smaller.silhouettes[0])
    pngs = [call.args[1].blob.as_arrow_array()[0].as_py() for call in stream.log.call_args_list]
    sizes = [cv2.imdecode(np.array(png, np.uint8), cv2.IMREAD_GRAYSCALE).shape[::-1] for png in pngs]
    np.testing.assert_array_equal(sizes, smaller.cameras.size)
