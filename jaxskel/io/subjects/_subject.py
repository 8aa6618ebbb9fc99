"""Subject files: a person's known dimensions in TOML, written by hand with a tape measure.

stature = 1.75        # standing height (m)

[lengths]             # from joint centre to joint centre (m); what is not given follows from the stature
upper_arm = 0.29
l_thigh = 0.43        # one side only

A calibrated body adds a table of its own, see `flesh.py`.
"""

import reprlib
from pathlib import Path
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...body import JOINT_NAMES, JOINT_PARENTS, TIP_NAMES, TIP_PARENTS, Body, Skeleton, default_adult, make_skeleton
from ..files import TOML_LINE, check_known, fault, read_toml
from ._flesh import body_of, flesh_lines

# The point where each length ends; it begins at the point's parent. Two-sided names lack their l_ or r_.
_MIDDLE = {"trunk": "neck", "neck": "head", "head_top": "head_top"}
_SIDED = {
    "shoulder": "shoulder", "upper_arm": "elbow", "forearm": "hand", "fingertip": "fingertip",
    "hip": "hip", "thigh": "knee", "shank": "foot", "toetip": "toetip",
}  # fmt: skip
_POINTS = JOINT_NAMES + TIP_NAMES
_PARENTS = JOINT_PARENTS + TIP_PARENTS

_SHORTEST = 0.005  # m: shorter than any length of a body
_LONGEST = 1.5  # m: longer than any bone, so the value is in centimetres or millimetres
_STATURES = (0.4, 2.8)  # m: range of statures


def read_subject(path: str | Path) -> Skeleton:
    """Read a subject's dimensions.

    `stature` (m) scales an average adult ([`default_adult`][]); the table `lengths` (m) replaces single lengths: trunk
    (pelvis to neck), neck (to the middle of the head), shoulder (from the neck), upper_arm, forearm (elbow to palm),
    hip (from the pelvis), thigh, shank (knee to ball of foot), head_top, fingertip and toetip (each from its joint).
    Two-sided names may carry l_ or r_. Without a stature, a least-squares scale of the average adult to the given
    lengths determines the others. Directions at rest are those of the average adult.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    return _skeleton(path, _parse(path))


def read_body(path: str | Path) -> Body | None:
    """Read a subject's body, as `jaxskel calibrate-body` writes it; None if the file has only lengths.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    table = _parse(path)
    return body_of(path, _skeleton(path, table), table["flesh"]) if "flesh" in table else None


def _skeleton(path: Path, table: dict[str, Any]) -> Skeleton:
    stature, lengths = _dimensions(path, table)
    adult = default_adult()
    if stature is not None:
        adult = adult.scaled(stature / adult.stature)
    else:
        usual = _lengths(adult)
        given = np.array(list(lengths.values()))
        average = np.array([usual[point] for point in lengths])
        adult = adult.scaled(float(given @ average / (average @ average)))
    points = np.concatenate([adult.rest_joints, adult.rest_tips])
    built = points.copy()
    for i, (point, parent) in enumerate(zip(_POINTS, _PARENTS, strict=True)):
        if parent >= 0:
            bone = points[i] - points[parent]
            built[i] = built[parent] + bone * (lengths.get(point, np.linalg.norm(bone)) / np.linalg.norm(bone))
    try:
        return make_skeleton(built[: len(JOINT_NAMES)], built[len(JOINT_NAMES) :])
    except ValueError as error:
        raise fault(path, "lengths", str(error)) from None


def write_subject(path: str | Path, skeleton: Skeleton, body: Body | None = None) -> None:
    """Write the lengths of a skeleton (m), rounded to a micrometre; the directions of its bones at rest are lost.

    Args:
        path: File to write.
        skeleton: The subject's dimensions.
        body: The subject's calibrated flesh, if any, to write as well.
    """
    lengths = {point: f"{length:.6f}" for point, length in _lengths(skeleton).items()}
    lines = [TOML_LINE, f"stature = {skeleton.stature:.6f}", "", "[lengths]"]
    lines += [f"{key} = {lengths[point]}" for key, point in _MIDDLE.items()]
    for key, point in _SIDED.items():
        left, right = lengths[f"l_{point}"], lengths[f"r_{point}"]
        lines += [f"{key} = {left}"] if left == right else [f"l_{key} = {left}", f"r_{key} = {right}"]
    if body is not None:
        lines += ["", *flesh_lines(body)]
    with written_whole(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())


def _parse(path: Path) -> dict[str, Any]:
    return read_toml(path, ("stature", "lengths", "flesh"), "stature and lengths", "stature = 1.75")


def _dimensions(path: Path, table: dict[str, Any]) -> tuple[float | None, dict[str, float]]:
    """Stature (m), and lengths (m) by the point where they end."""
    stature = None
    if "stature" in table:
        stature = _length(path, "stature", table["stature"], *_STATURES)
    given = table.get("lengths", {})
    if not isinstance(given, dict):
        raise fault(path, "lengths", "give a table: a line [lengths], then lines such as thigh = 0.42")
    sided = {f"{side}{key}": f"{side}{point}" for side in ("l_", "r_") for key, point in _SIDED.items()}
    for key in given:
        check_known(path, key, [*_MIDDLE, *_SIDED, *sided])
    measured = {key: _length(path, key, value, _SHORTEST, _LONGEST) for key, value in given.items()}
    lengths = {point: measured[key] for key, point in _MIDDLE.items() if key in measured}
    for side in ("l_", "r_"):
        for key, point in _SIDED.items():
            # A length for one side has priority over the length for both.
            if side + key in measured or key in measured:
                lengths[side + point] = measured.get(side + key, measured.get(key, 0.0))
    if stature is None and not lengths:
        raise fault(path, "stature", "is missing; give the standing height in metres, stature = 1.75, or lengths")
    return stature, lengths


def _length(path: Path, key: str, value: Any, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least < value:
        raise fault(path, key, f"is {reprlib.repr(value)}; give a length of more than {least} in metres")
    if not value <= most:
        raise fault(
            path,
            key,
            f"is {reprlib.repr(value)}, more than {most}; in metres; divide cm by 100, mm by 1000",
        )
    return float(value)


def _lengths(skeleton: Skeleton) -> dict[str, float]:
    """Length from its parent to each point except the pelvis (m)."""
    lengths = [*skeleton.bone_lengths, *skeleton.tip_lengths]
    return dict(zip(_POINTS[1:], map(float, lengths), strict=True))
