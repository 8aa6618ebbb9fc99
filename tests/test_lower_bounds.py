"""The oldest packages that are tested are the oldest ones that pip may choose."""

import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

TESTS = Path(__file__).parent
PROJECT = tomllib.loads((TESTS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
NEEDED = [Requirement(line) for line in PROJECT["dependencies"] + PROJECT["optional-dependencies"]["test"]]


def oldest() -> dict[str, Version]:
    """Versions in the file of constraints, by name."""
    lines = (TESTS / "oldest.txt").read_text(encoding="utf-8").splitlines()
    needs = [Requirement(line) for line in lines if line.strip() and not line.startswith("#")]
    (names, found) = [each.name for each in needs], {}
    assert len(names) == len(set(names))
    for need in needs:
        (exact,) = need.specifier
        assert exact.operator == "==", need
        found[need.name] = Version(exact.version)
    return found


def lower_bound(need: Requirement) -> Version:
    (bound,) = need.specifier  # nothing has an upper bound, and everything has a lower one
    assert bound.operator == ">=", need
    return Version(bound.version)


def test_every_lower_bound_is_tested():
    pinned = oldest()
    assert {need.name: pinned.get(need.name) for need in NEEDED} == {need.name: lower_bound(need) for need in NEEDED}


def test_extras_have_the_bounds_that_are_tested():
    extras = PROJECT["optional-dependencies"]
    tested = {need.name: need.specifier for need in NEEDED}
    for extra in set(extras) - {"test", "dev"}:
        for need in map(Requirement, extras[extra]):
            assert need.specifier == tested.get(need.name, need.specifier), extra
