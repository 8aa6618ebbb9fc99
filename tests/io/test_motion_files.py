import numpy as np
import pytest
from support.motion_texts import AMC, ASF, BVH, is_valid
from support.shared_data import SHARED

from jaxskel.body import JOINT_NAMES
from jaxskel.io.mocap import parse_asf_amc, parse_bvh, read_asf_amc, read_bvh
from jaxskel.synthetic import find_joints

CMU = SHARED / "cmu"
CMU_SCALE = 0.0254 / 0.45
AT = {name: i for i, name in enumerate(JOINT_NAMES)}

# One unit is 0.0254 m / 0.5. Ends of root, spine and arm in units, worked out by hand.
ACCLAIM_ENDS = [
    [[1, 2, 3], [1, 4, 3], [2, 4, 3]],
    # About z: up turns to -x, x turns up.
    [[0, 0, 0], [-2, 0, 0], [-2, 1, 0]],
    # First about x, where up turns to z and x stays, then about y, where z turns to x and x to -z.
    [[0, 0, 0], [2, 0, 0], [2, 0, -1]],
    [[0, 0, 0], [-2, 0, 0], [-2, 1, 0]],
    # The x axis of the arm is the y axis of the world: x turns to -z.
    [[0, 0, 0], [0, 2, 0], [0, 2, -1]],
]

BIOVISION_JOINTS = [
    [[1, 2, 3], [1, 4, 3], [2, 4, 3]],
    # Rz Rx: up turns to z by the inner turn, which the outer one leaves; x turns up by the outer one.
    [[0, 0, 0], [0, 0, 2], [0, 1, 2]],
    # The knee turns what hangs on it: x turns to -z about y.
    [[0, 0, 0], [0, 2, 0], [0, 2, -1]],
]


def test_acclaim_by_hand():
    motion = parse_asf_amc(ASF, AMC, fps=60.0)
    assert motion.names == ("root", "spine", "arm")
    assert motion.parents == (-1, 0, 1)
    assert (motion.fps, motion.up) == (60.0, "+Y")
    np.testing.assert_allclose(motion.positions, np.array(ACCLAIM_ENDS) * 0.0254 / 0.5, atol=1e-12)
    np.testing.assert_allclose(motion.rest, np.array([[0, 0, 0], [0, 2, 0], [1, 2, 0]]) * 0.0254 / 0.5)


def test_acclaim_scale_and_radians():
    metres = parse_asf_amc(ASF, AMC, scale=1.0)
    np.testing.assert_allclose(metres.positions, ACCLAIM_ENDS, atol=1e-12)
    radians = parse_asf_amc(ASF, AMC.replace("DEGREES", "RADIANS").replace("90", f"{np.pi / 2}"), scale=1.0)
    np.testing.assert_allclose(radians.positions, ACCLAIM_ENDS, atol=1e-12)


def test_acclaim_axis_order():
    # In the order YXZ the third frame turns about y first: up stays and x turns to -z; then about x: up turns
    # to z, -z to up.
    motion = parse_asf_amc(ASF.replace("  axis XYZ", "  axis YXZ"), AMC, scale=1.0)
    np.testing.assert_allclose(motion.positions[2], [[0, 0, 0], [0, 0, 2], [0, 1, 2]], atol=1e-12)


def test_biovision_by_hand():
    motion = parse_bvh(BVH)
    assert motion.names == ("hip", "knee", "knee_End")
    assert motion.parents == (-1, 0, 1)
    assert motion.fps == pytest.approx(25.0)
    np.testing.assert_allclose(motion.positions, np.array(BIOVISION_JOINTS) * 0.01, atol=1e-12)
    np.testing.assert_allclose(motion.rest, np.array([[0, 0, 0], [0, 2, 0], [1, 2, 0]]) * 0.01)
    assert parse_bvh(BVH, up="+Z").up == "+Z"


