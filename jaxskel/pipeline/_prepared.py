"""Data shared by all frames of a recording."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from ..body import Body, Skeleton
from ..cameras import Cameras
from ..hull import ProjectionTable
from ..search import Model


class Costs(eqx.Module):
    """Costs of correct poses of a subject in one recording, in the units of `volume_objective`."""

    low: float
    """The 10 % quantile over the frames."""
    typical: float
    """The median over the frames."""


class Prepared(eqx.Module):
    """Data shared by all frames of a recording. See `prepare`."""

    to_z_up: Float[np.ndarray, "3 3"]
    """Rotation from the recording's world to one with z up, in which all stages work."""
    cameras: Cameras
    """The recording's cameras in the world with z up."""
    table: ProjectionTable | None
    """None if no frame has a hull."""
    edge: Bool[np.ndarray, "x y z"]
    """Observed voxels at the edge of the observed volume."""
    max_misses: int
    """Cameras that may see background at an occupied voxel."""
    skeleton: Skeleton
    """Template: the subject's, or the default adult at the estimated stature."""
    skeleton_is_known: bool
    body: Body
    """The template with flesh. Not calibrated if the paper's method needs none or too few frames show the subject."""
    costs: Costs | None
    """Typical cost of a pose of this subject; None if the body is not calibrated."""
    stature_deviation: float | None = None
    """Standard deviation of the skeleton's stature (m); None where it was given or is a guess."""
    clothes: float = 0.0
    """Root mean square thickness of what the subject wears (m), as far as the calibration of its body found it."""
    model: Model | None = None
    """The body prepared for the search; None without a search."""
