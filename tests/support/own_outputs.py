"""Files that the tests of outputs write themselves."""

from jaxskel.synthetic import camera_ring

CAMERAS = camera_ring(3, size=(32, 24))


MINE = b"mine, and nobody else's"
