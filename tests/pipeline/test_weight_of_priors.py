"""Priors of poses count in single frames, more so in clothes, and not along a track."""

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


@pytest.mark.parametrize("clothes", [0.0, 0.05])
def test_no_posture_costs_anything_along_a_track(clothes):
    assert weight_of_priors(TRACKED, clothes) == 0
    model = with_model(prepared(clothes), TRACKED).model
    assert model is not None
    assert not np.any(model.limbs["l_arm"].costs)
    assert float(model.objective.of_frames["arms"].weight) == 0


def test_unusual_arms_cost_more_in_clothes():
    naked, clothed = (with_model(prepared(clothes), Settings()).model for clothes in (0.0, 0.05))
    assert naked is not None
    assert clothed is not None
    assert naked.limbs["l_arm"].costs.max() > 1
    assert clothed.limbs["l_arm"].costs.max() > 1.3 * naked.limbs["l_arm"].costs.max()


def test_the_papers_method_has_no_search_that_they_count_in():
    assert with_model(prepared(0.0), paper_settings()).model is None
