import numpy as np
import pytest
from support.shared_data import SHARED

from jaxskel.body import JOINT_NAMES, JOINT_PARENTS, SEGMENT_NAMES, Pose, default_adult, place_body, place_joints
from jaxskel.io.mocap import Motion, read_asf_amc
from jaxskel.synthetic import demo_motion, detailed_body, find_joints, retarget

CMU = SHARED / "cmu"
AT = {name: i for i, name in enumerate(JOINT_NAMES)}

ACCLAIM_NAMES = {
    "pelvis": "root", "neck": "thorax", "head": "head", "shoulder": "clavicle", "elbow": "humerus",
    "hand": "hand",
    "hip": "hipjoint", "knee": "femur", "foot": "foot",
}  # fmt: skip
MIXAMO_NAMES = {
    "pelvis": "Hips", "neck": "Neck", "head": "Head", "shoulder": "Arm", "elbow": "ForeArm",
    "hand": "Hand", "hip": "UpLeg", "knee": "Leg", "foot": "ToeBase",
}  # fmt: skip
BIOVISION_NAMES = {
    "pelvis": "Hips", "neck": "Neck", "head": "Head", "shoulder": "Shoulder", "elbow": "Elbow",
    "hand": "Wrist", "hip": "Hip", "knee": "Knee", "foot": "Toe",
}  # fmt: skip
TABLES = {
    "acclaim": (ACCLAIM_NAMES, {"l_": "l", "r_": "r"}, ""),
    "mixamo": (MIXAMO_NAMES, {"l_": "Left", "r_": "Right"}, "mixamorig:"),
    "biovision": (BIOVISION_NAMES, {"l_": "Left", "r_": "Right"}, ""),
}


def as_capture(skeleton, pose, table="acclaim", turn=None, up="+Z"):
    """The joints of our own motion as a file would hold them, in a world turned by `turn`."""
    names, sides, prefix = TABLES[table]
    turn = np.eye(3) if turn is None else turn

    def name(joint):
        return prefix + (sides[joint[:2]] + names[joint[2:]] if joint[:2] in sides else names[joint])

    named = tuple(name(joint) for joint in JOINT_NAMES)
    joints = np.asarray(place_joints(skeleton, pose)[0], np.float64)
    return Motion(named, JOINT_PARENTS, joints @ turn.T, np.asarray(skeleton.rest_joints) @ turn.T, 30.0, up)


def angle_between(first, second):
    """Angle of the rotation between two stacks of rotations (degrees)."""
    trace = np.einsum("fij,fij->f", first, second)
    return np.rad2deg(np.arccos(np.clip((trace - 1) / 2, -1, 1)))


@pytest.fixture(scope="module")
def adult():
    return default_adult()


@pytest.fixture(scope="module")
def pose(adult):
    return demo_motion(adult, 60, 5.0)


@pytest.mark.parametrize("table", TABLES)
def test_retarget_undoes_forward_kinematics(adult, pose, table):
    again = retarget(as_capture(adult, pose, table), adult)
    joints, expected = (np.asarray(place_joints(adult, p)[0], np.float64) for p in (again, pose))
    np.testing.assert_allclose(joints - joints[:, :1], expected - expected[:, :1], atol=2e-5)
    np.testing.assert_allclose(again.root[:, :2], pose.root[:, :2], atol=1e-5)
    # Raised as a whole by the height that the feet have over the floor.
    assert np.ptp(again.root[:, 2] - pose.root[:, 2]) < 0.05
    rotations = again.rotations
    np.testing.assert_allclose(
        rotations @ rotations.swapaxes(-1, -2), np.broadcast_to(np.eye(3), rotations.shape), atol=1e-9
    )
    assert (np.linalg.det(rotations) > 0).all()


def test_retarget_turns_limbs_about_themselves(adult, pose):
    again = retarget(as_capture(adult, pose), adult)
    toes, expected = (np.asarray(place_joints(adult, p)[1])[:, 3:] for p in (again, pose))
    joints, joints_expected = (np.asarray(place_joints(adult, p)[0])[:, [11, 14]] for p in (again, pose))
    # Toes point within some degrees of where they should, though no joint of the capture shows it.
    cosine = ((toes - joints) * (expected - joints_expected)).sum(-1)
    cosine /= np.linalg.norm(toes - joints, axis=-1) ** 2
    assert cosine.min() > np.cos(np.deg2rad(15))


