"""Rigs of four real cameras, with programs that other tests have compiled."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from unittest.mock import patch


@contextmanager
def filled_up_to_eight() -> Iterator[None]:
    """Rigs of four are filled up as those of eight are, so that the programs are those of other tests."""
    size = partial(max, 8)
    with patch("jaxskel.cameras._blind.rig_size", size), patch("jaxskel.outlines._distances.rig_size", size):
        yield
