"""Reads Acclaim motion capture, as in the CMU database: a skeleton file (ASF) and a motion file (AMC).

An entry of an ASF is a *bone*. Its position here is that of its far end; its near end is the position of its parent.
A bone rotates about its near end by ``C L C^-1`` relative to its parent, where C comes from its ``axis`` line and L
from the angles of the AMC.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ._capture import Motion, check_scale, check_size, read_text, to_number, to_vector, turn

_INCH = 0.0254


@dataclass
class _Bone:
    where: str
    name: str = ""
    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: np.ndarray = field(default_factory=lambda: np.zeros(3))
    order: str = "xyz"
    channels: tuple[str, ...] = ()


@dataclass
class _Asf:
    bones: list[_Bone]  # the root first
    parents: list[int]
    root_position: np.ndarray
    length_unit: float
    degrees: bool


def read_asf_amc(asf: str | Path, amc: str | Path, fps: float = 120.0, scale: float | None = None) -> Motion:
    """Read one clip.

    Args:
        asf: The skeleton file of the actor.
        amc: The motion file of the clip.
        fps: Frames per second, which AMC files do not state. Most of the CMU database has 120.
        scale: Metres per unit of the files. By default the CMU convention: the numbers are inches times the
            ``:units length`` of the ASF.

    Returns:
        Bone ends (m) in the world of the file, with the y axis up.

    Raises:
        ValueError: One line that names the file and the line.
    """
    texts = read_text(Path(asf)), read_text(Path(amc))
    return parse_asf_amc(*texts, fps=fps, scale=scale, asf_name=str(asf), amc_name=str(amc))


def parse_asf_amc(
    asf_text: str, amc_text: str, fps: float = 120.0, scale: float | None = None, asf_name: str = "ASF",
    amc_name: str = "AMC",
) -> Motion:  # fmt: skip
    """Read one clip from the text of its two files; the names are for error messages. See `read_asf_amc`."""
    skeleton = _parse_asf(asf_text, asf_name)
    scale = _INCH / skeleton.length_unit if scale is None else scale
    check_scale(scale, fps)
    frames, channels = _parse_amc(amc_text, amc_name, skeleton)
    return _place(skeleton, frames, channels, scale, fps)


def _place(skeleton: _Asf, frames: int, channels: dict[str, np.ndarray], scale: float, fps: float) -> Motion:
    count = len(skeleton.bones)
    positions, rest = np.zeros((frames, count, 3)), np.zeros((count, 3))
    rotations: list[np.ndarray] = []
    for j, (bone, parent) in enumerate(zip(skeleton.bones, skeleton.parents, strict=True)):
        values = dict(zip(bone.channels, channels[bone.name].T, strict=True)) if bone.channels else {}
        to_radians = np.deg2rad(1.0) if skeleton.degrees else 1.0
        own = _ordered(bone.order, bone.axis[:, None] * to_radians)
        angles = np.stack([values.get("r" + axis, np.zeros(frames)) for axis in "xyz"])
        local = own @ _ordered(bone.order, angles) @ own.swapaxes(-1, -2)
        if parent < 0:
            moved = np.stack([values.get("t" + axis, np.zeros(frames)) for axis in "xyz"], -1)
            positions[:, j] = (skeleton.root_position + moved) * scale
            rotations.append(local)
        else:
            rotations.append(rotations[parent] @ local)
            vector = bone.direction * bone.length * scale
            positions[:, j] = positions[:, parent] + rotations[j] @ vector
            rest[j] = rest[parent] + vector
    names = tuple(bone.name for bone in skeleton.bones)
    return Motion(names, tuple(skeleton.parents), positions, rest, float(fps), "+Y")


def _ordered(order: str, angles: np.ndarray) -> np.ndarray:
    """Rotations about fixed axes, the first of `order` first; `angles` has a row for each of x, y, z (rad)."""
    first, second, third = (turn(axis, angles["xyz".index(axis)]) for axis in order)
    return third @ second @ first


def _parse_asf(text: str, name: str) -> _Asf:
    root, bones, links = _Bone(f"{name}: root", "root"), [], []
    bone: _Bone | None = None
    section, unit, degrees, position = "", 1.0, True, np.zeros(3)
    for number, line in enumerate(text.splitlines(), 1):
        where, words = f"{name}:{number}", line.split("#")[0].split()
        if not words:
            continue
        key, rest = words[0].lower(), words[1:]
        if key.startswith(":"):
            section = key[1:]
        elif section == "units" and key == "length":
            unit = to_number(rest[0] if rest else "", where)
            if unit < 1e-6:
                raise ValueError(f"{where}: the unit of length is {unit}; it must be positive")
        elif section == "units" and key == "angle":
            degrees = _is_degrees(" ".join(rest), where)
        elif section == "root" and key == "position":
            position = to_vector(rest, where)
        elif section == "root" and key in ("order", "axis", "orientation"):
            _set_root(root, key, rest, where)
        elif section == "bonedata" and key == "begin":
            bone = _Bone(where)
        elif section == "bonedata" and key == "end":
            bones.append(_checked(bone, where))
            bone = None
        elif section == "bonedata" and bone is not None:
            _set_bone(bone, key, rest, where)
        elif section == "hierarchy" and key not in ("begin", "end"):
            links.append((where, words))
    return _linked([root, *bones], links, name, position, unit, degrees)


def _is_degrees(word: str, where: str) -> bool:
    if word.lower() not in ("deg", "degrees", "rad", "radians"):
        raise ValueError(f"{where}: the unit of angles is {word[:40]!r}; give deg or rad")
    return word.lower().startswith("deg")


def _order(word: str, where: str) -> str:
    if sorted(word.lower()) != ["x", "y", "z"]:
        raise ValueError(f"{where}: the axis order {word[:40]!r} is not a permutation of XYZ")
    return word.lower()


def _channels(words: list[str], allowed: tuple[str, ...], where: str) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in words)
    if not set(channels) <= set(allowed) or len(set(channels)) < len(channels):
        raise ValueError(
            f"{where}: the channels {' '.join(words)[:60]!r} must be different ones of {' '.join(allowed)}"
        )
    return channels


def _set_root(root: _Bone, key: str, words: list[str], where: str) -> None:
    if key == "order":
        root.channels = _channels(words, ("tx", "ty", "tz", "rx", "ry", "rz"), where)
    elif key == "axis":
        root.order = _order(words[0] if words else "", where)
    else:
        root.axis = to_vector(words, where)


def _set_bone(bone: _Bone, key: str, words: list[str], where: str) -> None:
    if key == "name":
        bone.name = words[0] if words else ""
    elif key == "direction":
        direction = to_vector(words, where)
        length = np.linalg.norm(direction)
        if length < 1e-6:
            raise ValueError(f"{where}: bone {bone.name} has no direction")
        bone.direction = direction / length
    elif key == "length":
        bone.length = to_number(words[0] if words else "", where)
    elif key == "axis":
        bone.axis, bone.order = to_vector(words, where), _order(words[3] if len(words) > 3 else "", where)
    elif key == "dof":
        bone.channels = _channels(words, ("rx", "ry", "rz"), where)


def _checked(bone: _Bone | None, where: str) -> _Bone:
    if bone is None:
        raise ValueError(f"{where}: 'end' without 'begin'")
    if not bone.name or not bone.direction.any() or bone.length < 0:
        raise ValueError(f"{bone.where}: this bone needs a name, a direction and a length that is not negative")
    return bone


def _linked(
    bones: list[_Bone],
    links: list[tuple[str, list[str]]],
    name: str,
    position: np.ndarray,
    unit: float,
    degrees: bool,
) -> _Asf:
    """Sort the bones so that parents come before their children."""
    by_name = {bone.name: bone for bone in bones}
    if len(by_name) < len(bones):
        raise ValueError(f"{name}: two bones have the same name, or one is called root")
    ordered, index, parents = [bones[0]], {"root": 0}, [-1]
    for where, (parent, *children) in links:
        if parent not in index:
            raise ValueError(f"{where}: bone {parent[:40]!r} has children before it has a parent")
        for child in children:
            if child not in by_name or child in index:
                raise ValueError(f"{where}: {child[:40]!r} is not a bone, or has a parent already")
            index[child] = len(ordered)
            ordered.append(by_name[child])
            parents.append(index[parent])
    loose = [bone.name for bone in bones if bone.name not in index]
    if loose:
        raise ValueError(f"{name}: the hierarchy does not hold {' '.join(loose[:5])[:80]}")
    check_size(1, len(ordered), name)
    return _Asf(ordered, parents, position, unit, degrees)


def _parse_amc(text: str, name: str, skeleton: _Asf) -> tuple[int, dict[str, np.ndarray]]:
    """Number of frames, and the channels of every bone that has some: ``(frames, channels)``, radians."""
    moving = {bone.name: bone for bone in skeleton.bones if bone.channels}
    rows: dict[str, list[list[float]]] = {bone: [] for bone in moving}
    degrees, frames = skeleton.degrees, 0

    def check_complete(where: str) -> None:
        short = [bone for bone, values in rows.items() if len(values) != frames]
        if short:
            raise ValueError(f"{where}: frame {frames} of the file lacks {' '.join(short[:5])[:80]}")

    where = name
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        where = f"{name}:{number}"
        if words[0].startswith(":"):
            if words[0].lower() in (":degrees", ":radians"):
                degrees = words[0].lower() == ":degrees"
        elif len(words) == 1 and words[0].isascii() and words[0].isdigit():
            check_complete(where)
            frames += 1
            check_size(frames, len(skeleton.bones), where)
        else:
            bone = moving.get(words[0])
            if bone is None or len(rows[words[0]]) != frames - 1 or len(words) - 1 != len(bone.channels):
                raise ValueError(f"{where}: {_complaint(words, bone, frames)}")
            rows[words[0]].append([to_number(word, where) for word in words[1:]])
    check_complete(where)
    check_size(frames, len(skeleton.bones), name)
    to_radians = np.deg2rad(1.0) if degrees else 1.0
    factors = {bone: [1.0 if c[0] == "t" else to_radians for c in moving[bone].channels] for bone in moving}
    return frames, {bone: np.array(values) * factors[bone] for bone, values in rows.items()}


def _complaint(words: list[str], bone: _Bone | None, frames: int) -> str:
    if bone is None:
        return f"{words[0][:40]!r} is not a moving bone of this skeleton; is it the ASF of the same actor?"
    if len(words) - 1 != len(bone.channels):
        return f"{bone.name} needs {len(bone.channels)} values ({' '.join(bone.channels)}), not {len(words) - 1}"
    if frames == 0:
        return "values before the number of the first frame"
    return f"{bone.name} is given twice in one frame"
