"""People made up: bone lengths and flesh as adults have them."""

import numpy as np

from .._adults import adults
from .._body import Body
from .._dimensions import FLESH_FROM, QUANTITIES, Shape, adults_prior, shaped_body
from .._skeleton import default_adult, make_skeleton


def draw_adult(seed: int, stature: float = 1.72) -> Body:
    """Draw an adult at random, as adults differ (see [`adults`][jaxskel._adults.adults]), the hands half closed.

    Args:
        seed: Who it is.
        stature: Standing height (m).

    Returns:
        The body; its ``skeleton`` has the dimensions.
    """
    template, table, rng = default_adult(), adults(), np.random.default_rng(seed)
    vector = adults_prior(template).mean.vector
    drawn = table.axes @ rng.normal(size=table.axes.shape[1]) + table.rest * rng.normal(size=len(table.rest))
    known = np.array([QUANTITIES.index(name) for name in table.names])
    vector[known] += np.where(known < FLESH_FROM, 1.0, template.height) * drawn
    body = shaped_body(template, Shape.of(vector))
    joints, tips, offsets, radii = (
        np.asarray(a, np.float64)
        for a in (body.skeleton.rest_joints, body.skeleton.rest_tips, body.offsets, body.radii)
    )
    size = stature / make_skeleton(joints, tips).stature
    skeleton = make_skeleton(size * joints, size * tips)
    return Body(skeleton, body.segments, size * offsets, size * radii, body.links)
