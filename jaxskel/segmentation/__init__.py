"""Segmentation of colour images into silhouettes: background models, and cleaning of their masks (Sect. 4.1).

In: images. Out: masks. A model needs only the method `foreground`, so any other segmenter can be used.
"""

from ._backdrop import ColouredBackdrop as ColouredBackdrop
from ._backdrop import backdrop_of as backdrop_of
from ._backdrop import backdrop_of_colour as backdrop_of_colour
from ._base import Background as Background
from ._cleaning import Cleaning as Cleaning
from ._plate import Plate as Plate
from ._plate import plate_of as plate_of