def test_retarget_turns_bent_limbs_by_their_hinge(adult, pose):
    again = retarget(as_capture(adult, pose), adult)
    for upper, lower, most in (("upper_arm", "forearm", 1), ("thigh", "shank", 12)):
        for side in ("l_", "r_"):
            first, second = SEGMENT_NAMES.index(side + upper), SEGMENT_NAMES.index(side + lower)
            bent = angle_between(pose.rotations[:, first], pose.rotations[:, second]) > 40
            assert bent.sum() > 3
            for segment in (first, second):
                off = angle_between(pose.rotations[:, segment], again.rotations[:, segment])
                assert off[bent].max() < most


def test_retarget_keeps_the_heading(adult, pose):
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    one = retarget(as_capture(adult, pose), adult)
    other = retarget(as_capture(adult, pose, turn=quarter), adult)
    np.testing.assert_allclose(other.root, one.root @ quarter.T, atol=1e-5)
    np.testing.assert_allclose(other.rotations, quarter @ one.rotations, atol=1e-5)


def test_retarget_is_the_same_with_another_axis_up(adult, pose):
    # x' = y, y' = z, z' = x.
    turn = np.array([[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]])
    one, other = (retarget(as_capture(adult, pose, turn=t, up=up), adult) for t, up in ((None, "+Z"), (turn, "+Y")))
    np.testing.assert_allclose(other.root, one.root, atol=1e-6)
    np.testing.assert_allclose(other.rotations, one.rotations, atol=1e-6)


def test_retarget_to_another_size(adult, pose):
    small = adult.scaled(0.5)
    again = retarget(as_capture(adult, pose), small)
    joints, expected = (np.asarray(place_joints(s, p)[0], np.float64) for s, p in ((small, again), (adult, pose)))
    np.testing.assert_allclose(joints - joints[:, :1], (expected - expected[:, :1]) / 2, atol=2e-5)
    np.testing.assert_allclose(again.root[:, :2], pose.root[:, :2] / 2, atol=1e-5)


def test_missing_joints_are_listed(adult, pose):
    motion = as_capture(adult, pose)
    names = tuple(name.replace("lfemur", "lknee").replace("head", "skull") for name in motion.names)
    with pytest.raises(ValueError, match=r"lacks head \(upperneck or head\), l_knee \(lfemur\); its joints are root"):
        find_joints(Motion(names, motion.parents, motion.positions, motion.rest, 30.0, "+Z"))


def test_coinciding_joints_are_named(adult, pose):
    motion = as_capture(adult, pose)
    positions = motion.positions.copy()
    positions[7, AT["l_knee"]] = positions[7, AT["l_hip"]]
    with pytest.raises(ValueError, match="l_knee and l_hip are at the same place in frame 7 of the motion"):
        retarget(Motion(motion.names, motion.parents, positions, motion.rest, 30.0, "+Z"), adult)


@pytest.mark.skipif(not CMU.is_dir(), reason="the clips of the CMU database are not beside this checkout")
def test_retarget_cmu_clip(adult):
    motion = read_asf_amc(CMU / "13.asf", CMU / "13_17.amc")
    pose = retarget(motion, adult)
    pose = Pose(pose.root[::20], pose.rotations[::20])
    joints = np.asarray(place_joints(adult, pose)[0], np.float64)
    # z up from y up: x' = z, y' = x, z' = y.
    captured = find_joints(motion)[::20][..., [2, 0, 1]]

    def cosine(joint):
        ours, theirs = (x[:, AT[joint]] - x[:, JOINT_PARENTS[AT[joint]]] for x in (joints, captured))
        return (ours * theirs).sum(-1) / np.linalg.norm(ours, axis=-1) / np.linalg.norm(theirs, axis=-1)

    for side in ("l_", "r_"):
        for joint in ("elbow", "hand", "knee", "foot"):
            assert cosine(side + joint).min() > 1 - 1e-8
    # The trunk starts from another pose at rest.
    assert cosine("neck").min() > np.cos(np.deg2rad(5))
    assert cosine("head").min() > np.cos(np.deg2rad(25))
    hips, captured_hips = (x[:, AT["l_hip"]] - x[:, AT["r_hip"]] for x in (joints, captured))
    angle = (hips * captured_hips).sum(-1) / np.linalg.norm(hips, axis=-1) / np.linalg.norm(captured_hips, axis=-1)
    assert angle.min() > np.cos(np.deg2rad(5))
    ends, radii = place_body(detailed_body(adult), pose)
    low = (ends[..., 2] - radii).min((1, 2))
    assert low.min() > -0.05
    assert np.median(low) < 0.1
