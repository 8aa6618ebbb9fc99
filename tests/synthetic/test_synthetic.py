import numpy as np
import pytest

from jaxskel.body import (
    JOINT_NAMES,
    JOINT_PARENTS,
    MIRROR_JOINTS,
    SEGMENT_NAMES,
    Pose,
    default_adult,
    make_skeleton,
    place_body,
    place_joints,
)
from jaxskel.cameras import make_cameras, project
from jaxskel.recording import unpack_silhouettes
from jaxskel.synthetic import camera_ring, demo_motion, detailed_body, look_at, make_scene, make_view, render_view

AT = {name: i for i, name in enumerate(JOINT_NAMES)}
SEGMENT = {name: i for i, name in enumerate(SEGMENT_NAMES)}


def in_capsules(points, ends, radii):
    """Whether points lie in the union of tapered capsules, by the balls along a fine division of each."""
    inside = np.zeros(len(points), bool)
    for (start, end), (first, last) in zip(ends, radii, strict=True):
        for s in np.linspace(0, 1, 25):
            inside |= ((points - start - s * (end - start)) ** 2).sum(-1) < (first + s * (last - first)) ** 2
    return inside


def single_pose(motion, frame):
    return Pose(motion.root[frame : frame + 1], motion.rotations[frame : frame + 1])


@pytest.fixture(scope="module")
def adult():
    return default_adult(1.75)


@pytest.fixture(scope="module")
def motion(adult):
    return demo_motion(adult, 120, 10.0)


@pytest.fixture(scope="module")
def scene(adult):
    return make_scene(frames=12, fps=1.0, skeleton=adult, cameras=camera_ring(4, size=(320, 240)))


# Body


def test_body_has_the_volume_of_an_adult(adult):
    ends, radii = place_body(detailed_body(adult), single_pose(demo_motion(adult, 1), 0))
    low, high = (ends[0].reshape(-1, 3).min(0) - 0.15), (ends[0].reshape(-1, 3).max(0) + 0.15)
    points = np.random.default_rng(0).uniform(low, high, (20_000, 3))
    litres = 1000 * in_capsules(points, ends[0], radii).mean() * np.prod(high - low)
    assert 62 < litres < 76


@pytest.mark.parametrize("factor", [0.6, 1.2])
def test_body_scales_with_the_skeleton(adult, factor):
    body, scaled = detailed_body(adult), detailed_body(adult.scaled(factor))
    np.testing.assert_allclose(scaled.radii, factor * body.radii)
    np.testing.assert_allclose(scaled.offsets, factor * body.offsets, atol=1e-12)


def test_body_is_symmetric(adult):
    ends, radii = place_body(detailed_body(adult), Pose(np.zeros((1, 3)), np.eye(3)[None, None].repeat(17, 1)))
    balls = np.concatenate([ends[0].reshape(-1, 3), radii.reshape(-1, 1)], -1)
    mirrored = balls * [1, -1, 1, 1]
    nearest = np.abs(balls[:, None] - mirrored[None]).max(-1).min(1)
    assert nearest.max() < 1e-6


def test_body_holds_joints_and_reaches_to_its_tips(adult, motion):
    ends, radii = place_body(detailed_body(adult), motion)
    joints, tips = (np.asarray(x) for x in place_joints(adult, motion))
    for frame in range(0, len(ends), 11):
        assert in_capsules(joints[frame], ends[frame], radii).all()
        # A tip lies on the surface: within 1.5 cm, inside or outside.
        beyond = tips[frame] + 0.015 * np.random.default_rng(0).normal(size=(300, 1, 3)).clip(-1, 1)
        near = in_capsules(beyond.reshape(-1, 3), ends[frame], radii).reshape(300, 5)
        assert near.any(0).all()
        assert not near.all(0).any()


