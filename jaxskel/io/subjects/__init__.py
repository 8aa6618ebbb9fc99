"""The subject's dimensions and flesh as a TOML file."""

from ._subject import read_body as read_body
from ._subject import read_subject as read_subject
from ._subject import write_subject as write_subject
