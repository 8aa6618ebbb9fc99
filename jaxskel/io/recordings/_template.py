"""The template in a file: its text, and the names of its points. A file without a text is of the paper's human."""

from pathlib import Path

import numpy as np

from ...body import HUMAN_15, SkeletonTemplate, template_of_text
from ..files import fault, texts

TEMPLATE_KEYS = ("template", "joint_names", "tip_names")
"""Keys of a file that say what its joints and tips are."""


def template_of(path: Path, arrays: dict[str, np.ndarray]) -> SkeletonTemplate:
    """The template of a file, whose names of joints and tips are checked.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    template = HUMAN_15
    if "template" in arrays:
        (text,) = texts(path, arrays, "template")[:1] or [""]
        try:
            template = template_of_text(text)
        except ValueError as error:
            raise fault(path, "template", str(error)) from None
    check_names(path, arrays, "joint_names", template.joint_names)
    check_names(path, arrays, "tip_names", template.tip_names)
    return template


def template_arrays(template: SkeletonTemplate) -> dict[str, str]:
    """What a file holds of the template beside its names: nothing of the paper's human, which readers take it for."""
    return {} if template == HUMAN_15 else {"template": template.text}


def check_names(path: Path, arrays: dict[str, np.ndarray], key: str, names: tuple[str, ...]) -> None:
    """Refuse a file that lists its joints in another order; a file without the key is trusted.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    if key in arrays and tuple(texts(path, arrays, key)) != names:
        raise fault(path, key, f"reorder the file to {', '.join(names)}")