def test_body_of_a_skeleton_with_arms_stretched_out(adult):
    joints, tips = np.array(adult.rest_joints), np.array(adult.rest_tips)
    for side, sign, tip in (("l_", 1, 1), ("r_", -1, 2)):
        for name, reach in (("elbow", 0.28), ("hand", 0.59)):
            joints[AT[side + name]] = joints[AT[side + "shoulder"]] + [0, sign * reach, 0]
        tips[tip] = joints[AT[side + "hand"]] + [0, sign * 0.13, 0]
    stretched = make_skeleton(joints, tips)
    placed, _ = place_joints(stretched, demo_motion(stretched, 1))
    # The motion starts in the A-pose whatever the pose at rest.
    arm = np.asarray(placed[0, AT["l_elbow"]] - placed[0, AT["l_shoulder"]])
    np.testing.assert_allclose(arm, 0.28 * np.array([0, np.sin(np.pi / 6), -np.cos(np.pi / 6)]), atol=1e-5)


# Motion


def test_motion_keeps_bone_lengths_and_rotations(adult, motion):
    joints = np.asarray(place_joints(adult, motion)[0])
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(adult.bone_lengths, lengths.shape), atol=1e-5)
    products = motion.rotations @ motion.rotations.swapaxes(-1, -2)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-12)
    assert (np.linalg.det(motion.rotations) > 0).all()


def test_feet_stay_on_the_floor(adult, motion):
    ends, radii = place_body(detailed_body(adult), motion)
    np.testing.assert_allclose((ends[..., 2] - radii).min((1, 2)), 0.0, atol=1e-6)
    balls = np.asarray(place_joints(adult, motion)[0])[:, [AT["l_foot"], AT["r_foot"]]]
    assert balls[..., 2].min(1).max() < 0.065  # in the crouch, on the inner edges of splayed feet
    # A foot that carries the body does not slide but for the turn on the spot.
    standing = balls[:58]
    for foot in range(2):
        carries = standing[:, foot, 2] < standing[:, 1 - foot, 2] - 0.08
        assert carries.any()
        assert np.ptp(standing[carries, foot, :2], axis=0).max() < 0.01


@pytest.mark.parametrize("side", ["l_", "r_"])
def test_elbows_and_knees_bend_the_right_way(adult, motion, side):
    rest = np.asarray(adult.rest_joints)
    for upper, lower, middle, end, sign, most in (
        ("upper_arm", "forearm", "elbow", "hand", 1.0, 150),
        ("thigh", "shank", "knee", "foot", -1.0, 155),
    ):
        turn = motion.rotations[:, SEGMENT[side + upper]].swapaxes(-1, -2) @ motion.rotations[:, SEGMENT[side + lower]]
        bone = rest[AT[side + end]] - rest[AT[side + middle]]
        to_the_front = sign * ((turn @ bone)[:, 0] - bone[0]) / np.linalg.norm(bone)
        degrees = np.rad2deg(np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1)))
        assert degrees.max() > 80
        assert degrees.max() < most
        assert (to_the_front[degrees > 1] > 0).all()


def test_motion_tells_its_story(adult):
    motion = demo_motion(adult, 121, 10.0)
    joints = np.asarray(place_joints(adult, motion)[0])

    def z(name, second):
        return joints[int(second * 10), AT[name], 2]

    assert z("r_hand", 3.8) > z("head", 3.8)
    for side, sign in (("l_", 1), ("r_", -1)):
        arm = joints[53, AT[side + "hand"]] - joints[53, AT[side + "shoulder"]]
        assert sign * arm[1] > 0.98 * np.linalg.norm(arm)
    assert z("l_knee", 8.7) > z("r_knee", 8.7) + 0.35
    # The shoulder goes up with the waving arm.
    assert z("r_shoulder", 3.8) > z("l_shoulder", 3.8) + 0.02
    assert z("head", 10.0) < 0.65 * z("head", 0.0)
    for side in ("l_", "r_"):
        gap = np.linalg.norm(joints[112, AT[side + "hand"]] - joints[112, AT[side + "hip"]])
        assert gap < 0.25
    facing = np.degrees(np.arctan2(motion.rotations[:, 0, 1, 0], motion.rotations[:, 0, 0, 0]))
    assert all((np.abs(np.mod(facing - to + 180, 360) - 180) < 30).any() for to in (0, 90, 180, 270))
    np.testing.assert_allclose(joints[120], joints[0], atol=1e-5)


