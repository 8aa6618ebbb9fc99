"""Names and other texts out of files, made fit to be shown."""

import re

# Control characters, with which a name could clear a screen or write over a line; marks that turn the direction of
# writing, and with it the order in which a line reads; separators of lines; halves of characters, which stand for bytes
# that are no UTF-8 and cannot be written.
_HARMFUL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def plain(text: str) -> str:
    """The text in one line, with a replacement character for what a terminal or a page would not show as it stands."""
    return _HARMFUL.sub("\ufffd", text)
