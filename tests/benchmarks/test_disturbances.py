"""How benchmarks disturb a recording: exactly the requested changes are made."""

import cameras as rigs
import cv2
import equinox as eqx
import numpy as np
import pytest
from _condition import Condition, disturbed
from _slim import with_slim_body
from disturb import holes_and_blobs, rough_edges, with_cameras, with_dirty_masks, with_wrong_bones
from support.spoilt_rigs import masks_of

from jaxskel import JOINT_NAMES, Recording, make_cameras, pack_silhouettes, unpack_silhouettes
from jaxskel.body import MIRROR_JOINTS
from jaxskel.body._human import MIRROR_TIPS
from jaxskel.synthetic import make_scene

SEEDS = range(24)


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(4)


def a_person() -> np.ndarray:
    """A body, a head, and an arm of 5 px that sticks out; one foot stands on the edge of the image."""
    mask = np.zeros((200, 160), bool)
    mask[60:, 60:100] = True
    mask[80:85, 100:140] = True
    cv2.circle(mask.view(np.uint8), (80, 45), 14, 1, -1)
    return mask


def ring(mask: np.ndarray, width: int) -> np.ndarray:
    """Pixels whose nearest pixel of the other kind is at most `width` away, counted the slow way."""
    near = np.zeros_like(mask)
    for dv in range(-width, width + 1):
        for du in range(-width, width + 1):
            if dv * dv + du * du <= width * width:
                padded = np.pad(mask, width, mode="edge")
                h, w = mask.shape
                near |= padded[width + dv : width + dv + h, width + du : width + du + w] != mask
    return near


def unchanged(before: Recording, copy: np.ndarray) -> bool:
    return np.array_equal(before.silhouettes, copy)


# --- cameras


def test_cameras_are_chosen_with_their_silhouettes(scene):
    fewer = with_cameras(scene, [5, 0, 2])
    assert fewer.cameras.names == tuple(scene.cameras.names[i] for i in (5, 0, 2))
    np.testing.assert_array_equal(fewer.cameras.t, scene.cameras.t[[5, 0, 2]])
    np.testing.assert_array_equal(fewer.silhouettes, scene.silhouettes[:, [5, 0, 2]])
    assert len(scene.cameras) == 8


@pytest.mark.parametrize("indices", [[0, 8], [-1], [1, 1], []])
def test_impossible_cameras_are_refused(scene, indices):
    with pytest.raises(ValueError, match=r"synthetic: cameras .* from 0 to 7"):
        with_cameras(scene, indices)


def test_cameras_are_put_wrong_by_what_it_says_and_the_hull_shows_it(scene):
    wrong = rigs.perturbed(scene.cameras, 3)
    turned = np.asarray(wrong.R) @ np.asarray(scene.cameras.R).swapaxes(-1, -2)
    angles = np.arccos((np.trace(turned, axis1=1, axis2=2) - 1) / 2)
    np.testing.assert_allclose(angles, rigs.TURN)
    np.testing.assert_allclose(np.linalg.norm(wrong.centres - scene.cameras.centres, axis=1), rigs.SHIFT)
    assert not np.allclose(turned, rigs.perturbed(scene.cameras, 4).R @ np.asarray(scene.cameras.R).swapaxes(-1, -2))
    frames = np.arange(2)
    true = rigs.drawn_agreement(scene, frames)
    # Half a voxel is missing around; the person is as wide as a dozen voxels.
    assert 0.85 < true < 1
    assert rigs.drawn_agreement(eqx.tree_at(lambda r: r.cameras, scene, wrong), frames) < true - 0.05


# --- masks


@pytest.mark.parametrize("seed", SEEDS)
def test_edges_move_by_at_most_two_pixels(seed):
    mask = a_person()
    rough = rough_edges(mask, np.random.default_rng(seed))
    assert not (rough != mask)[~ring(mask, 2)].any()


def test_edges_move_both_ways_by_every_amount_and_raggedly():
    mask = a_person()
    grown, layers = [], []
    for seed in SEEDS:
        rough = rough_edges(mask, np.random.default_rng(seed))
        moved = rough != mask
        grown.append(int(rough.sum()) - int(mask.sum()))
        # Shares of the outline's first and second pixel that changed.
        one, two = ring(mask, 1), ring(mask, 2) & ~ring(mask, 1)
        side = rough if grown[-1] > 0 else ~rough
        kind = ~mask if grown[-1] > 0 else mask
        layers.append([(moved & side & kind)[layer & kind].mean() for layer in (one, two)])
    outline = (ring(mask, 1) & mask).sum()
    assert min(grown) < -outline
    assert max(grown) > outline
    first, second = np.array(layers).T
    assert (first > 0.95).any()
    assert (second > 0.5).any()
    assert ((first > 0.05) & (first < 0.7)).any()  # ragged: moved in places only