def test_biovision_layout_is_free():
    crowded = BVH.replace("\n{", " {").replace("\n  {", " {").replace("0 0 0 90 90 0 0 0 0", "0 0 0 90\n90 0 0 0 0")
    assert crowded != BVH
    np.testing.assert_allclose(parse_bvh(crowded).positions, parse_bvh(BVH).positions)
    np.testing.assert_allclose(parse_bvh(BVH.replace("\n", "\r\n")).positions, parse_bvh(BVH).positions)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("length 0.5", "length 0", "ASF:5: the unit of length"),
        ("length 0.5", "length half", "ASF:5: 'half' should be a number"),
        ("angle deg", "angle grad", "ASF:6: the unit of angles"),
        ("TX TY TZ RX RY RZ", "TX TX TZ RX RY RZ", "ASF:8: the channels"),
        ("  axis XYZ", "  axis XXZ", "ASF:9: the axis order 'XXZ'"),
        ("name spine", "name", "ASF:13: this bone needs a name"),
        ("direction 0 3 0", "direction 0 0 0", "ASF:16: bone spine has no direction"),
        ("direction 0 3 0", "direction 0 3", "ASF:16: three numbers"),
        ("length 2", "length -2", "ASF:13: this bone needs"),
        ("length 2", "length nan", "ASF:17: 'nan' should be a number"),
        ("dof rz", "dof rz l", "ASF:19: the channels 'rz l'"),
        ("name arm", "name spine", "two bones have the same name"),
        ("    spine arm", "    arm spine", "ASF:35: bone 'arm' has children before it has a parent"),
        ("    spine arm", "    spine spine", "ASF:35: 'spine' is not a bone, or has a parent already"),
        ("    spine arm", "", "the hierarchy does not hold arm"),
    ],
)
def test_broken_asf(old, new, message):
    assert old in ASF
    with pytest.raises(ValueError, match=message):
        parse_asf_amc(ASF.replace(old, new, 1), AMC)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("arm 0 0\n2", "arm 0\n2", r"AMC:7: arm needs 2 values \(rx ry\), not 1"),
        ("arm 0 0\n2", "leg 0 0\n2", "AMC:7: 'leg' is not a moving bone of this skeleton"),
        ("arm 0 0\n2", "2", "AMC:7: frame 1 of the file lacks arm"),
        ("arm 0 0\n2", "spine 0\n2", "AMC:7: spine is given twice"),
        ("arm 90 0\n", "", "frame 5 of the file lacks arm"),
        ("1\nroot", "root", "AMC:4: values before the number"),
        ("root 1 2 3", "root 1 two 3", "AMC:5: 'two' should be a number"),
    ],
)
def test_broken_amc(old, new, message):
    assert old in AMC
    with pytest.raises(ValueError, match=message):
        parse_asf_amc(ASF, AMC.replace(old, new, 1))


def test_empty_amc():
    with pytest.raises(ValueError, match="0 frames"):
        parse_asf_amc(ASF, ":DEGREES\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MOTION", "", "no line MOTION"),
        ("ROOT", "JOINT", "BVH:2: one ROOT is expected"),
        ("JOINT knee", "ROOT knee", "BVH:6: one ROOT is expected"),
        ("JOINT knee", "JOINT hip", "BVH:6: the joint name 'hip' is empty or given twice"),
        ("    OFFSET 0 2 0\n", "", "BVH:6: joint knee has no OFFSET"),
        ("OFFSET 0 2 0", "OFFSET 0 2", "BVH:8: three numbers"),
        ("OFFSET 0 2 0", "OFFSET 0 inf 0", "BVH:8: 'inf' should be a number"),
        ("CHANNELS 3", "CHANNELS 4", "BVH:9: CHANNELS"),
        ("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation", "BVH:9: CHANNELS"),
        ("  }\n}\nMOTION", "}\nMOTION", "braces do not match"),
        ("Frames: 3", "Frames: 999999999", "BVH:17: .* do not agree with the 27 numbers"),
        ("Frames: 3", "Frames: -3", "BVH:17:"),
        ("Frame Time: 0.04", "Frame Time: 0", "BVH:18: a frame time of 0.0 s"),
        ("Frame Time: 0.04\n", "", "'Frame Time:' are expected"),
        ("1 2 3 0", "1 x 3 0", "BVH:19: 'x' should be a number"),
        ("0 0 0 0 0 0 0 0 90\n", "", "do not agree with the 18 numbers"),
    ],
)
def test_broken_bvh(old, new, message):
    assert old in BVH
    with pytest.raises(ValueError, match=message):
        parse_bvh(BVH.replace(old, new, 1))


