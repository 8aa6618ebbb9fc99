"""Untrusted files: every reader bounds what it allocates.

In: paths of archives, images, videos and TOML files. Out: their content, or a `ValueError` of one line that names the
file, the key and the remedy.
"""

from ._archive import StoredRows as StoredRows
from ._archive import keys_of as keys_of
from ._archive import numbers as numbers
from ._archive import read_arrays as read_arrays
from ._archive import shape_of as shape_of
from ._archive import short as short
from ._archive import switches as switches
from ._archive import texts as texts
from ._bounded import check_pixels as check_pixels
from ._bounded import check_regular as check_regular
from ._bounded import open_regular as open_regular
from ._bounded import read_bounded as read_bounded
from ._capture import grab as grab
from ._capture import opened as opened
from ._capture import retrieve as retrieve
from ._capture import size_of as size_of
from ._errors import fault as fault
from ._images import Indexed as Indexed
from ._images import is_picture as is_picture
from ._images import keeps_values as keeps_values
from ._images import read_image as read_image
from ._images import read_indexed as read_indexed
from ._named_paths import named_path as named_path
from ._ours import TOML_LINE as TOML_LINE
from ._ours import is_ours as is_ours
from ._toml import MOST_BYTES as MOST_BYTES
from ._toml import check_known as check_known
from ._toml import parse_toml as parse_toml
from ._toml import quoted as quoted
from ._toml import read_toml as read_toml
