"""Template files: what they mean, by hand, and what is refused."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from jaxskel.body import ACROSS, FREE, HINGE, HUMAN_15, POINT_NAMES, default_adult
from jaxskel.io import read_template
from jaxskel.io.templates import BUILT_IN, built_in
from jaxskel.matching import template_ends

# A trunk with a head, a leg, and an arm that bends; the wrist lies in the same rigid part as the hand's tip.
SMALL = """
name = "small"
described_by = ["top", "toe"]

[joints]
trunk = { at = [0, 0, 1.0], inner = true }
shoulder = { parent = "trunk", at = [0, 0.25, 1.0], segment = "trunk", along = false }
elbow = { parent = "shoulder", at = [0, 0.5, 1.0], bends = "front", range = [0, 90], swing = 45 }
wrist = { parent = "elbow", at = [0, 0.75, 1.0], segment = "forearm", firmness = 0.5, along = [0.5, 1] }

[tips]
top = { parent = "trunk", at = [0, 0, 1.5], twist = false }
finger = { parent = "wrist", at = [0, 0.875, 1.0], segment = "forearm" }
toe = { parent = "trunk", at = [0, 0, 0] }
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "small.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_small_template_by_hand(tmp_path):
    skeleton = read_template(written(tmp_path, SMALL))
    template = skeleton.template
    assert template.name == "small"
    assert template.joint_names == ("trunk", "shoulder", "elbow", "wrist")
    assert template.joint_parents == (-1, 0, 1, 2)
    assert template.tip_names == ("top", "finger", "toe")
    assert template.segment_names == ("trunk", "elbow", "forearm", "top", "toe")
    assert template.segment_parents == (-1, 0, 1, 0, 0)
    assert template.segment_of_joint == (0, 0, 1, 2)
    assert template.segment_of_tip == (3, 2, 4)
    assert template.freedoms == (FREE, FREE, HINGE, ACROSS, FREE)
    assert template.inner == (0,)
    assert template.described_by == (0, 2)
    # The arm is on the path to the finger; the shoulder lies beside the centre-line.
    assert [(bone.joint, bone.tip, bone.first, bone.last) for bone in template.attracted] == [
        (2, 1, 0.2, 1.0), (3, 1, 0.5, 1.0)
    ]  # fmt: skip
    (hinge,) = template.hinges
    assert (hinge.joint, hinge.segment, hinge.end, hinge.bends_to) == (2, 2, 3, (1.0, 0.0, 0.0))
    np.testing.assert_allclose((hinge.straight, hinge.folded), (0, np.pi / 2))
    np.testing.assert_allclose(template.swings[1], np.pi / 4)
    assert template.firmness[1] == 0.5
    assert not template.is_human
    # The root is at the origin: from the top down to the trunk, then along the arm or the leg.
    np.testing.assert_allclose(template_ends(skeleton)[0], [0, 0.5 + 0.875, 1.5], atol=1e-6)
    np.testing.assert_allclose(template_ends(skeleton)[1, 2], 0.875 + 1.0, atol=1e-6)
    assert skeleton.size == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"small"', '"human-15"', "key 'name': is 'human-15'; give a name of your own"),
        ('parent = "elbow"', 'parent = "knee"', "key 'joints.wrist.parent': is 'knee'; give one of the joints"),
        ('parent = "shoulder"', 'parent = "wrist"', "'wrist' comes later; write parents before children"),
        ("toe = {", "trunk = {", "key 'tips.trunk': is a joint, too; give the tip a name of its own"),
        ("toe = {", '"my toe" = {', "key 'tips.my toe': is no name; give letters, digits, _ and -, a letter first"),
        ("at = [0, 0, 0]", "at = [0, 0]", "key 'tips.toe.at': is [0, 0]; give 3 numbers in brackets"),
        ("at = [0, 0, 0]", "at = [0, 0, nan]", "key 'tips.toe.at': is nan; give a number"),
        (", at = [0, 0, 0]", "", "key 'tips.toe.at': is missing; give its place at rest in metres: [x, y, z]"),
        (", inner = true", "", "key 'joints': have no inner one; write inner = true at those where limbs meet"),
        ("inner = true", "inner = 1", "key 'joints.trunk.inner': is 1; give true or false"),
        (
            '"front"',
            '"forward"',
            "key 'joints.elbow.bends': is 'forward'; give one of front, back, left",
        ),
        (", range = [0, 90]", ", rang = [0, 90]", "key 'joints.elbow.rang': is not known; did you mean range?"),
        ("[0, 90]", "[0, 900]", "key 'joints.elbow.range': is 900; give a number from -180 to 180"),
        ('bends = "front", ', "", "key 'joints.elbow.range': needs bends"),
        ("inner = true }", 'inner = true, bends = "up" }', "joints.trunk.bends': is for a joint inside a limb"),
        ('"forearm" }', '"trunk" }', "'trunk' turns about trunk, but finger hangs on wrist; give another segment"),
        ('["top", "toe"]', '["top", "heel"]', "key 'described_by': is ['top', 'heel']; give some of the tips"),
        ("at = [0, 0.5, 1.0]", "at = [0, 0.25, 1.0]", "the bone that ends in elbow is shorter than a thousandth"),
        ("[tips]", "[tops]", "key 'tops': is not known; did you mean tips?"),
        ("name =", 'graph_begins = "left"\nname =', "key 'graph_begins': is 'left'; give up or down"),
        ("at = [0, 0, 0]", "is = { pelvis = 0.5 }", "key 'tips.toe.is': sums up to 0.5; let the shares sum up to one"),
        ("at = [0, 0, 0]", "is = { belly = 1 }", "key 'tips.toe.is.belly': is not known; did you mean"),
    ],
)
def test_faults_in_one_line(tmp_path, old, new, told):
    assert old in SMALL
    with pytest.raises(ValueError, match="small.toml") as error:
        read_template(written(tmp_path, SMALL.replace(old, new, 1)))
    assert told in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_templates(name):
    skeleton = built_in(name)
    template = skeleton.template
    assert template.name == name
    assert template.swings
    # Left and right are mirror images.
    mirrored = np.asarray(skeleton.rest_joints)[template.mirror_joints] * [1, -1, 1]
    pairs = template.mirror_joints != np.arange(len(mirrored))
    np.testing.assert_allclose(mirrored[pairs], np.asarray(skeleton.rest_joints)[pairs], atol=1e-9)
    assert pairs.any() == (name != "hand")


def test_points_of_the_human_need_no_places():
    skeleton, adult = built_in("human-21"), default_adult()
    assert skeleton.template.is_human
    names = skeleton.template.point_names
    points = np.concatenate([skeleton.rest_joints, skeleton.rest_tips])
    human = np.concatenate([adult.rest_joints, adult.rest_tips, adult.pivots])
    for name in ("l_wrist", "head", "r_ankle", "l_toetip"):
        np.testing.assert_allclose(points[names.index(name)], human[POINT_NAMES.index(name)], atol=1e-9)
    spine = 0.65 * human[POINT_NAMES.index("pelvis")] + 0.35 * human[POINT_NAMES.index("neck")]
    np.testing.assert_allclose(points[names.index("spine")], spine, atol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("joint_parents", (-1, *range(14))[::-1]), ("tip_parents", (2, 5, 8, 11, 15)), ("inner", (0, 99)),
        ("segment_of_joint", (0,) * 14), ("firmness", (1.0,)), ("radii", (0.1,)), ("segment_parents", (0,) * 17),
    ],
)  # fmt: skip
def test_templates_that_are_no_tree(field, value):
    with pytest.raises(ValueError, match=f"^{field}: "):
        dataclasses.replace(HUMAN_15, **{field: value})
