"""A folder of somebody's files to a `recording.toml`: what was found, what was settled how, and what is in doubt."""

from ._proposals import propose_recording as propose_recording
