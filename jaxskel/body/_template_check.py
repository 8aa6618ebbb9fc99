"""Checks a template: indices that point nowhere would fail far from the mistake, or silently."""

from typing import Any


def check_template(template: Any) -> None:
    """Refuse what is no tree, and indices that point nowhere.

    Args:
        template: A `SkeletonTemplate`.

    Raises:
        ValueError: One line that names the field.
    """
    joints, tips, segments = (
        len(names) for names in (template.joint_names, template.tip_names, template.segment_names)
    )
    pivots, hinges = [pivot.joint for pivot in template.pivots], [hinge.joint for hinge in template.hinges]
    for name, values, count, most in (
        ("tip_parents", template.tip_parents, tips, joints),
        ("segment_of_joint", template.segment_of_joint, joints, segments),
        ("segment_of_tip", template.segment_of_tip, tips, segments),
        ("segment_of_pivot", template.segment_of_pivot, len(pivots), segments),
        ("freedoms", template.freedoms, segments, 4),
        ("inner", template.inner, len(template.inner), joints),
        ("described_by", template.described_by, len(template.described_by), tips),
        ("pivots", pivots, len(pivots), joints),
        ("hinges", hinges, len(hinges), joints),
        ("hinges", [hinge.segment for hinge in template.hinges], len(hinges), segments),
        ("hinges", [hinge.end for hinge in template.hinges], len(hinges), joints + tips + len(pivots)),
        ("attracted", [bone.joint for bone in template.attracted], len(template.attracted), joints),
        ("attracted", [bone.tip for bone in template.attracted], len(template.attracted), tips),
    ):
        if len(values) != count or not all(0 <= value < most for value in values):
            raise ValueError(f"{name}: is {values!r}; give {count} indices below {most}")
    for name, parents, count in (
        ("joint_parents", template.joint_parents, joints), ("segment_parents", template.segment_parents, segments)
    ):  # fmt: skip
        above = [0 <= parent < number for number, parent in enumerate(parents[1:], 1)]
        if len(parents) != count or parents[:1] != (-1,) or not all(above):
            raise ValueError(f"{name}: is {parents!r}; give {count}, parents before children, -1 for the first")
    for name, values, count in (
        ("firmness", template.firmness, segments - 1), ("swings", template.swings or None, segments),
        ("meanings", template.meanings or None, joints + tips), ("radii", template.radii, joints + tips),
    ):  # fmt: skip
        if values is not None and len(values) != count:
            raise ValueError(f"{name}: has {len(values)} entries; give {count}")
