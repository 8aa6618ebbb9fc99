"""The page of several people: the scripts of one person's page, and more that draw everybody by them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..._runtime.plain_text import plain
from ...body import SkeletonTemplate
from ...poses import Poses
from ...recording import Recording, recording_rows, rotation_to_z_up
from .. import check_people
from ._content import Content
from ._filled import filled
from ._numbers import body_points, packed_sides, pose_numbers, scene_numbers, steps_of, time_numbers, view_numbers
from ._one import SCRIPTS
from ._overlays import Overlays
from ._packed import packed
from ._tables import bone_lengths_of_people, facts_of_people, varying_bones

# In order of their dependencies. They extend the classes of one person's page, and take their names.
_PEOPLE_SCRIPTS = ("people.js", "people_scene.js", "people_charts.js", "people_player.js")


def content_of_people(recording: Recording, people: Mapping[str, Poses]) -> Content:
    """Everybody in 3D and over the silhouettes, in a colour of their own.

    Raises:
        ValueError: There is nobody, or the poses are of another recording, or not of the same frames and template.
    """
    check_people(people)
    first = next(iter(people.values()))

    def page(overlays: Overlays) -> str:
        return filled(
            "page.html", (*SCRIPTS, *_PEOPLE_SCRIPTS, "start.js"), recording.name,
            _people_numbers(recording, people, overlays), ("style.css", "people.css"),
            facts=facts_of_people(recording, people), bones=bone_lengths_of_people(people),
            varying=varying_bones(first), score="",
        )  # fmt: skip

    return Content(recording_rows(recording, first), np.stack([body_points(each) for each in people.values()]), page)


def _people_numbers(recording: Recording, people: Mapping[str, Poses], overlays: Overlays) -> dict[str, Any]:
    """The data of one person's page, but what differs from person to person is in ``people``, a row for each."""
    first = next(iter(people.values()))
    turn = rotation_to_z_up(first.up)
    shown = [body_points(poses) @ turn.T for poses in people.values()]
    origin, step = steps_of(shown)
    scene = scene_numbers(recording, first.template, np.concatenate(shown), origin, step)
    each = [
        {"name": plain(name), "side_confidence": packed_sides(poses), "skeletons": packed(skeletons, "<i2")}
        | pose_numbers(poses, origin, step)
        for (name, poses), skeletons in zip(people.items(), overlays.skeletons, strict=True)
    ]
    return (
        scene | _everybody(first.template, len(people)) | time_numbers(first) | view_numbers(recording, overlays)
        | {"truth_joints": [], "truth": None, "people": each}
    )  # fmt: skip


def _everybody(template: SkeletonTemplate, count: int) -> dict[str, Any]:
    """The points of everybody as those of one skeleton with many roots: the joints of all, then the tips of all."""
    joints, parents = len(template.joint_names), template.point_parents
    of_each = [np.where(parents < 0, -1, parents + who * joints) for who in range(count)]
    return {
        "joints": [plain(name) for name in template.joint_names] * count,
        "tips": [plain(name) for name in template.tip_names] * count,
        "parents": [*np.concatenate([own[:joints] for own in of_each]).tolist(),
                    *np.concatenate([own[joints:] for own in of_each]).tolist()],
    }  # fmt: skip
