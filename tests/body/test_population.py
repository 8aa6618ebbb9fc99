"""How adults differ: the table, and the bodies that it was made from."""

import numpy as np
import population as making
import pytest
from makehuman import BONES, MakeHuman, Phenotype, SkinnedBody, write_body

from jaxskel.body import LENGTH_NAMES, QUANTITIES, adults


@pytest.fixture(scope="module")
def maker() -> MakeHuman:
    try:
        return MakeHuman()
    except FileNotFoundError as error:
        pytest.skip(str(error))


def mixed(maker: MakeHuman, **shares: float) -> SkinnedBody:
    average = dict.fromkeys(("muscle", "weight", "height", "proportions"), 0.5)
    people = dict.fromkeys(("african", "asian", "caucasian"), 1 / 3)
    return maker.body(Phenotype(**{"male": 0.5, "age": 25.0} | average | people | shares))


def test_the_table_knows_all_but_the_hands():
    known = adults()
    assert set(known.names) < set(QUANTITIES)
    left_out = [name for name in QUANTITIES if name not in known.names]
    assert all(name.startswith(making.LEFT_OUT) or name in ("nape out", "face out", "crown out") for name in left_out)
    assert np.isfinite(known.means).all()
    assert (known.rest >= 0).all()
    # A length differs by a few per cent, in all.
    for name in LENGTH_NAMES[:8]:
        row = known.names.index(name)
        assert 0.005 < np.hypot(known.rest[row], np.linalg.norm(known.axes[row])) < 0.12


def test_a_table_keeps_means_and_deviations():
    rng = np.random.default_rng(0)
    common, count = rng.normal(size=(len(QUANTITIES), making.AXES)), len(QUANTITIES)
    vectors = rng.normal(size=(400, making.AXES)) @ common.T + 0.1 * rng.normal(size=(400, count)) + np.arange(count)
    vectors[:, QUANTITIES.index("nape out")] = 0  # does not vary
    lines = [line.split(",") for line in making.table(vectors).splitlines()]
    rows = [QUANTITIES.index(line[0]) for line in lines[1:]]
    assert QUANTITIES.index("nape out") not in rows
    numbers = np.array([[float(cell) for cell in line[1:]] for line in lines[1:]])
    np.testing.assert_allclose(numbers[:, 0], vectors[:, rows].mean(0), atol=1e-4)
    variances = numbers[:, 1] ** 2 + (numbers[:, 2:] ** 2).sum(1)
    np.testing.assert_allclose(variances, vectors[:, rows].var(0, ddof=1), rtol=1e-3)
    # What deviates together is in the axes.
    covariance = numbers[:, 2:] @ numbers[:, 2:].T
    expected = np.cov(vectors[:, rows].T)
    assert np.abs(covariance - expected).max() < 0.02 * expected.max()


def test_a_body_stands_on_the_floor_and_is_even(maker):
    body = mixed(maker)
    assert body.skin[:, 1].min() == pytest.approx(0)
    assert 1.5 < body.stature < 1.95
    assert 15 < body.mass_index(maker.faces) < 35
    low, high = body.skin.min(0), body.skin.max(0)
    for name, (point, carrier) in body.landmarks.items():
        assert ((point >= low - 1e-6) & (point <= high + 1e-6)).all(), name
        if name.startswith("l_"):
            other, other_carrier = body.landmarks["r_" + name[2:]]
            np.testing.assert_allclose(other * [-1, 1, 1], point, atol=2e-3)
            assert carrier[:-1] == other_carrier[:-1]


def test_men_have_broader_shoulders_and_weight_makes_fat(maker):
    man, woman = mixed(maker, male=1.0), mixed(maker, male=0.0)

    def breadth(body: SkinnedBody) -> float:
        return (body.landmarks["l_shoulder"][0] - body.landmarks["r_shoulder"][0])[0] / body.stature

    assert man.stature > woman.stature
    assert breadth(man) > 1.03 * breadth(woman)
    masses = [mixed(maker, weight=weight).mass_index(maker.faces) for weight in (0.2, 0.5, 0.8)]
    assert masses == sorted(masses)


def test_shares_of_two_bodies_mix_them(maker):
    # Halfway between two targets that are next to each other is the mean of the two bodies.
    one, other, middle = (mixed(maker, height=height) for height in (0.5, 1.0, 0.75))
    pelvis = [body.skin - body.landmarks["pelvis"][0] for body in (one, other, middle)]
    still = maker.weights["head"] > 0.99  # fingers turn as they close
    np.testing.assert_allclose(pelvis[2][still], (pelvis[0][still] + pelvis[1][still]) / 2, atol=1e-6)


def test_every_vertex_goes_with_some_bone(maker, tmp_path):
    path = tmp_path / "body.npz"
    body = mixed(maker)
    write_body(path, maker, body, Phenotype(0.5, 0.0, 0.5, 0.5, 0.5, 0.5, 1 / 3, 1 / 3, 1 / 3))
    written = np.load(path)
    np.testing.assert_allclose(written["w_val"].sum(1), 1, atol=1e-5)
    assert written["w_idx"].max() < len(BONES) == len(written["rest"])
    parents = written["parents"]
    assert parents[0] == -1
    assert (parents[1:] >= 0).all()
    # The skin of a bone lies around it: the left foot's far from the right one's.
    own = written["joints"][written["w_idx"][:, 0]]
    assert (written["verts"][own == "foot.L", 0] > 0).all()
    assert (written["verts"][own == "foot.R", 0] < 0).all()
    # Hands are half closed: fingers end nearer to the wrist than flat ones would.
    names = list(written["lm_names"])
    wrist, tip = (written["lm_pos"][names.index(name)] for name in ("l_wrist", "l_fingertip"))
    knuckle = written["lm_pos"][names.index("l_index_mcp")]
    assert np.linalg.norm(tip - wrist) < 1.7 * np.linalg.norm(knuckle - wrist)
