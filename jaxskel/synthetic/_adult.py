"""Random adults: bodies with plausible bone lengths and flesh."""

import numpy as np

from ..body import FLESH_FROM, QUANTITIES, Body, Shape, adults, default_adult, measured_body, population_prior


def draw_adult(seed: int, stature: float = 1.72) -> Body:
    """Draw a random adult body, with the hands half closed (see [`adults`][jaxskel.body.adults]).

    Args:
        seed: Seed of the random numbers.
        stature: Standing height (m).

    Returns:
        The body (m); its ``skeleton`` has the dimensions.
    """
    template, table, rng = default_adult(), adults(), np.random.default_rng(seed)
    vector = population_prior(table, template).mean.vector
    drawn = table.axes @ rng.normal(size=table.axes.shape[1]) + table.rest * rng.normal(size=len(table.rest))
    known = np.array([QUANTITIES.index(name) for name in table.names])
    vector[known] += np.where(known < FLESH_FROM, 1.0, template.height) * drawn
    body = measured_body(template, Shape.of(vector))
    size = stature / body.skeleton.stature
    return Body(body.skeleton.scaled(size), body.segments, size * body.offsets, size * body.radii, body.links)
