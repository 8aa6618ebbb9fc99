"""Proposes a `recording.toml` for a folder of images and calibration files.

In: a folder. Out: a `Proposal`: the text of the file, how each entry was settled, and what remains in doubt.
"""

from ._proposals import propose_recording as propose_recording
