"""Voxels without silhouettes: the same poses as from the silhouettes that they were carved from, the same statuses."""

from dataclasses import replace
from functools import cache

import equinox as eqx
import jaxtyping
import numpy as np
import pytest
from support.shared_data import SEQUENCE, needs
from support.voxel_people import carved

import jaxskel as js
from jaxskel import Poses, Recording, Status
from jaxskel.hull import VoxelGrid
from jaxskel.pipeline import advice_for_volumes
from jaxskel.recording import rotation_to_z_up
from jaxskel.refinement.terms import volume_objective
from jaxskel.synthetic import camera_ring, make_scene

PAPER = js.paper_settings()


def unknown(recording: Recording) -> Recording:
    return eqx.tree_at(lambda r: r.skeleton, recording, None, is_leaf=lambda leaf: leaf is None)


@cache
def given() -> tuple[Recording, np.ndarray, VoxelGrid]:
    scene = make_scene(6, cameras=camera_ring(6, size=(200, 160)))
    return scene, *carved(scene, PAPER)


def same(one: Poses, other: Poses) -> None:
    assert one.status.tolist() == other.status.tolist()
    for field in ("joints", "tips", "rotations", "confidence", "side_confidence", "covariance"):
        np.testing.assert_allclose(getattr(one, field), getattr(other, field), atol=1e-4, err_msg=field)
    assert one.skeleton is not None
    assert other.skeleton is not None
    assert one.skeleton.stature == pytest.approx(other.skeleton.stature)


@pytest.mark.parametrize("known", [True, False])
def test_voxels_give_the_poses_that_their_silhouettes_give(known):
    scene, occupied, grid = given()
    recording = scene if known else unknown(scene)
    poses = js.reconstruct_hulls(
        occupied, grid.origin, grid.spacing, PAPER, recording.skeleton, fps=scene.fps, frame_index=scene.frame_index
    )
    assert poses.has_pose.all()
    same(poses, js.reconstruct(recording, PAPER))


@needs(SEQUENCE)
def test_voxels_of_a_realistic_body_give_the_poses_that_its_silhouettes_give():
    recording = unknown(js.read_recording(SEQUENCE)[::12])
    occupied, grid = carved(recording, PAPER)
    poses = js.reconstruct_hulls(occupied, grid.origin, grid.spacing, fps=recording.fps)
    from_silhouettes = js.reconstruct(recording, PAPER)
    assert poses.has_pose.all()
    assert np.abs(poses.joints - from_silhouettes.joints).max() < 1e-3


def test_a_world_with_another_up_axis():
    scene, occupied, grid = given()
    turn = rotation_to_z_up("-Y").T
    axes = np.abs(turn).argmax(1)
    there = occupied.transpose(0, *(1 + axes))[(slice(None), *(slice(None, None, int(s)) for s in turn.sum(1)))]
    corner = (np.stack([grid.origin, grid.upper]) @ turn.T).min(0)
    poses = js.reconstruct_hulls(there, corner, grid.spacing, skeleton=scene.skeleton, up="-Y")
    upright = js.reconstruct_hulls(occupied, grid.origin, grid.spacing, skeleton=scene.skeleton)
    np.testing.assert_allclose(poses.joints, upright.joints @ turn.T, atol=1e-4)


def test_statuses():
    scene, occupied, grid = given()
    person = occupied[0]
    there = np.argwhere(person)
    lower, upper = there.min(0), there.max(0) + 1
    shape = np.array([2, 1, 1]) * (upper - lower) + 4
    frames = {status: np.zeros(shape, bool) for status in ("ok", "empty", "no_hull", "several", "cut")}
    whole = person[tuple(slice(*each) for each in zip(lower, upper, strict=True))]
    x, y, z = whole.shape

    def put(frame: np.ndarray, body: np.ndarray, at: tuple[int, int, int]) -> None:
        frame[tuple(slice(low, low + n) for low, n in zip(at, body.shape, strict=True))] |= body

    for name in ("ok", "several"):
        put(frames[name], whole, (1, 1, 1))
    put(frames["several"], whole, (3 + x, 1, 1))
    frames["ok"][-2, -2, -2] = True  # a speck is nobody
    put(frames["no_hull"], np.ones((10, 10, 10), bool), (2, 2, 2))
    put(frames["cut"], whole[:, :, z // 4 :], (1, 1, 0))
    poses = js.reconstruct_hulls(np.stack(list(frames.values())), grid.origin, grid.spacing, skeleton=scene.skeleton)
    assert poses.status.tolist() == [
        Status.OK, Status.EMPTY, Status.NO_HULL, Status.SEVERAL_PEOPLE, Status.PARTLY_OUTSIDE
    ]  # fmt: skip
    assert np.isnan(poses.joints[1:]).all()
    assert advice_for_volumes(poses) is None
    for row, hint in enumerate(("no voxel", "litres", "more than one", "pad it"), start=1):
        single = js.reconstruct_hulls(frames[list(frames)[row]][None], grid.origin, grid.spacing)
        assert hint in (advice_for_volumes(single) or "")


def in_search_of(**changes):
    return lambda: replace(PAPER, **changes)


@pytest.mark.parametrize(
    ("settings", "hint"),
    [
        (js.Settings, "virtual_recording"),
        (in_search_of(search=js.Search()), "a search"),
        (in_search_of(search=js.Search(), tracking=js.Tracking()), "paper_settings()"),
        (in_search_of(hull=js.HullSettings(box=np.array([[-1.0, -1, 0], [1, 1, 2]]))), "hull.box"),
        (lambda: "paper", "paper_settings()"),
    ],
)
def test_settings_that_need_silhouettes_are_refused(settings, hint, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    with pytest.raises(ValueError, match=r"\Asettings: [^\n]*\Z") as refused:
        js.reconstruct_hulls(np.ones((1, 3, 3, 3), bool), np.zeros(3), 0.02, settings())
    assert hint in str(refused.value)


def test_an_objective_of_outlines_is_refused_where_settings_could_not_know_it():
    # Of the default body it needs none, of this one it does.
    body = js.make_body(js.default_adult(1.6))

    def objective(of):
        return volume_objective(of) if of.skeleton.stature < 1.7 else js.terms.paper_objective()

    settings = replace(PAPER, refinement=replace(PAPER.refinement, objective=objective))
    settings = eqx.tree_at(lambda s: s.body, settings, body, is_leaf=lambda leaf: leaf is None)
    with pytest.raises(ValueError, match=r"\Asettings: an objective of outlines [^\n]*virtual_recording[^\n]*\Z"):
        js.reconstruct_hulls(np.ones((1, 3, 3, 3), bool), np.zeros(3), 0.02, settings)
