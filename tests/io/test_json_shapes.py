"""JSON with values of wrong types: the result is a valid rig, or a refusal of one line."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.outcomes import outcome
from support.readers import READERS

IN_JSON = (
    "panoptic", "voxelpose", "multical", "calib.io", "open3d", "open3d trajectory", "anipose in JSON", "aist",
    "nerfstudio", "by hand", "xrprimer", "mvhumannet", "projections in JSON",
)  # fmt: skip
ODD = [None, True, False, 0, -1, 1e308, 10**30, 10**400, float("nan"), float("-inf"), "", "x", "null", [], {}, [[]],
       [None], [True] * 9, ["1"] * 9, {"data": []}, {"data": {"data": 1}}, {"R": [], "t": {}}, [0] * 3, [0] * 4,
       [0.0] * 9, [0] * 12, [0] * 16, [[1, 0, 0], [0, 1, 0], [0, 0, 1]]]  # fmt: skip


def places(value: Any, so_far: tuple = ()) -> list[tuple]:
    """The paths of all values in a tree of lists and objects."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [so_far, *(place for key, each in inner for place in places(each, (*so_far, key)))]


@st.composite
def changed(draw: st.DrawFn, table: Any) -> Any:
    """A tree in which some values are odd, lost, doubled, or copied from other places."""
    table = copy.deepcopy(table)
    for _ in range(draw(st.integers(1, 3))):
        all_places = places(table)
        # Values near the root are as likely to be chosen as one of the many numbers.
        depth = draw(st.integers(0, max(len(place) for place in all_places)))
        place = draw(st.sampled_from([place for place in all_places if len(place) == depth]))
        other = draw(st.sampled_from(all_places))
        new = copy.deepcopy(draw(st.sampled_from([*ODD, _at(table, other)])))
        if not place:
            table = new
            continue
        parent, key = _at(table, place[:-1]), place[-1]
        if draw(st.integers(0, 3)) == 0:
            del parent[key]
        else:
            parent[key] = new
    return table


def _at(table: Any, place: tuple) -> Any:
    for key in place:
        table = table[key]
    return table


@pytest.mark.parametrize("reader", IN_JSON)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_values_of_other_kinds(reader: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("shapes")
    path = READERS[reader].write(folder)
    file = data.draw(st.sampled_from(sorted(folder.iterdir())))
    table = data.draw(changed(json.loads(Path(file).read_text())))
    file.write_text(json.dumps(table))
    outcome(path, reader, folder)
