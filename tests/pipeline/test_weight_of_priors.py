"""Priors of poses count in single frames, more so in clothes, and less along a track."""

import numpy as np
import pytest
from support.phantoms import ring

from jaxskel import Settings, Tracking, make_body, paper_settings
from jaxskel.body import default_adult
from jaxskel.pipeline._prepare import with_model
from jaxskel.pipeline._prepared import Prepared
from jaxskel.pipeline._settings import weight_of_priors

TRACKED = Settings(tracking=Tracking())


def prepared(clothes: float) -> Prepared:
    skeleton = default_adult()
    none = np.zeros((0, 0, 0), bool)
    body = make_body(skeleton)
    return Prepared(np.eye(3), ring(4), None, none, 0, skeleton, False, body, None, clothes=clothes)


@pytest.mark.parametrize("clothes", [0.0, 0.01, 0.05])
def test_priors_count_less_along_a_track_but_for_what_clothes_add(clothes):
    alone, tracked = (weight_of_priors(settings, clothes) for settings in (Settings(), TRACKED))
    naked = [weight_of_priors(settings, 0.0) for settings in (Settings(), TRACKED)]
    assert 0 < naked[1] < naked[0]
    assert tracked - naked[1] == pytest.approx(alone - naked[0])
    models = [with_model(prepared(clothes), settings).model for settings in (Settings(), TRACKED)]
    weights = [float(model.objective.of_frames["arms"].weight) for model in models if model is not None]
    assert weights[1] == pytest.approx(weights[0] * tracked / alone)
    tables = [model.limbs["l_arm"].costs.max() for model in models if model is not None]
    assert 0 < tables[1] < tables[0]


def test_unusual_arms_cost_more_in_clothes():
    naked, clothed = (with_model(prepared(clothes), Settings()).model for clothes in (0.0, 0.05))
    assert naked is not None
    assert clothed is not None
    assert naked.limbs["l_arm"].costs.max() > 1
    assert clothed.limbs["l_arm"].costs.max() > 1.3 * naked.limbs["l_arm"].costs.max()


def test_the_papers_method_has_no_search_that_they_count_in():
    assert with_model(prepared(0.0), paper_settings()).model is None
