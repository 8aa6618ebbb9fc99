"""Colour images to silhouettes: a background model, and what is cleaned afterwards.

In: images. Out: masks. A model has no more than `foreground`: another segmenter's is as good.
"""

from ._backdrop import ColouredBackdrop as ColouredBackdrop
from ._backdrop import backdrop_of as backdrop_of
from ._backdrop import backdrop_of_colour as backdrop_of_colour
from ._base import Background as Background
from ._cleaning import Cleaning as Cleaning
from ._plate import Plate as Plate
from ._plate import plate_of as plate_of
