"""Cases that are folders of masks and a calibration: the result of `init`, and of commands after it."""

import re
from collections.abc import Iterable

import numpy as np
from _case import FPS, PAPER, Act, Case, Rows, good_joints, good_scene, jaxskel, refused, wanted
from _case_rigs import aligned, difference

from jaxskel import Recording, unpack_silhouettes
from jaxskel.io.poses import read_poses
from jaxskel.io.recordings import read_recording

# Joints of the same scene, seen in other pixels, differ by less than this (m).
_NEAR = 0.03


def _init(case: Case) -> tuple[str, str]:
    """The file that `jaxskel init` writes, and its messages."""
    done = jaxskel(case, "init", ".", "--fps", f"{FPS:g}")
    wanted(done.code == 0, f"init: exit code {done.code}, {done.last}")
    return (case.path / "recording.toml").read_text(encoding="utf-8"), done.out + done.err


def _uncommented(text: str) -> str:
    return "\n".join(line.partition("#")[0] for line in text.splitlines())


def same_recording(frames: Iterable[int] = (0, 1, 2), says: str = "", writes: str = "") -> Act:
    """The folder after `init` is read as the good scene: silhouettes, cameras and frames are the same.

    Args:
        frames: The frames' numbers.
        says: What `init` must say.
        writes: What must stand in recording.toml.
    """

    def act(case: Case) -> str:
        text, told = _init(case)
        for key in ("frames", "calibrated_size"):
            wanted(not re.search(rf"^{key} =", text, re.MULTILINE), f"init writes {key}")
        wanted(says in told, f"init does not say {says!r}")
        wanted(writes in _uncommented(text), f"init does not write {writes!r}")
        recording = read_recording(case.path)
        _check_same(case, recording, tuple(frames))
        notes = [line.removeprefix("check: ") for line in told.splitlines() if line.startswith("check: ")]
        return "the same masks, cameras, frames" + (f"; says: {notes[0]}" if notes else "")

    return act


def _check_same(case: Case, recording: Recording, frames: tuple[int, ...]) -> None:
    good = good_scene(case.root)
    wanted(recording.frame_index.tolist() == list(frames), f"frames {recording.frame_index.tolist()}")
    masks = unpack_silhouettes(recording.silhouettes[:], good.masks.shape[-1])
    wanted(masks.shape == good.masks.shape, f"silhouettes of shape {masks.shape}")
    different = np.mean(masks != good.masks, axis=(0, 2, 3))
    wanted(not different.any(), f"silhouettes differ in {100 * different.max():.1f} % of the pixels")
    off = difference(recording.cameras, good.cameras)
    wanted(off < 1e-6, f"cameras are off by {off:.3g}")


def told_to_sort(says: str) -> Act:
    """`init` refuses a layout, names it, and writes nothing."""

    def act(case: Case) -> str:
        line = refused(case, "init", ".", "--fps", f"{FPS:g}", says=says)
        wanted("no images" not in line, line)
        return line

    return act


def _ended(case: Case) -> tuple[str, bool]:
    """How `check` and `run` end: in words, and whether both reported a doubt."""
    check = jaxskel(case, "check", ".", "-o", "check.png")
    found = [line for line in check.out.splitlines() if line.startswith(("doubt: ", "wrong: "))]
    run = jaxskel(case, "run", ".", "-o", "poses", *PAPER)
    words = f"check {check.code}, run {run.code}"
    if found:
        words += f" ({found[0]})"
    return words, check.code > 0 and bool(found) and (run.code == 2 or bool(run.err.strip()))


def near_poses(writes: str, *never: str) -> Act:
    """The folder after `init` gives the joints of the good scene.

    Args:
        writes: What must stand in recording.toml.
        never: Keys that must not.
    """

    def act(case: Case) -> str:
        text = _uncommented(_init(case)[0])
        wanted(writes in text, f"init does not write {writes!r}")
        for key in never:
            wanted(f"{key} =" not in text, f"init writes {key}")
        words, _ = _ended(case)
        wanted(words == "check 0, run 0", f"{writes}; {words}")  # after the repair there are no doubts
        median, worst = _away(case)
        told = f"{writes}; {words}; joints {1e3 * median:.0f} mm away, at most {1e3 * worst:.0f}"
        wanted(median < _NEAR, told)
        return told

    return act