def test_nothing_stays_nothing():
    empty = np.zeros((50, 60), bool)
    assert not rough_edges(empty, np.random.default_rng(0)).any()
    assert not holes_and_blobs(empty, np.random.default_rng(0)).any()
    assert rough_edges(~empty, np.random.default_rng(0)).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_two_discs_of_twenty_pixels_on_or_near_the_person(seed):
    # A person too large for two discs to touch the edge, or a small one far from the edges.
    large, small = np.ones((400, 400), bool), np.zeros((400, 400), bool)
    small[190:210, 190:210] = True
    (v, u) = np.mgrid[:400, :400]
    disc = int(((v - 200) ** 2 + (u - 200) ** 2 <= 400).sum())
    assert disc == pytest.approx(np.pi * 20**2, rel=0.01)
    holes = large & ~holes_and_blobs(large, np.random.default_rng(seed))
    assert holes.sum() <= 2 * disc
    blobs = holes_and_blobs(small, np.random.default_rng(seed)) & ~small
    assert blobs.sum() <= 2 * disc
    rows, columns = np.nonzero(blobs)
    if len(rows):
        # A centre lies within 40 px of the person in u and in v, and the disc reaches 20 px farther.
        assert min(rows.min(), columns.min()) >= 190 - 40 - 20
        assert max(rows.max(), columns.max()) <= 209 + 40 + 20


def test_holes_and_blobs_both_occur_and_are_whole():
    large = np.ones((600, 600), bool)
    small = np.zeros((600, 600), bool)
    small[300, 300] = True
    disc = 1257  # pixels whose centre is at most 20 px from that of the middle
    holes = [int((~holes_and_blobs(large, np.random.default_rng(seed))).sum()) for seed in SEEDS]
    blobs = [int(holes_and_blobs(small, np.random.default_rng(seed)).sum()) for seed in SEEDS]
    assert disc in holes
    assert 2 * disc in holes
    assert any(count in blobs for count in (disc, disc + 1))
    # A single point with two holes on it is gone.
    assert 0 in blobs


def test_one_view_of_each_frame_is_black(scene):
    dirty = masks_of(with_dirty_masks(scene, 3))
    assert masks_of(scene).any((2, 3)).all()
    np.testing.assert_array_equal((~dirty.any((2, 3))).sum(1), 1)
    seeds = [np.flatnonzero(~masks_of(with_dirty_masks(scene, seed)).any((2, 3)).ravel()) % 8 for seed in range(4)]
    assert len(np.unique(seeds)) > 3


def test_far_from_edges_and_discs_a_dirty_mask_is_the_clean_one(scene):
    clean, dirty = masks_of(scene), masks_of(with_dirty_masks(scene, 3))
    disc = 1257
    for frame, frame_dirty in zip(clean, dirty, strict=True):
        seen = frame_dirty.any((1, 2))
        for before, after in zip(frame[seen], frame_dirty[seen], strict=True):
            assert (before != after).any()
            assert ((before != after) & ~ring(before, 2)).sum() <= 2 * disc


def test_dirt_is_reproducible_and_differs_by_seed_and_recording(scene):
    first = with_dirty_masks(scene, 1).silhouettes
    np.testing.assert_array_equal(first, with_dirty_masks(scene, 1).silhouettes)
    assert not np.array_equal(first, with_dirty_masks(scene, 2).silhouettes)
    assert not np.array_equal(first, with_dirty_masks(eqx.tree_at(lambda r: r.name, scene, "other"), 1).silhouettes)


def test_a_frame_is_disturbed_alike_whichever_are_chosen_with_it(scene):
    some = with_dirty_masks(scene[1::2], 1).silhouettes
    np.testing.assert_array_equal(some, with_dirty_masks(scene, 1).silhouettes[1::2])


def test_pixels_beside_a_narrow_image_stay_empty():
    """Widths that are no multiple of 8, and cameras of two sizes, share one stack of bits."""
    sizes = np.array([[61, 50], [80, 40]])
    K = np.tile(np.array([[50.0, 0, 30], [0, 50, 20], [0, 0, 1]]), (2, 1, 1))
    cameras = make_cameras(K, np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), sizes)
    masks = np.zeros((30, 2, 50, 80), bool)
    masks[:, 0, 20:50, 40:61] = masks[:, 1, 5:40, 40:80] = True
    narrow = Recording(cameras, pack_silhouettes(masks), 1.0, "+Z", np.arange(30))
    dirty = unpack_silhouettes(with_dirty_masks(narrow, 0).silhouettes, 80)
    assert not dirty[:, 0, :, 61:].any()
    assert not dirty[:, 1, 40:].any()
    assert dirty[:, 0, :, 60].any()