def test_readers_name_the_file(tmp_path):
    with pytest.raises(ValueError, match=r"none\.bvh: cannot be opened"):
        read_bvh(tmp_path / "none.bvh")
    (tmp_path / "a.asf").write_text(ASF)
    (tmp_path / "a.amc").write_text(AMC.replace("spine 90", "spine"))
    (tmp_path / "a.bvh").write_text(BVH)
    with pytest.raises(ValueError, match=r"a\.amc:18: spine needs 1 values"):
        read_asf_amc(tmp_path / "a.asf", tmp_path / "a.amc")
    (tmp_path / "a.amc").write_text(AMC)
    assert len(read_asf_amc(tmp_path / "a.asf", tmp_path / "a.amc")) == 5
    assert len(read_bvh(tmp_path / "a.bvh")) == 3


def test_too_many_joints_and_positions():
    bones = "".join(f"begin\nname b{i}\ndirection 0 1 0\nlength 1\naxis 0 0 0 XYZ\nend\n" for i in range(1000))
    links = "root " + " ".join(f"b{i}" for i in range(1000))
    with pytest.raises(ValueError, match="1001 joints are more than"):
        parse_asf_amc(f":bonedata\n{bones}:hierarchy\n{links}\n", "1\n")
    bones, links = bones[: bones.index("begin\nname b999")], links.removesuffix(" b999")
    frames = "\n".join(str(i) for i in range(10_001))
    with pytest.raises(ValueError, match="10001 frames of 1000 joints"):
        parse_asf_amc(f":bonedata\n{bones}:hierarchy\n{links}\n", frames)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_scale(scale):
    with pytest.raises(ValueError, match="metres per unit"):
        parse_bvh(BVH, scale)
    with pytest.raises(ValueError, match="metres per unit"):
        parse_asf_amc(ASF, AMC, scale=scale)


# The CMU database

needs_cmu = pytest.mark.skipif(not CMU.is_dir(), reason="the clips of the CMU database are not beside this checkout")


def read_clip(path):
    if path.suffix == ".bvh":
        return read_bvh(path, CMU_SCALE)
    return read_asf_amc(path.with_name(path.name[:2] + ".asf"), path)


@pytest.mark.slow
@needs_cmu
@pytest.mark.parametrize("path", sorted(CMU.glob("*.amc")) + sorted(CMU.glob("*.bvh")), ids=lambda path: path.name)
def test_cmu_clip(path):
    motion = read_clip(path)
    is_valid(motion)
    assert motion.fps == pytest.approx(120.0, rel=1e-3)
    parents = list(motion.parents[1:])
    lengths = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, parents], axis=-1)
    at_rest = np.linalg.norm(motion.rest[1:] - motion.rest[parents], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(at_rest, lengths.shape), atol=1e-9)
    # A person in metres, upright most of the time.
    height = find_joints(motion)[..., 1]
    above_feet = height - height[:, [AT["l_foot"], AT["r_foot"]]].min(1, keepdims=True)
    assert 0.6 < np.median(above_feet[:, AT["pelvis"]]) < 1.1
    assert 1.2 < np.median(above_feet[:, AT["head"]]) < 1.8
