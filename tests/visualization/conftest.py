"""Fixtures shared by the tests of the viewer; other files have their own recordings under the same names."""

import numpy as np
import pytest
from support.recordings import with_masks
from support.report_page import filmed, poses_of

from jaxskel import Poses, Recording

EMPTY = 7


@pytest.fixture(scope="module")
def view():
    """The package's module; skips if the viewer's package is missing or cannot read its own files."""
    pytest.importorskip("rerun.chunk", reason='needs rerun: pip install "jaxskel[view]"')
    import jaxskel.visualization.viewer

    return jaxskel.visualization.viewer


@pytest.fixture(scope="module")
def recording() -> Recording:
    scene = filmed()
    masks = np.array(scene.silhouettes)
    masks[EMPTY] = 0
    return with_masks(scene, masks)


@pytest.fixture(scope="module")
def poses(recording) -> Poses:
    return poses_of(recording)
