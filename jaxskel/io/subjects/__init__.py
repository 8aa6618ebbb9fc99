"""Subjects on disk: a TOML file with the dimensions of a person's skeleton and flesh (m).

In: the file. Out: a `Skeleton` (`read_subject`) or a body model (`read_body`), and back.
"""

from ._subject import read_body as read_body
from ._subject import read_subject as read_subject
from ._subject import write_subject as write_subject