# --- bones


@pytest.mark.parametrize("seed", range(8))
def test_bones_are_off_by_the_share_and_alike_on_both_sides(scene, seed):
    wrong = with_wrong_bones(scene, 0.05, seed).skeleton
    assert wrong is not None
    ratio = np.insert(wrong.bone_lengths / scene.skeleton.bone_lengths, 0, 1.0)
    np.testing.assert_allclose(np.abs(ratio[1:] - 1), 0.05, atol=1e-12)
    np.testing.assert_allclose(ratio, ratio[list(MIRROR_JOINTS)], atol=1e-12)
    flip = np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(wrong.rest_joints, wrong.rest_joints[list(MIRROR_JOINTS)] * flip, atol=1e-12)
    np.testing.assert_allclose(wrong.rest_tips, wrong.rest_tips[list(MIRROR_TIPS)] * flip, atol=1e-12)


def test_tips_follow_the_bone_of_their_joint(scene):
    wrong = with_wrong_bones(scene, 0.05, 0).skeleton
    assert wrong is not None
    ratio = wrong.bone_lengths / scene.skeleton.bone_lengths
    ends = [JOINT_NAMES.index(name) - 1 for name in ("head", "l_hand", "r_hand", "l_foot", "r_foot")]
    np.testing.assert_allclose(wrong.tip_lengths / scene.skeleton.tip_lengths, ratio[ends], atol=1e-12)


def test_bones_are_reproducible_and_the_rest_is_untouched(scene):
    joints = scene.skeleton.rest_joints.copy()
    first = with_wrong_bones(scene, 0.05, 1)
    assert first.skeleton is not None
    np.testing.assert_array_equal(first.skeleton.rest_joints, with_wrong_bones(scene, 0.05, 1).skeleton.rest_joints)
    drawn = {with_wrong_bones(scene, 0.05, seed).skeleton.bone_lengths.tobytes() for seed in range(8)}
    assert len(drawn) > 4
    np.testing.assert_array_equal(scene.skeleton.rest_joints, joints)
    np.testing.assert_array_equal(first.truth.joints, scene.truth.joints)
    assert unchanged(scene, first.silhouettes)


def test_share_of_nothing_changes_nothing(scene):
    same = with_wrong_bones(scene, 0.0, 1).skeleton
    np.testing.assert_allclose(same.rest_joints, scene.skeleton.rest_joints, atol=1e-12)
    np.testing.assert_allclose(same.rest_tips, scene.skeleton.rest_tips, atol=1e-12)


def test_bones_that_cannot_be_disturbed_are_refused(scene):
    unknown = eqx.tree_at(lambda r: r.skeleton, scene, None)
    with pytest.raises(ValueError, match=r"synthetic: key 'rest_joints'"):
        with_wrong_bones(unknown, 0.05, 0)
    with pytest.raises(ValueError, match=r"share 5"):
        with_wrong_bones(scene, 5, 0)


# --- conditions


def test_a_condition_does_all_it_names_and_leaves_its_input(scene):
    before = scene.silhouettes.copy()
    result = disturbed(scene, Condition(cameras=(0, 2, 4, 6), dirty=1, bones=0.05, seed=2, step=2))
    assert unchanged(scene, before)
    assert (len(result), len(result.cameras), result.fps) == (2, 4, scene.fps / 2)
    np.testing.assert_array_equal(result.frame_index, [0, 2])
    np.testing.assert_array_equal(result.truth.joints, scene.truth.joints[::2])
    assert ((~masks_of(result).any((2, 3))).sum(1) == 1).all()  # one of the four, not one left out
    assert not np.allclose(result.skeleton.bone_lengths, scene.skeleton.bone_lengths)
    named = str(Condition(cameras=(0, 2), dirty=1, bones=0.05, seed=2, step=4))
    assert named == "cameras 0 2, dirty masks (seed 1), bones ±5 % (seed 2), 1 frame in 4"
    assert str(Condition()) == ""
    assert str(Condition(clothes=3, unknown=True)) == "clothes (seed 3), dimensions unknown"
    assert str(Condition(slim=0.5)) == "slim body (0.5 of the radii)"
    assert disturbed(scene, Condition(unknown=True)).skeleton is None
    slim = disturbed(scene, Condition(slim=0.5)).silhouettes
    np.testing.assert_array_equal(slim, with_slim_body(scene, 0.5).silhouettes)
