"""The contents of the interactive view, read back from its file."""

from dataclasses import replace
from unittest.mock import patch

import cv2
import equinox as eqx
import numpy as np
import pytest
from support.recordings import moved, with_masks
from support.report_page import FRAMES, LOST
from support.rerun_files import every_frame, read

from jaxskel import JOINT_NAMES, Poses, Recording, Settings, prepare, unpack_silhouettes
from jaxskel.cameras import project
from jaxskel.hull import VoxelGrid, hulls_from_dense
from jaxskel.poses import STATUS_NAMES, Status
from jaxskel.recording import rotation_to_z_up

EMPTY = 7
"""The frame that shows nobody."""


@pytest.fixture(scope="module")
def logged(view, recording, poses, tmp_path_factory) -> dict:
    path = tmp_path_factory.mktemp("view") / "out" / "a.rrd"
    assert view.save_view(path, recording, poses) == FRAMES
    assert [found.name for found in path.parent.iterdir()] == ["a.rrd"]
    return read(path)


def test_joints_are_those_of_the_poses_and_nothing_stale_is_shown(logged, poses):
    shown = every_frame(logged, "/world/skeleton/joints", "positions")
    labels = every_frame(logged, "/world/skeleton/joints", "labels")
    bones = every_frame(logged, "/world/skeleton/bones", "strips")
    for frame in range(FRAMES):
        if frame == LOST:
            assert shown[frame] == labels[frame] == bones[frame] == []
            continue
        np.testing.assert_array_equal(shown[frame], np.concatenate([poses.joints[frame], poses.tips[frame]]))
        assert tuple(labels[frame][:15]) == JOINT_NAMES
        own = np.array(shown[frame])
        forearm = np.array(bones[frame])[JOINT_NAMES.index("l_hand") - 1]
        np.testing.assert_array_equal(forearm, own[[JOINT_NAMES.index("l_hand"), JOINT_NAMES.index("l_elbow")]])
        assert len(bones[frame]) == 19


def test_a_surer_joint_is_thicker(logged, poses):
    radii = np.array(every_frame(logged, "/world/skeleton/joints", "radii")[0])[:15]
    np.testing.assert_array_equal(np.argsort(radii), np.argsort(poses.confidence[0]))
    assert radii.min() > 0.3 * 0.018


def test_poses_without_tips_have_joints_only(view, recording, poses, tmp_path):
    view.save_view(
        tmp_path / "a.rrd", recording, replace(poses, tips=np.full_like(poses.tips, np.nan)), frames=slice(0, 1)
    )
    found = read(tmp_path / "a.rrd")
    np.testing.assert_array_equal(found["/world/skeleton/joints", "positions"][100], poses.joints[0])
    assert len(found["/world/skeleton/bones", "strips"][100]) == 14


def test_hull_graph_and_labels_where_there_is_a_person_and_none_where_there_is_nobody(logged, recording, poses):
    hulls = every_frame(logged, "/world/hull", "positions")
    graphs = every_frame(logged, "/world/graph", "strips")
    labels = every_frame(logged, "/world/labels", "labels")
    nodes = every_frame(logged, "/world/labels", "positions")
    assert hulls[EMPTY] == graphs[EMPTY] == labels[EMPTY] == nodes[EMPTY] == []
    truth = recording.truth.joints
    for frame in set(range(FRAMES)) - {EMPTY}:
        points = np.array(hulls[frame])
        # All joints lie within the hull, which is a few centimetres larger than the person.
        assert (truth[frame].min(0) > points.min(0) - 0.02).all()
        assert (truth[frame].max(0) < points.max(0) + 0.02).all()
        assert len(graphs[frame]) > 20
        assert len(labels[frame]) == len(nodes[frame])
    at = dict(zip(labels[0], nodes[0], strict=True))
    assert np.linalg.norm(np.array(at["head"]) - truth[0, JOINT_NAMES.index("head")]) < 0.15
    assert np.linalg.norm(np.array(at["pelvis"]) - truth[0, JOINT_NAMES.index("pelvis")]) < 0.2


