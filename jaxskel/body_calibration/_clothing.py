"""Clothes: how much thicker than flesh each part of a subject is, estimated together with the body.

A prior of naked people says what flesh a body of some size has. In a coat the same prior would make the whole body
larger. So each radius, and how far each ball lies to the front, may have a share that is clothes, with a standard
deviation of its own, which the silhouettes decide (automatic relevance determination, MacKay 1992).
"""

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from ..body import BAG_BALLS, HAIR_BALLS, QUANTITIES, Prior, Shape

# Hands and feet are seen as they are, or in shoes, which the table's deviations allow for: trousers end at the hem. If
# ankles and heels grew to the width of trousers, legs would become too short. Bags are no flesh.
_BARE = ("palm", "finger", "ankle", "heel", "ball", "toe", *BAG_BALLS, *HAIR_BALLS)
# What is worn may be in front of these or, like a bag, behind them. Around limbs it is equally thick, so that their
# flesh still tells front and back apart.
_ASIDE = ("seat", "waist", "chest", "girdle", "nape", "face", "crown")
# Standard deviation before anything is known (m), of radii and of shifts to the front, and where nothing is worn. That
# of shifts is never larger: heads were placed 13 cm in front of their necks (Pose2Sim's recording), and 17 cm behind
# under a hood (three cameras).
_THICKER, _SHIFTED, _NOTHING = 0.05, 0.01, 1e-4
FLESH_DEVIATIONS = 2.0
"""Flesh that deviates by fewer standard deviations than this is no sign of clothes."""


def _worn() -> Int[np.ndarray, " worn"]:
    parts = [quantity.split() for quantity in QUANTITIES]
    thicker = [part[-1] == "radius" and part[0] not in _BARE for part in parts]
    shifted = [part[-1] == "front" and part[0] in _ASIDE for part in parts]
    return np.flatnonzero(np.logical_or(thicker, shifted)).astype(np.int32)


_WORN = _worn()
_GROWS = np.array([QUANTITIES[i].endswith("radius") for i in _WORN])
# For each shift, the radius of the same ball.
_RADIUS_OF = np.array([list(_WORN).index(QUANTITIES.index(QUANTITIES[i].split()[0] + " radius")) for i in _WORN])
_BEFORE = np.where(_GROWS, _THICKER, _SHIFTED)


def dressed(shape: Shape, thickness: float) -> Shape:
    """The same body in clothes of one thickness (m) everywhere but on hands and toes."""
    vector = shape.vector.copy()
    vector[_WORN[_GROWS]] += thickness
    return Shape.of(vector)


class Clothing(eqx.Module):
    """Standard deviation of what clothes add to each quantity of `QUANTITIES` that they can change (m)."""

    deviations: Float[np.ndarray, " worn"] = eqx.field(default_factory=_BEFORE.copy)

    @property
    def thickness(self) -> float:
        """Root mean square of what clothes add to the radii (m)."""
        return float(np.sqrt((self.deviations[_GROWS] ** 2).mean()))

    def precision(self, prior: Prior) -> Float[np.ndarray, "unknowns unknowns"]:
        """Inverse covariance of flesh and clothes together (Woodbury: the prior's own may be singular)."""
        rows = prior.precision[_WORN]
        inner = np.diag(self.deviations**-2.0) + rows[:, _WORN]
        return prior.precision - rows.T @ np.linalg.solve(inner, rows)

    def given(self, prior: Prior, vector: Float[np.ndarray, " unknowns"]) -> "Clothing":
        """Half-way to the deviations that make the body likeliest. Clothes do not make a part thinner."""
        precision = self.precision(prior)
        inverse = 1 / np.diagonal(precision)[_WORN]
        off = (precision @ (vector - prior.mean.vector))[_WORN] * inverse
        flesh = np.maximum(inverse - self.deviations**2, 0.0)
        explained = np.maximum(off**2 - FLESH_DEVIATIONS**2 * flesh, _NOTHING**2)
        halfway = np.sqrt((self.deviations**2 + np.where(_GROWS & (off < 0), _NOTHING**2, explained)) / 2)
        # What is worn only in front of a part, or only behind it, makes it thicker, too.
        return Clothing(np.where(_GROWS, halfway, np.minimum(np.minimum(halfway, _SHIFTED), halfway[_RADIUS_OF])))
