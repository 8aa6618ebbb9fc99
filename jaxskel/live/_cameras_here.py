"""The cameras that OpenCV can open at this machine.

This file is also run by itself, in a process that only loads OpenCV: a driver may hang, and some print to the terminal.
"""

import subprocess
import sys
from pathlib import Path

# Cameras are numbered from 0, with gaps: on Linux, many take two numbers each.
_NUMBERS = range(16)


def cameras_here(seconds: float = 8.0) -> list[str]:
    """Open the cameras of this machine one after the other, and describe those that give an image.

    A camera that another program uses is not seen.

    Args:
        seconds: Longest time to look (s); those found until then are returned.

    Returns:
        One line for each camera: its number, as ``camera`` in a `recording.toml` names it, its images' size (px) and
        rate (frames per second).
    """
    # Without -P, the files beside this one would hide modules of the same name.
    command = [sys.executable, "-P", str(Path(__file__))]
    try:
        found = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=seconds).stdout
    except subprocess.TimeoutExpired as late:
        found = late.stdout or b""
    return [line for line in found.decode().splitlines() if line[:1].isdigit()]


def _look() -> None:
    """Print a line for each camera as soon as it has given an image."""
    import cv2

    for number in _NUMBERS:
        capture = cv2.VideoCapture(number)
        there, image = capture.read() if capture.isOpened() else (False, None)
        if there and image is not None:
            height, width = image.shape[:2]
            print(f"{number}: {width} x {height} px, {capture.get(cv2.CAP_PROP_FPS):g} fps", flush=True)
        capture.release()


if __name__ == "__main__":
    _look()