def test_motion_is_smooth(adult):
    joints = np.asarray(place_joints(adult, demo_motion(adult, 1200, 100.0))[0], float)
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1) * 100
    assert speed.max() < 8.0


@pytest.mark.parametrize(("frames", "fps"), [(0, 5.0), (10, 0.0), (10, np.nan)])
def test_motion_refuses(adult, frames, fps):
    with pytest.raises(ValueError, match="at least one frame and a positive frame rate"):
        demo_motion(adult, frames, fps)


# Scene


def test_ring_shows_the_volume(adult):
    cameras = camera_ring(10, size=(320, 240))
    around = np.linspace(0, 2 * np.pi, 50)
    rim = np.array([[0.95 * np.cos(a), 0.95 * np.sin(a), z] for a in around for z in (0, 1.1, 2.2)])
    u, v, _ = project(cameras, rim)
    # Whole, and as large as it can be.
    assert np.min(u) > 1
    assert np.max(u) < 318
    assert np.min(v) > 1
    assert np.max(v) < 238
    assert min(np.min(u) - 0, 319 - np.max(u), np.min(v), 239 - np.max(v)) < 4
    np.testing.assert_allclose(cameras.centres[:, 2], [1.3, 2.5] * 5, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(cameras.centres[:, :2], axis=-1), 4.0)
    # Not upside down: up in the world is up in the image.
    _, v, _ = project(cameras, np.array([[0, 0, 0.5], [0, 0, 1.5]]))
    assert (v[:, 1] < v[:, 0]).all()


def test_ring_refuses_cameras_inside_the_volume():
    with pytest.raises(ValueError, match="outside of it"):
        camera_ring(radius=0.9)


def test_look_at_refuses_the_vertical():
    with pytest.raises(ValueError, match="straight up or down"):
        look_at(np.array([0, 0, 3.0]), np.zeros(3))


def test_scene_holds_its_truth(scene, adult):
    assert len(scene) == 12
    assert scene.up == "+Z"
    assert scene.fps == 1.0
    np.testing.assert_array_equal(scene.frame_index, np.arange(12))
    joints, tips = place_joints(adult, demo_motion(adult, 12, 1.0))
    np.testing.assert_allclose(scene.truth.joints, joints, atol=1e-6)
    np.testing.assert_allclose(scene.truth.tips, tips, atol=1e-6)
    masks = unpack_silhouettes(scene.silhouettes, 320)
    # The whole body is in every image, and every joint in the body.
    for edge in (masks[..., 0, :], masks[..., -1, :], masks[..., 0], masks[..., -1]):
        assert not edge.any()
    for frame in range(12):
        u, v, _ = project(scene.cameras, scene.truth.joints[frame])
        u, v = np.round(np.asarray(u)).astype(int), np.round(np.asarray(v)).astype(int)
        assert masks[frame, np.arange(4)[:, None], v, u].all()


def test_scene_of_given_motion(adult):
    motion = demo_motion(adult, 3)
    done = []
    scene = make_scene(skeleton=adult, motion=motion, cameras=camera_ring(2, size=(64, 48)), on_frame=done.append)
    assert len(scene) == 3
    assert done == [1, 2, 3]
    with pytest.raises(ValueError, match="give a stack of poses"):
        make_scene(skeleton=adult, motion=Pose(motion.root[0], motion.rotations[0]))


def test_mirrored_scene_is_the_mirrored_image(adult):
    pose = single_pose(demo_motion(adult, 1), 0)
    joints = np.asarray(place_joints(adult, pose)[0][0])
    np.testing.assert_allclose(joints[list(MIRROR_JOINTS)] * [1, -1, 1], joints, atol=1e-6)
    R, t = look_at(np.array([3.0, 0, 1]), np.array([0, 0, 1.0]))
    K = np.array([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1]])
    cameras = make_cameras(K[None], R[None], t[None], (64, 48))
    ends, radii = place_body(detailed_body(adult), pose)
    mask = render_view(make_view(cameras, 0), ends[0], radii)
    np.testing.assert_array_equal(mask, mask[:, ::-1])
