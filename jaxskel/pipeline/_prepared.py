"""Data shared by all frames of a recording."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from ..body import JOINT_NAMES, Body, Skeleton
from ..cameras import Cameras
from ..hull import ProjectionTable
from ..search import Model


class Costs(eqx.Module):
    """Costs of correct poses of a subject in one recording, in the units of `volume_objective`.

    Attributes:
        low: The 10 % quantile over the frames.
        typical: The median over the frames.
    """

    low: float
    typical: float


class Prepared(eqx.Module):
    """Data shared by all frames of a recording. See `prepare`.

    Attributes:
        to_z_up: Rotation from the recording's world to one with z up, in which all stages work.
        cameras: The recording's cameras in the world with z up.
        table: None if no frame has a hull.
        edge: Observed voxels at the edge of the observed volume.
        max_misses: Cameras that may see background at an occupied voxel.
        skeleton: Template: the subject's, or the default adult at the estimated stature.
        body: The template with flesh. Not calibrated if the paper's method needs none or too few frames show the
            subject.
        costs: Typical cost of a pose of this subject; None if the body is not calibrated.
        stature_deviation: Standard deviation of the skeleton's stature (m); None where it was given or is a guess.
        clothes: Root mean square thickness of what the subject wears (m), as far as the calibration of its body found
            it.
        worn: Thickness of what is worn around each joint (m), as far as the body shows it.
        model: The body prepared for the search; None without a search.
        scale: Size of the world of all stages over that of the recording: bodies of other templates are made as large
            as a person, for whom the stages' lengths hold.
    """

    to_z_up: Float[np.ndarray, "3 3"]
    cameras: Cameras
    table: ProjectionTable | None
    edge: Bool[np.ndarray, "x y z"]
    max_misses: int
    skeleton: Skeleton
    skeleton_is_known: bool
    body: Body
    costs: Costs | None
    stature_deviation: float | None = None
    clothes: float = 0.0
    worn: Float[np.ndarray, "joints=15"] = eqx.field(default_factory=lambda: np.zeros(len(JOINT_NAMES)))
    model: Model | None = None
    scale: float = 1.0