def test_the_surface_of_a_cube_is_all_but_its_inside():
    pytest.importorskip("rerun", reason='needs rerun: pip install "jaxskel[view]"')
    from jaxskel.visualization.viewer._stages import surface_centres

    cube = np.zeros((1, 6, 6, 6), bool)
    cube[0, 0:4, 1:5, 2:6] = True  # at three sides of the grid
    hulls = hulls_from_dense(cube, VoxelGrid(np.array([1.0, 2.0, 3.0]), 0.5, (6, 6, 6)))
    shown = surface_centres(hulls, 0)
    assert len(shown) == 4**3 - 2**3
    inner = (np.array([1.0, 2.0, 3.0]) + 0.5 * (np.array([1, 2, 3]) + 0.5))[None]
    assert np.abs(shown - inner).max(1).min() > 0.4


def test_status_confidence_and_time(logged, poses, recording):
    texts = every_frame(logged, "/status", "text")
    assert texts == [[f"frame {100 + i}: {STATUS_NAMES[s]}"] for i, s in enumerate(poses.status)]
    levels = every_frame(logged, "/status", "level")
    assert [level == ["WARN"] for level in levels] == [i == LOST for i in range(FRAMES)]
    np.testing.assert_allclose(np.ravel(every_frame(logged, "/confidence/joints", "scalars")), poses.confidence.mean(1))
    np.testing.assert_array_equal(np.ravel(every_frame(logged, "/confidence/sides", "scalars")), poses.side_confidence)
    seconds = [time.total_seconds() for time in every_frame(logged, "/status", "time")]
    np.testing.assert_allclose(seconds, np.arange(FRAMES) / recording.fps)


def test_views_show_silhouettes_and_the_projection_with_the_lens(logged, recording, poses):
    assert ("/world/cameras/cam0/silhouette", "blob") in logged
    u, v, _ = project(recording.cameras, np.float64(poses.joints[2]))
    hand, elbow = JOINT_NAMES.index("r_hand"), JOINT_NAMES.index("r_elbow")
    for camera, name in enumerate(recording.cameras.names):
        lines = every_frame(logged, f"/world/cameras/{name}/skeleton", "strips")
        assert lines[LOST] == []
        # The viewer's pixels have their centres at halves.
        expected = np.stack([u[camera], v[camera]], -1)[[hand, elbow]] + 0.5
        np.testing.assert_allclose(lines[2][hand - 1], expected, atol=1e-4)
        png = every_frame(logged, f"/world/cameras/{name}/silhouette", "blob")[2][0]
        image = cv2.imdecode(np.array(png, np.uint8), cv2.IMREAD_GRAYSCALE)
        width, height = recording.cameras.size[camera].tolist()
        np.testing.assert_array_equal(image > 128, unpack_silhouettes(recording.silhouettes[2, camera], width)[:height])


def test_large_views_are_shown_small_and_fit_their_cameras(view, recording, poses, tmp_path):
    big = eqx.tree_at(lambda c: (c.size, c.K), recording.cameras, (8 * recording.cameras.size, enlarged(recording, 8)))
    masks = np.repeat(np.repeat(unpack_silhouettes(recording.silhouettes[:1], 200), 8, 2), 8, 3)
    part = eqx.tree_at(lambda r: r.cameras, with_masks(recording[:1], np.packbits(masks, -1)), big)
    view.save_view(tmp_path / "a.rrd", part, first(poses))
    found = read(tmp_path / "a.rrd")
    for camera, name in enumerate(recording.cameras.names):
        assert found[f"/world/cameras/{name}", "resolution"][None] == [[640.0, 512.0]]
        K = np.array(found[f"/world/cameras/{name}", "image_from_camera"][None][0]).reshape(3, 3).T
        # Through lenses without distortion, as of the later cameras, a joint is where the viewer itself projects it.
        if camera > 0:
            centre = np.array(found[f"/world/cameras/{name}", "translation"][None][0])
            turn = np.array(found[f"/world/cameras/{name}", "mat3x3"][None][0]).reshape(3, 3).T
            ray = K @ turn.T @ (poses.joints[0, 4] - centre)
            shown = np.array(found[f"/world/cameras/{name}/skeleton", "strips"][100])[3, 0]
            np.testing.assert_allclose(ray[:2] / ray[2], shown, atol=0.01)


