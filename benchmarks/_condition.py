"""Conditions under which a recording is reconstructed: options shared by the benchmarks."""

import argparse
from dataclasses import dataclass

import equinox as eqx
from _clothes import with_clothes
from _slim import with_slim_body
from disturb import with_cameras, with_dirty_masks, with_wrong_bones

from jaxskel import Recording


@dataclass(frozen=True)
class Condition:
    """Changes made to a recording before it is reconstructed. By default none."""

    cameras: tuple[int, ...] | None = None
    """Indices of the cameras used; None is all of them."""
    dirty: int | None = None
    """Seed of the dirty masks; None leaves the silhouettes as they are."""
    bones: float = 0.0
    """Error of each bone length, as a share of it."""
    seed: int = 0
    """Seed of the wrong bone lengths."""
    clothes: int | None = None
    """Seed of the clothes; None adds none."""
    slim: float | None = None
    """Radii of a slim body that replaces the silhouettes, as a share of the average body's; None keeps them."""
    unknown: bool = False
    """Whether the subject's dimensions are withheld."""
    step: int = 1
    """One frame in this many is used."""

    def __str__(self) -> str:
        parts = []
        if self.cameras is not None:
            parts.append(f"cameras {' '.join(map(str, self.cameras))}")
        if self.dirty is not None:
            parts.append(f"dirty masks (seed {self.dirty})")
        if self.bones:
            parts.append(f"bones ±{100 * self.bones:g} % (seed {self.seed})")
        if self.clothes is not None:
            parts.append(f"clothes (seed {self.clothes})")
        if self.slim is not None:
            parts.append(f"slim body ({self.slim:g} of the radii)")
        if self.unknown:
            parts.append("dimensions unknown")
        if self.step > 1:
            parts.append(f"1 frame in {self.step}")
        return ", ".join(parts)


def disturbed(recording: Recording, condition: Condition) -> Recording:
    """The recording under a condition. Frames and cameras are chosen first, to save time."""
    if condition.step > 1:
        fewer = recording[:: condition.step]
        recording = eqx.tree_at(lambda r: r.fps, fewer, recording.fps / condition.step)
    if condition.cameras is not None:
        recording = with_cameras(recording, condition.cameras)
    if condition.slim is not None:
        recording = with_slim_body(recording, condition.slim)
    if condition.clothes is not None:
        recording = with_clothes(recording, condition.clothes)
    if condition.dirty is not None:
        recording = with_dirty_masks(recording, condition.dirty)
    if condition.bones:
        recording = with_wrong_bones(recording, condition.bones, condition.seed)
    if condition.unknown:
        recording = eqx.tree_at(lambda r: r.skeleton, recording, None, is_leaf=lambda leaf: leaf is None)
    return recording


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that make up a `Condition`."""
    parser.add_argument("--cameras", type=_indices, metavar="0,2,3", help="use only these cameras")
    parser.add_argument("--dirty", type=_whole, metavar="SEED", help="dirty masks: rough edges, holes, a black view")
    parser.add_argument("--clothes", type=_whole, metavar="SEED", help="skirts, coats, hair, backpacks and the like")
    parser.add_argument("--slim", type=_share, metavar="SHARE", help="slim bodies: this share of the average radii")
    parser.add_argument("--unknown", action="store_true", help="withhold the subject's dimensions")
    parser.add_argument("--bones", type=_share, metavar="SHARE", default=0.0, help="bone lengths off by this share")
    parser.add_argument("--seed", type=_whole, default=0, help="seed of the bone lengths")
    parser.add_argument("--step", type=_positive, default=1, metavar="N", help="one frame in N only")


def condition_of(arguments: argparse.Namespace) -> Condition:
    """The condition that the options of `add_options` ask for."""
    return Condition(
        arguments.cameras, arguments.dirty, arguments.bones, arguments.seed, arguments.clothes, arguments.slim,
        arguments.unknown, arguments.step,
    )  # fmt: skip


def _indices(text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: give indices with commas between them, as 0,2,3") from None


def _whole(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number from 0 on")
    return int(text)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number from 1 on")
    return int(text)


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0 <= share < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: give a share from 0 to below 1, as 0.05 for 5 %")
    return share
