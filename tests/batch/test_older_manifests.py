"""Recordings finished by an earlier version are not computed again only because code has moved."""

import ast
import json

import numpy as np
import pytest

from jaxskel import GraphSettings, HullSettings, RefinementSettings, Settings, paper_settings
from jaxskel._runtime.code_digest import digest_of_sources
from jaxskel.batch import Method
from jaxskel.batch import _older_manifests as older
from jaxskel.graph import VoxelScooping
from jaxskel.refinement.terms import volume_objective
from jaxskel.search import Search, Tracking

# The method as written by a version with flat settings and other modules.
FLAT = {
    "class": "jaxskel._settings.Settings", "spacing": 0.02, "box": None, "min_views": None, "max_misses": None,
    "root": {
        "class": "jaxskel._head.HeadBall", "depths": [0.05, 0.055, 0.06], "least_core": 2e-05, "most_core": 0.0006,
        "overtopped": 0.16,
    },
    "min_branch": 0.24, "matcher": {"class": "jaxskel._match.DtwMatcher"}, "descriptor": [0, 3, 4],
    "search": {
        "class": "jaxskel._solve.Search", "rough_steps": 4, "starts": 4, "leg_steps": 10, "trunks": 2,
        "trunk_margin": 20.0, "margin": 10.0, "pairs": 4, "singles": 4, "steps": 8, "again": 2, "doubtful": 45.0,
    },
    "tracking": {"class": "jaxskel._track.Tracking", "interval": 0.25, "steps": 6, "margin": 2.0}, "body": None,
    "objective": "jaxskel.terms.volume_objective",
    "parametrisation": {"class": "jaxskel.parametrisations._hinged_limbs.HingedLimbs"},
    "solver": {
        "class": "jaxskel._levenberg_marquardt.LevenbergMarquardt", "rtol": 0.01, "atol": 0.003, "ftol": 0.0,
        "norm": "optimistix._misc.max_norm", "equations": "jaxskel._levenberg_marquardt.NormalEquations",
        "search": {
            "class": "optimistix._solver.trust_region.ClassicalTrustRegion", "high_cutoff": 0.99, "low_cutoff": 0.01,
            "high_constant": 3.5, "low_constant": 0.25,
        },
    },
    "rounds": 2, "max_steps": 16,
}  # fmt: skip


def test_flat_settings_are_those_of_today():
    # That version scooped voxels, looked correspondences up twice, a turn had no margin of its own, its search no prior
    # of arms, no rival that faces the other way, and went on in all frames.
    tracking, refinement = Tracking(turn_margin=2.0), RefinementSettings(rounds=2)
    search = Search(objective=volume_objective, vague=np.inf, enough=0.0)
    graph = GraphSettings(skeletoniser=VoxelScooping(), min_branch=0.24)
    settings = Settings(HullSettings(spacing=0.02), graph, search=search, tracking=tracking, refinement=refinement)
    today = Method(settings).described
    assert older.modern_method({"settings": FLAT, "smooth_hz": None}) == today
    assert older.modern_method({"settings": FLAT | {"spacing": 0.015}, "smooth_hz": None}) != today


@pytest.mark.parametrize("settings", [Settings(), paper_settings()])
def test_what_this_version_writes_stays_as_it_is(settings):
    written = json.loads(json.dumps(Method(settings).described))
    assert older.modern_method(written) == written
    assert "jaxskel." not in json.dumps(written)


def test_a_version_is_this_one_only_as_long_as_no_definition_changes(monkeypatch, tmp_path):
    (tmp_path / "equal_versions.txt").write_text("# compared\n0.1.dev0+aaaa 0.1.dev0 0123456789ab\n")
    monkeypatch.setattr(older, "files", lambda _: tmp_path)
    for digest, expected in (("0123456789abcdef", "0.1.dev0+0123456789ab"), ("another", "0.1.dev0+aaaa")):
        monkeypatch.setattr(older, "digest_of_definitions", lambda digest=digest: digest)
        older.modern_version.cache_clear()
        assert older.modern_version("0.1.dev0+aaaa") == expected
        assert older.modern_version("0.1.dev0+bbbb") == "0.1.dev0+bbbb"
    older.modern_version.cache_clear()


ONE = b'"""A file."""\nimport os\n\ndef one(a):\n    """One."""\n    import sys\n    return a + 1  # more\n'
TWO = b"class Two:\n    x: int = 1\n    '''A field.'''\n"


def test_the_digest_is_of_definitions_wherever_they_stand():
    before = digest_of_sources([ONE, TWO])
    assert digest_of_sources([TWO + b"\n# moved\n" + ONE.replace(b"One.", b"The first.")]) == before
    for changed in (ONE.replace(b"+ 1", b"+ 2"), ONE.replace(b"def one", b"def first"), ONE + b"X = 1\n"):
        ast.parse(changed)
        assert digest_of_sources([changed, TWO]) != before
