"""Draws the skeleton on the most extreme frame, among some sequence files, of each posture that is hard for a hull.

    python benchmarks/postures.py SEQUENCE.npz ... --output postures.png

For each posture the frame in which it is most pronounced is found from the truth. It is reconstructed alone by the
defaults of `jaxskel run`, with the body calibrated on frames spread over its file. The picture shows two views of each.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from jaxskel import (
    JOINT_NAMES,
    Poses,
    Recording,
    Settings,
    join_poses,
    prepare,
    read_recording,
    reconstruct_batches,
    unpack_silhouettes,
)
from jaxskel._runtime.picture_files import write_image
from jaxskel.visualization import draw_silhouette, draw_skeleton, tile

_MARGIN = 0.15  # margin around the person, as a share of the longer side of the cut-out

Joints = dict[str, Float[np.ndarray, "frames 3"]]
"""True joints by name (m), z up."""


def _apart(one: np.ndarray, other: np.ndarray) -> Float[np.ndarray, " frames"]:
    return np.linalg.norm(one - other, axis=-1)


def _to_the_left(at: Joints, side: str) -> Float[np.ndarray, " frames"]:
    """How far a hand is to the left of the middle of the shoulders (m)."""
    left = at["l_shoulder"] - at["r_shoulder"]
    left /= np.linalg.norm(left, axis=-1, keepdims=True)
    return ((at[f"{side}_hand"] - (at["l_shoulder"] + at["r_shoulder"]) / 2) * left).sum(-1)


def _at_chest(at: Joints) -> Float[np.ndarray, " frames"]:
    """How far the middle of the hands is above or below the trunk's inner part (m)."""
    hands = (at["l_hand"][:, 2] + at["r_hand"][:, 2]) / 2
    return np.maximum(np.abs(hands - (at["neck"][:, 2] + at["pelvis"][:, 2]) / 2) - 0.2, 0.0)


def _bent(at: Joints, side: str) -> Float[np.ndarray, " frames"]:
    """Shortening of an arm by its bent elbow, as a share."""
    way = _apart(at[f"{side}_shoulder"], at[f"{side}_elbow"]) + _apart(at[f"{side}_elbow"], at[f"{side}_hand"])
    return 1 - _apart(at[f"{side}_shoulder"], at[f"{side}_hand"]) / way


POSTURES: dict[str, Callable[[Joints], Float[np.ndarray, " frames"]]] = {
    "arms on the trunk": lambda at: (
        -np.add(*(_apart(at[f"{s}_hand"], at[f"{s}_hip"]) + 3 * _bent(at, s) for s in ("l", "r")))
    ),
    "hand on the face": lambda at: -np.minimum(*(_apart(at[f"{s}_hand"], at["head"]) for s in ("l", "r"))),
    "crossed arms": lambda at: _to_the_left(at, "r") - _to_the_left(at, "l") - 5 * _at_chest(at),
    "hands on the hips": lambda at: np.minimum(
        *(np.minimum(_bent(at, s), 0.3) - 2 * _apart(at[f"{s}_hand"], at[f"{s}_hip"]) for s in ("l", "r"))
    ),
    "crouch": lambda at: -at["pelvis"][:, 2],
    "jump": lambda at: np.minimum(at["l_foot"][:, 2], at["r_foot"][:, 2]),
    "hands above the head": lambda at: np.minimum(at["l_hand"][:, 2], at["r_hand"][:, 2]) - at["head"][:, 2],
}
"""Functions that measure how pronounced each posture is in some frames; only differences matter."""


def true_joints(path: Path) -> Joints:
    """The truth of a sequence file, in metres, z up."""
    recording = read_recording(path)
    if recording.truth is None or recording.up != "+Z":
        raise ValueError(f"{path}: key 'joints': a truth in a world with +Z up is needed to find postures")
    return {name: recording.truth.joints[:, joint] for joint, name in enumerate(JOINT_NAMES)}


def single_frame(recording: Recording, frame: int) -> Poses:
    """Reconstruct one frame of a recording, with the subject calibrated on the whole recording."""
    prepared = prepare(recording, Settings())
    return join_poses(reconstruct_batches(recording[frame : frame + 1], Settings(), prepared))


def drawn(recording: Recording, frame: int, poses: Poses) -> list[np.ndarray]:
    """Cut-outs of the two views that show most of the person, with the skeleton."""
    masks = unpack_silhouettes(recording.silhouettes[frame], int(recording.cameras.size[0, 0]))
    pictures = []
    for view in np.argsort(-masks.sum((1, 2)))[[0, 2]]:
        image = draw_silhouette(masks[view])
        draw_skeleton(image, recording.cameras, int(view), poses.joints[0])
        rows, columns = (np.flatnonzero(masks[view].any(axis)) for axis in (1, 0))
        side = int((1 + 2 * _MARGIN) * max(np.ptp(rows), np.ptp(columns)))
        top, left = (int(line.mean()) - side // 2 for line in (rows[[0, -1]], columns[[0, -1]]))
        padded = cv2.copyMakeBorder(image, side, side, side, side, cv2.BORDER_REPLICATE)
        pictures.append(padded[top + side : top + 2 * side, left + side : left + 2 * side])
    return pictures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--output", "-o", type=Path, required=True, metavar="PICTURE.png")
    arguments = parser.parse_args()
    best: dict[str, tuple[float, Path, int]] = {}
    for path in arguments.sequences:
        at = true_joints(path)
        for posture, shows in POSTURES.items():
            measure = shows(at)
            frame = int(np.argmax(measure))
            if posture not in best or measure[frame] > best[posture][0]:
                best[posture] = float(measure[frame]), path, frame
    pictures, labels = [], []
    for posture, (_, path, frame) in best.items():
        recording = read_recording(path)
        poses = single_frame(recording, frame)
        assert recording.truth is not None
        away = 1e3 * np.linalg.norm(poses.joints[0] - recording.truth.joints[frame], axis=-1)
        print(
            f"{posture}: {path.stem}, frame {frame}: worst joint {away.max():.0f} mm, median {np.median(away):.0f} mm"
        )
        pictures += drawn(recording, frame, poses)
        labels += [posture, f"{path.stem} {frame}: {away.max():.0f} mm"]
    write_image(arguments.output, tile(pictures, labels, columns=4))
    print(f"wrote {arguments.output}")


if __name__ == "__main__":
    main()
