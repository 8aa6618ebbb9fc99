"""Clothes, hair and luggage for recordings whose joints are known: tapered capsules added to the silhouettes.

What a garment hides of the gap between legs, or adds to an arm, is in the silhouettes and not body. Which garments a
recording wears depends on the seed and its name; they move with the joints.
"""

import zlib
from collections.abc import Callable

import equinox as eqx
import numpy as np
from jaxtyping import Float

from jaxskel import JOINT_NAMES, Recording
from jaxskel._math.vectors import unit
from jaxskel.synthetic import render

_Capsule = tuple[Float[np.ndarray, "frames 3"], Float[np.ndarray, "frames 3"], float, float]
"""Centres of the balls at both ends (m), and their radii (m)."""
_Joints = dict[str, Float[np.ndarray, "frames 3"]]
# Distances from knee to ankle and from there to the joint ``foot``, as shares of the median distance from knee to foot,
# on the average adult.
_SHANK, _INSTEP = 0.87, 0.27


def with_clothes(recording: Recording, seed: int) -> Recording:
    """The recording with its subject in one to three of `GARMENTS`.

    Raises:
        ValueError: The joints are not known.
    """
    if recording.truth is None:
        raise ValueError(f"{recording.name}: key 'joints': clothes are hung on known joints")
    rng = np.random.default_rng([seed, zlib.crc32(recording.name.encode())])
    joints: _Joints = dict(
        zip(JOINT_NAMES, np.moveaxis(np.asarray(recording.truth.joints, np.float64), 1, 0), strict=True)
    )
    size = float(np.linalg.norm(joints["l_shoulder"] - joints["r_shoulder"], axis=-1).mean()) / 0.34
    worn = rng.choice(len(GARMENTS), rng.integers(1, 4), replace=False)
    capsules = [capsule for number in sorted(worn) for capsule in GARMENTS[list(GARMENTS)[number]](joints, size, rng)]
    ends = np.stack([np.stack([start, end], 1) for start, end, _, _ in capsules], 1)
    radii = np.array([[first, last] for _, _, first, last in capsules])
    return eqx.tree_at(
        lambda r: r.silhouettes, recording,
        np.asarray(recording.silhouettes) | render(recording.cameras, ends, radii),
    )  # fmt: skip


def _skirt(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """From the hips to somewhere between knee and shank, closed between the legs."""
    reach, width = rng.uniform(0.8, 1.4), size * rng.uniform(0.10, 0.14)
    hems = [_along(joints, side, reach) for side in "lr"]
    hips = [joints["l_hip"], joints["r_hip"]]
    shares = np.linspace(0, 1, 5)
    return [
        (hips[0] + s * (hips[1] - hips[0]), hems[0] + s * (hems[1] - hems[0]), 0.11 * size, width) for s in shares
    ]  # fmt: skip


def _coat(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """Around the trunk, with wide shoulders, to the middle of the thighs."""
    thick = size * rng.uniform(0.13, 0.17)
    trunk = [
        (joints[f"{side}_shoulder"], joints[f"{side}_hip"], thick * 0.7, thick) for side in "lr"
    ]  # fmt: skip
    return [*trunk, (joints["neck"], joints["pelvis"], thick * 0.8, thick), *_shortened(_skirt(joints, size, rng), 0.5)]


def _sleeves(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """Around both arms, open at the wrists."""
    wide = size * rng.uniform(0.06, 0.085)
    cuffs = {side: joints[f"{side}_elbow"] + 0.7 * (joints[f"{side}_hand"] - joints[f"{side}_elbow"]) for side in "lr"}
    upper = [(joints[f"{side}_shoulder"], joints[f"{side}_elbow"], wide, wide * 0.9) for side in "lr"]
    return upper + [(joints[f"{side}_elbow"], cuffs[side], wide * 0.9, wide * 0.95) for side in "lr"]


def _trousers(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """Around both legs down to the ankles."""
    wide = size * rng.uniform(0.075, 0.10)
    ankles = {side: _along(joints, side, 1.9) for side in "lr"}
    upper = [(joints[f"{side}_hip"], joints[f"{side}_knee"], wide * 1.2, wide) for side in "lr"]
    return upper + [(joints[f"{side}_knee"], ankles[side], wide, wide * 0.9) for side in "lr"]


def _hood(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """Around the head, or a hat on it."""
    up = unit(joints["head"] - joints["neck"])
    return [(joints["neck"], joints["head"] + 0.04 * size * up, 0.09 * size, size * rng.uniform(0.12, 0.15))]


def _hair(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """From the back of the head down over the shoulders."""
    front, up = _front(joints), unit(joints["head"] - joints["neck"])
    back = joints["head"] - 0.07 * size * front
    return [(back, back - size * rng.uniform(0.15, 0.4) * up - 0.03 * size * front, 0.09 * size, 0.07 * size)]


def _backpack(joints: _Joints, size: float, rng: np.random.Generator) -> list[_Capsule]:
    """Behind the chest."""
    front, thick = _front(joints), size * rng.uniform(0.09, 0.13)
    middle = (joints["neck"] + joints["pelvis"]) / 2 - 0.18 * size * front
    half = (joints["neck"] - joints["pelvis"]) * 0.3
    aside = 0.07 * size * unit(joints["l_shoulder"] - joints["r_shoulder"])
    return [(middle + half + way * aside, middle - half + way * aside, thick, thick) for way in (-1, 1)]


GARMENTS: dict[str, Callable[[_Joints, float, np.random.Generator], list[_Capsule]]] = {
    "skirt": _skirt, "coat": _coat, "sleeves": _sleeves, "trousers": _trousers, "hood": _hood, "hair": _hair,
    "backpack": _backpack,
}  # fmt: skip
"""What subjects may wear, by name."""


def _along(joints: _Joints, side: str, way: float) -> Float[np.ndarray, "frames 3"]:
    """A point on a leg: 0 at the hip, 1 at the knee, 2 at the ankle."""
    points = [joints[f"{side}_hip"], joints[f"{side}_knee"], _ankle(joints, side)]
    first = min(int(way), 1)
    return points[first] + (way - first) * (points[first + 1] - points[first])


def _ankle(joints: _Joints, side: str) -> Float[np.ndarray, "frames 3"]:
    """The ankle, which is behind the line from the knee to the joint ``foot``, the ball of the foot."""
    knee, foot = joints[f"{side}_knee"], joints[f"{side}_foot"]
    down, apart = unit(foot - knee), np.linalg.norm(foot - knee, axis=-1)
    shank, instep = _SHANK * np.median(apart), _INSTEP * np.median(apart)
    left = joints["l_hip"] - joints["r_hip"]
    front = np.cross(down, unit(left - (left * down).sum(-1, keepdims=True) * down))
    # Of the triangle of knee, ankle and foot all sides are known.
    far = np.clip((shank**2 - instep**2 + apart**2) / (2 * apart), -shank, shank)
    return knee + far[:, None] * down - np.sqrt(shank**2 - far**2)[:, None] * front


def _shortened(capsules: list[_Capsule], share: float) -> list[_Capsule]:
    return [(start, start + share * (end - start), first, last) for start, end, first, last in capsules]


def _front(joints: _Joints) -> Float[np.ndarray, "frames 3"]:
    """Where the chest faces."""
    return unit(np.cross(joints["l_shoulder"] - joints["r_shoulder"], joints["neck"] - joints["pelvis"]))
