"""Makes names and other texts from files safe to display."""

import re

# Control characters, which could clear a screen or overwrite a line; marks that change the writing direction, and with
# it the reading order of a line; line separators; surrogates, which stand for bytes that are not UTF-8 and cannot be
# written.
_HARMFUL = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def plain(text: str) -> str:
    """The text in one line, with a replacement character for each character that is unsafe to display."""
    return _HARMFUL.sub("\ufffd", text)