def _away(case: Case) -> tuple[float, float]:
    """Median and greatest distance of joints from those of the good scene (m)."""
    good = good_scene(case.root).cameras
    found, poses = read_recording(case.path), read_poses(case.path / "poses/poses.npz")
    turned = re.search(r"turn = (\d+)", (case.path / "recording.toml").read_text(encoding="utf-8"))
    if turned is None:
        turn, shift = aligned(found.cameras, good)
    else:  # these cameras are rotated relative to the good ones, in the same world
        turn, shift = np.eye(3), np.zeros(3)
    distances = np.linalg.norm(poses.joints - (good_joints(case) @ turn.T + shift), axis=-1)
    wanted(np.isfinite(distances).all(), "not every frame has a pose")
    return float(np.median(distances)), float(distances.max())


def _mirrored(case: Case) -> str:
    told = _init(case)[1]
    wanted("mirrored" in told, "init does not say mirrored")
    words, doubted = _ended(case)
    wanted(doubted and "mirror" in words, words)
    return f"init says mirrored; {words}"


def _turned(case: Case) -> str:
    """`init` repairs it; if its `turn` is removed, `check` and `run` report the fault."""
    told = near_poses("turn = 180")(case)
    path = case.path / "recording.toml"
    path.write_text(re.sub(r"^turn = .*$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE), encoding="utf-8")
    words, doubted = _ended(case)
    wanted(doubted and "turned" in words, f"without turn: {words}")
    return f"{told}; without turn: {words}"


_SAME = "masks, cameras and frames of the good scene"
_OFFSETS = "offset = 4000"
FOLDERS: Rows = {
    "easymocap_none_names": (_SAME, same_recording()),
    "easymocap_size_zero": (f"{_SAME}; no calibrated_size", same_recording()),
    "flat_folder": ("init: a folder a camera is needed", told_to_sort("a folder of its own")),
    "folder_per_frame": ("init: a folder a frame, said so", told_to_sort("a folder for each frame")),
    "frames_no_overlap": (f"{_SAME}; offsets, not frames", same_recording(writes=_OFFSETS)),
    "image_mirrored": ("init, check and run say mirrored", _mirrored),
    "image_turned_180": ("turn = 180 and joints within 30 mm, or told", _turned),
    "mask_class_labels": (f"{_SAME}, told", same_recording(says="0, 2, 5, 9, 13, 16 and 18")),
    "mask_grey_with_alpha": (_SAME, same_recording()),
    "mask_instance_38": (f"{_SAME}, told", same_recording(says="38")),
    "mask_palette": (f"{_SAME}; no median", same_recording()),
    "mask_pbm": (_SAME, same_recording()),
    "mask_uint16_ones": (_SAME, same_recording()),
    "mask_webp": (_SAME, same_recording()),
    "more_views_than_cameras": (f"{_SAME}; cam6 told", same_recording(says="no camera for cam6")),
    "names_clock_last": (f"{_SAME}, 1 to 3", same_recording((1, 2, 3))),
    "names_person_id_last": (_SAME, same_recording()),
    "names_timestamps": (f"{_SAME}, in order", same_recording(says="in the order of their times")),
    "size_half": ("scale, joints within 30 mm", near_poses("scale = 0.5", "calibrated_size")),
    "size_sensor_taller": ("crop, joints within 30 mm", near_poses("crop = [0, 27]", "calibrated_size")),
    "size_turned_90": ("turn, joints within 30 mm", near_poses("turn = 90", "calibrated_size")),
    "up_contradicted": ("up = -Z, joints within 30 mm", near_poses('up = "-Z"')),
    "words_clean": (_SAME, same_recording()),
    "words_rembg": (_SAME, same_recording()),
}
