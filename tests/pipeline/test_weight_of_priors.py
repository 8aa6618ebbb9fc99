"""Priors of poses count in single frames, more so in clothes; along a track, only what clothes add."""

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


def test_no_posture_of_a_naked_person_costs_anything_along_a_track():
    assert weight_of_priors(TRACKED, 0.0) == 0
    model = with_model(prepared(0.0), TRACKED).model
    assert model is not None
    assert not np.any(model.limbs["l_arm"].costs)
    assert float(model.objective.of_frames["arms"].weight) == 0


@pytest.mark.parametrize("clothes", [0.01, 0.05])
def test_only_what_clothes_add_costs_anything_along_a_track(clothes):
    alone, tracked = (weight_of_priors(settings, clothes) for settings in (Settings(), TRACKED))
    assert 0 < tracked == pytest.approx(alone - weight_of_priors(Settings(), 0.0))
    models = [with_model(prepared(clothes), settings).model for settings in (Settings(), TRACKED)]
    weights = [float(model.objective.of_frames["arms"].weight) for model in models if model is not None]
    assert weights[1] == pytest.approx(weights[0] * tracked / alone)


def test_unusual_arms_cost_more_in_clothes():
    naked, clothed = (with_model(prepared(clothes), Settings()).model for clothes in (0.0, 0.05))
    assert naked is not None
    assert clothed is not None
    assert naked.limbs["l_arm"].costs.max() > 1
    assert clothed.limbs["l_arm"].costs.max() > 1.3 * naked.limbs["l_arm"].costs.max()


def test_the_papers_method_has_no_search_that_they_count_in():
    assert with_model(prepared(0.0), paper_settings()).model is None
