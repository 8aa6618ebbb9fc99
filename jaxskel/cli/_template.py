"""The option ``--template``: a skeleton of the package's, or one from a file."""

from pathlib import Path
from typing import Annotated

import typer

from ..body import HUMAN_15, Skeleton
from ..io.templates import BUILT_IN, built_in, read_template
from ..poses import Poses

TemplateOption = Annotated[
    str | None,
    typer.Option("--template", help=f"TOML file with another skeleton, or {', '.join(BUILT_IN)}. Default: 15 joints."),
]


def template_of(given: str | None) -> Skeleton | None:
    """The skeleton that the option names; None for the default one."""
    if given is None or given == HUMAN_15.name:
        return None
    if given in BUILT_IN:
        return built_in(given)
    if not Path(given).is_file():
        raise ValueError(f"--template {given}: is no file; give a TOML file, or one of {', '.join(BUILT_IN)}")
    return read_template(given)


def files_of_template(given: str | None) -> list[Path]:
    """The file that the option names, if it names one."""
    return [Path(given)] if given is not None and Path(given).is_file() else []


def found_subject(poses: Poses) -> str:
    """What was found out about a subject whose dimensions were unknown."""
    assert poses.skeleton is not None  # poses of a run have one
    skeleton, deviation = poses.skeleton, poses.stature_deviation
    if not skeleton.template.is_human:
        return f"unknown subject: {skeleton.template.name}, {skeleton.size:.3g} m at its largest extent"
    if deviation is None:
        return f"unknown subject: stature {skeleton.stature:.2f} m, average proportions"
    return f"unknown subject: stature {skeleton.stature:.2f} +- {deviation:.2f} m"
