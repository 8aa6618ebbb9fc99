"""Reads Biovision motion capture (BVH): a hierarchy of joints and one row of channels for each frame."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...recording import UP_AXES
from ._capture import Motion, check_scale, check_size, read_text, to_number, to_vector, turn

_CHANNELS = ("xposition", "yposition", "zposition", "xrotation", "yrotation", "zrotation")


@dataclass
class _Joint:
    name: str
    parent: int
    where: str
    offset: np.ndarray | None = None
    channels: tuple[str, ...] = field(default_factory=tuple)


def read_bvh(path: str | Path, scale: float = 0.01, up: str = "+Y") -> Motion:
    """Read one clip.

    Args:
        path: The file.
        scale: Metres per unit of the file, which does not state it: 0.01 for the usual centimetres, ``0.0254 / 0.45``
            for conversions of the CMU database that keep its numbers.
        up: World axis that points up in the file, which does not state it either.

    Returns:
        Joint centres (m) in the world of the file. An ``End Site`` is a joint named after its parent with ``_End``
        added. Position channels replace the offset of their joint.

    Raises:
        ValueError: One line that names the file and the line.
    """
    return parse_bvh(read_text(Path(path)), scale, up, str(path))


def parse_bvh(text: str, scale: float = 0.01, up: str = "+Y", name: str = "BVH") -> Motion:
    """Read one clip from the text of its file; the name is for error messages. See `read_bvh`.

    Raises:
        ValueError: One line that names the clip, the line and how to mend it.
    """
    check_scale(scale)
    if up not in UP_AXES:
        raise ValueError(f"up axis {up!r}: give one of {', '.join(UP_AXES)}")
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.split()[:1] == ["MOTION"]), None)
    if start is None:
        raise ValueError(f"{name}: no line MOTION; the file is cut short or not a BVH")
    joints = _parse_hierarchy(lines[:start], name)
    fps, rows = _parse_motion(lines[start + 1 :], start + 2, joints, name)
    return _place(joints, rows, scale, fps, up)


def _place(joints: list[_Joint], rows: np.ndarray, scale: float, fps: float, up: str) -> Motion:
    positions, rest = np.zeros((len(rows), len(joints), 3)), np.zeros((len(joints), 3))
    rotations: list[np.ndarray] = []
    column = 0
    for j, joint in enumerate(joints):
        offset = np.zeros(3) if joint.offset is None else joint.offset
        moved = np.broadcast_to(offset, (len(rows), 3)).copy()
        local = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
        for channel in joint.channels:
            values = rows[:, column]
            column += 1
            if channel.endswith("position"):
                moved[:, "xyz".index(channel[0])] = values
            else:
                # Listed from the outermost rotation to the innermost.
                local = local @ turn(channel[0], np.deg2rad(values))
        if joint.parent < 0:
            positions[:, j] = moved * scale
            rotations.append(local)
        else:
            around = rotations[joint.parent]
            positions[:, j] = positions[:, joint.parent] + np.einsum("fij,fj->fi", around, moved) * scale
            rest[j] = rest[joint.parent] + offset * scale
            rotations.append(around @ local)
    names, parents = tuple(joint.name for joint in joints), tuple(joint.parent for joint in joints)
    return Motion(names, parents, positions, rest, fps, up)


def _parse_hierarchy(lines: list[str], name: str) -> list[_Joint]:
    joints: list[_Joint] = []
    # Joints with open braces, and the joint that the next brace opens.
    stack: list[int] = []
    announced: int | None = None
    for number, line in enumerate(lines, 1):
        where = f"{name}:{number}"
        # A brace may follow a name or be on its own line.
        for words in (part.split() for part in re.split(r"([{}])", line)):
            if not words or words[0] == "HIERARCHY":
                continue
            if words[0] == "{" and announced is not None:
                stack.append(announced)
                announced = None
            elif words[0] == "}" and stack and announced is None:
                stack.pop()
            elif words[0] in ("ROOT", "JOINT", "End") and announced is None:
                announced = len(joints)
                joints.append(_new_joint(words, joints, stack, where))
                check_size(1, len(joints), where)
            elif words[0] == "OFFSET" and stack:
                joints[stack[-1]].offset = to_vector(words[1:], where)
            elif words[0] == "CHANNELS" and stack:
                joints[stack[-1]].channels = _channels(words[1:], where)
            else:
                raise ValueError(f"{where}: {' '.join(words)[:60]!r} is not expected here")
    if not joints or stack or announced is not None:
        raise ValueError(f"{name}: the hierarchy holds no joint, or its braces do not match")
    lacking = [joint for joint in joints if joint.offset is None]
    if lacking:
        raise ValueError(f"{lacking[0].where}: joint {lacking[0].name[:40]} has no OFFSET")
    return joints


def _new_joint(words: list[str], joints: list[_Joint], stack: list[int], where: str) -> _Joint:
    parent = stack[-1] if stack else -1
    if (words[0] == "ROOT") != (not joints) or (joints and parent < 0):
        raise ValueError(f"{where}: one ROOT is expected, and every other joint inside of it")
    if words[0] == "End":
        # A joint may have several end sites.
        name, ends = joints[parent].name + "_End", sum(joint.parent == parent for joint in joints)
        name = name if all(joint.name != name for joint in joints) else f"{name}{ends}"
    else:
        name = " ".join(words[1:])
    if not name or any(joint.name == name for joint in joints):
        raise ValueError(f"{where}: the joint name {name[:40]!r} is empty or given twice")
    return _Joint(name, parent, where)


def _channels(words: list[str], where: str) -> tuple[str, ...]:
    channels = tuple(word.lower() for word in words[1:])
    if not words or words[0] != str(len(channels)) or not set(channels) <= set(_CHANNELS) or len(channels) > 6:
        raise ValueError(
            f"{where}: CHANNELS {' '.join(words)[:80]!r} should be a number and so many of Xposition ... Zrotation"
        )
    return channels


def _parse_motion(lines: list[str], first: int, joints: list[_Joint], name: str) -> tuple[float, np.ndarray]:
    """Frames per second, and one row of channels for each frame."""
    heads: dict[str, tuple[int, str]] = {}
    body: list[tuple[int, list[str]]] = []
    for number, line in enumerate(lines, first):
        key, colon, value = line.partition(":")
        if colon and not body:
            heads[" ".join(key.split())] = number, value.strip()
        elif line.strip():
            body.append((number, line.split()))
    if "Frames" not in heads or "Frame Time" not in heads:
        raise ValueError(f"{name}:{first}: lines 'Frames:' and 'Frame Time:' are expected after MOTION")
    (at, declared), (at_time, time) = heads["Frames"], heads["Frame Time"]
    seconds = to_number(time, f"{name}:{at_time}")
    if not 1e-6 < seconds < 1e6:
        raise ValueError(f"{name}:{at_time}: a frame time of {seconds} s; it must be positive")
    columns = sum(len(joint.channels) for joint in joints)
    found = sum(len(words) for _, words in body)
    if not (declared.isascii() and declared.isdigit() and len(declared) < 10) or int(declared) * columns != found:
        raise ValueError(
            f"{name}:{at}: 'Frames: {declared[:40]}' of {columns} channels do not agree with the {found} "
            "numbers in the file"
        )
    check_size(int(declared), len(joints), f"{name}:{at}")
    if columns == 0:
        raise ValueError(f"{name}: no joint has channels, so nothing moves")
    values = [to_number(word, f"{name}:{number}") for number, words in body for word in words]
    return 1.0 / seconds, np.array(values).reshape(int(declared), columns)