def enlarged(recording: Recording, factor: int) -> np.ndarray:
    K = np.array(recording.cameras.K)
    K[:, :2, 2] += 0.5
    K[:, :2] *= factor
    K[:, :2, 2] -= 0.5
    return K


def first(poses: Poses) -> Poses:
    return Poses(
        poses.joints[:1], poses.tips[:1], None, None, poses.confidence[:1], poses.side_confidence[:1],
        poses.status[:1], poses.fps, poses.up, poses.frame_index[:1],
    )  # fmt: skip


@pytest.mark.parametrize(("up", "code"), [("+Z", [3, 5, 1]), ("-Y", [3, 2, 5]), ("-X", [2, 3, 6])])
def test_the_up_axis_is_the_recordings_and_the_hull_stands_along_it(view, recording, tmp_path, up, code):
    turn = rotation_to_z_up(up).T
    other = eqx.tree_at(lambda r: r.frame_index, moved(recording, turn, np.zeros(3), up), recording.frame_index)
    view.save_view(tmp_path / "a.rrd", other, frames=slice(0, 1))
    found = read(tmp_path / "a.rrd")
    # Where x, y and z point to, as the viewer counts: 1 up, 2 down, 3 right, 5 forward, 6 back.
    assert found["/world", "xyz"][None] == [code]
    at = dict(zip(found["/world/labels", "labels"][100], found["/world/labels", "positions"][100], strict=True))
    rise = (np.array(at["head"]) - np.array(at["left foot"])) @ turn[:, 2]
    assert rise > 1.0


def test_without_poses_there_is_no_skeleton_but_hull_and_graph(view, recording, tmp_path):
    counted = []
    done = view.save_view(
        tmp_path / "a.rrd", recording, frames=slice(EMPTY - 1, EMPTY + 1), on_frame=lambda *n: counted.append(n)
    )
    assert (done, counted) == (2, [(1, 2), (2, 2)])
    found = read(tmp_path / "a.rrd")
    entities = {entity for entity, _ in found}
    assert {"/world/hull", "/world/graph", "/world/labels", "/status"} <= entities
    assert not {e for e in entities if "skeleton" in e or "confidence" in e}
    assert found["/status", "text"] == {106: ["frame 106: ok"], 107: ["frame 107: empty"]}


def test_a_frame_of_several_people_shows_all_that_was_carved(recording):
    pytest.importorskip("rerun", reason='needs rerun: pip install "jaxskel[view]"')
    from jaxskel.visualization.viewer._stages import stages_of_frames

    prepared = prepare(recording, Settings(), calibrate=False)
    (alone,) = stages_of_frames(recording, np.array([0]), prepared, Settings())
    nobody = replace_seen()
    with patch("jaxskel.pipeline._observe_batch.see_people", nobody):
        (refused,) = stages_of_frames(recording, np.array([0]), prepared, Settings())
    assert refused.status == Status.SEVERAL_PEOPLE
    assert len(refused.surface) >= len(alone.surface) > 1000
    assert len(refused.edges) == 0
    assert np.isnan(refused.named).all()


def replace_seen():
    """As if there were several people in the one frame that is seen."""
    from jaxskel.hull import see_people

    def seen(*arguments):
        found = see_people(*arguments)
        none = np.zeros(0, int)
        return replace(found, status=np.array([Status.SEVERAL_PEOPLE]), frames=none, hulls=found.hulls[none])

    return seen


def test_frames_of_the_recording_are_shown_in_order_whatever_the_order_of_the_poses(view, recording, poses, tmp_path):
    back = np.arange(FRAMES)[::-1]
    turned = Poses(
        poses.joints[back], poses.tips[back], None, None, poses.confidence[back], poses.side_confidence[back],
        poses.status[back], poses.fps, poses.up, poses.frame_index[back],
    )  # fmt: skip
    assert view.save_view(tmp_path / "a.rrd", recording, turned, frames=slice(0, 2)) == 2
    shown = read(tmp_path / "a.rrd")["/world/skeleton/joints", "positions"]
    assert sorted(shown) == [100, 101]
    np.testing.assert_array_equal(shown[101][:15], poses.joints[1])
