"""Frames that get no pose, and what their status says."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest
from support.recordings import graph_settings, with_hull, with_known_body, with_masks

from jaxskel import (
    Pose,
    Poses,
    Recording,
    Settings,
    Status,
    make_skeleton,
    prepare,
    reconstruct,
)
from jaxskel.search import Search
from jaxskel.synthetic import demo_motion, make_scene

pytestmark = pytest.mark.slow

GRAPH = graph_settings()


@pytest.fixture(scope="module")
def scene() -> Recording:
    """The whole motion of twelve seconds in one batch of frames."""
    return make_scene(8, fps=8 / 12)


@pytest.fixture(scope="module")
def of_graph(scene) -> Poses:
    return reconstruct(scene, GRAPH)


@pytest.fixture(scope="module")
def longer() -> Recording:
    return make_scene(16, fps=16 / 12)


def distances_mm(a, b):
    return 1e3 * np.linalg.norm(np.asarray(a, float) - np.asarray(b, float), axis=-1)


def names(poses: Poses) -> list[str]:
    return [Status(s).name for s in poses.status]


def test_person_outside_of_the_box_has_no_pose(scene):
    poses = reconstruct(scene, with_hull(GRAPH, box=np.array([[-1.2, -1.2, -0.1], [1.2, 1.2, 1.3]])))
    assert not poses.has_pose.any()
    assert "PARTLY_OUTSIDE" in names(poses)


@pytest.mark.parametrize("settings", [Settings(), GRAPH])
def test_noise_specks_are_no_person(scene, settings):
    masks = np.zeros_like(scene.silhouettes)
    masks[:, :, 100:103, 10] = 0xFF
    assert set(names(reconstruct(with_masks(scene, masks), settings))) == {"EMPTY"}


@pytest.mark.parametrize("settings", [Settings(), GRAPH])
def test_black_recording_is_empty_throughout(scene, settings):
    poses = reconstruct(with_masks(scene, np.zeros_like(scene.silhouettes)), settings)
    assert set(names(poses)) == {"EMPTY"}
    assert np.isnan(poses.joints).all()


def test_several_people_get_no_pose(scene, of_graph):
    motion = demo_motion(scene.skeleton, 8, 8 / 12)
    # Frames in which the arms hang, so that the two do not touch.
    beside = Pose(np.asarray(motion.root)[1:3] + [0.0, 1.0, 0.0], motion.rotations[1:3])
    masks = scene.silhouettes.copy()
    masks[1:3] |= make_scene(skeleton=scene.skeleton, motion=beside).silhouettes
    other = reconstruct(with_masks(scene, masks), GRAPH)
    assert set(names(other)[1:3]) == {"SEVERAL_PEOPLE"}
    assert np.median(distances_mm(other.joints[3:], of_graph.joints[3:])) < 1


@pytest.mark.parametrize("step_aside", [2.0, 2.5])
def test_person_half_outside_gets_no_invented_pose(scene, step_aside):
    motion = demo_motion(scene.skeleton, 4)
    aside = eqx.tree_at(lambda m: m.root, motion, np.asarray(motion.root) + [step_aside, 0.0, 0.0])
    recording = make_scene(skeleton=scene.skeleton, motion=aside)
    assert set(names(reconstruct(recording, GRAPH))) == {"PARTLY_OUTSIDE"}


def test_masks_cut_in_half_give_no_pose(scene):
    masks = scene.silhouettes.copy()
    masks[2, :, masks.shape[2] // 2 :] = 0
    masks[4, :, :, : masks.shape[3] // 2] = 0
    other = reconstruct(with_masks(scene, masks), GRAPH)
    assert not other.has_pose[[2, 4]].any()


@pytest.mark.parametrize("searching", [True, False])
def test_dimensions_of_somebody_else_are_refused(scene, searching):
    child = make_skeleton(0.5 * np.asarray(scene.skeleton.rest_joints), 0.5 * np.asarray(scene.skeleton.rest_tips))
    recording = eqx.tree_at(lambda r: r.skeleton, scene, child)
    # The search takes longer if poses cost more, so a short one is used here.
    settings = replace(with_known_body(recording), search=Search(again=0, doubtful=np.inf)) if searching else GRAPH
    poses = reconstruct(recording, settings)
    assert set(names(poses)) == {"NO_MATCH"}


def test_voting_forgives_a_hole_in_one_view(scene):
    masks = scene.silhouettes.copy()
    masks[:, 0, 200:300] = 0  # a stripe across the body in one view cuts every hull in two
    holed = with_masks(scene, masks)[:4]
    strict, voted = (reconstruct(holed, with_hull(GRAPH, max_misses=misses)) for misses in (0, 1))
    assert (~strict.has_pose).mean() > 0.5
    assert voted.has_pose.mean() > 0.9
    # By default the number of views that may err is chosen from the silhouettes.
    assert prepare(holed, with_hull(GRAPH, max_misses=None)).max_misses == 1
