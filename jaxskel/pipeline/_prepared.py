"""What holds for all frames of a recording."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from ..body import Body, Skeleton
from ..cameras import Cameras
from ..hull import ProjectionTable
from ..search import Model
from ._subject import Costs


class Prepared(eqx.Module):
    """What holds for all frames of a recording. See `prepare`."""

    to_z_up: Float[np.ndarray, "3 3"]
    """Rotation from the recording's world to the one worked in."""
    cameras: Cameras
    """The recording's, in that world."""
    table: ProjectionTable | None
    """None where no frame has a hull."""
    edge: Bool[np.ndarray, "x y z"]
    """Observed voxels at the edge of what is observed."""
    max_misses: int
    """Cameras that may see background at an occupied voxel."""
    skeleton: Skeleton
    """Template: the subject's, or the default adult at the estimated stature."""
    skeleton_is_known: bool
    body: Body
    """The template with flesh: calibrated, unless the paper's method needs none or too few frames show the subject."""
    costs: Costs | None
    """What poses of this subject cost; None where the body is not calibrated."""
    model: Model | None = None
    """The body, ready for the search; None where nothing is searched for."""
