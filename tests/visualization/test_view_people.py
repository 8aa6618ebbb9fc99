"""The interactive view of several people, read back from its file."""

from dataclasses import replace

import numpy as np
import pytest
from support.command_line import jaxskel
from support.report_page import FRAMES, LOST, two_people
from support.rerun_files import every_frame, read

from jaxskel import Poses
from jaxskel.io.poses import write_people_poses
from jaxskel.io.recordings import write_recording
from jaxskel.poses import STATUS_NAMES
from jaxskel.visualization import PEOPLE


@pytest.fixture(scope="module")
def people(recording) -> dict[str, Poses]:
    return two_people(recording)


@pytest.fixture(scope="module")
def logged(view, recording, people, tmp_path_factory) -> dict:
    path = tmp_path_factory.mktemp("view") / "two.rrd"
    assert view.save_view(path, recording, people) == FRAMES
    return read(path)


@pytest.mark.parametrize(("name", "place"), [("anna", 0), ("ben", 1)])
def test_each_has_a_skeleton_of_their_own(logged, people, name, place):
    poses = people[name]
    shown = every_frame(logged, f"/world/skeleton/{name}/joints", "positions")
    bones = every_frame(logged, f"/world/skeleton/{name}/bones", "strips")
    for frame in range(FRAMES):
        there = poses.has_pose[frame]
        assert (len(shown[frame]), len(bones[frame])) == ((20, 19) if there else (0, 0))
        if there:
            np.testing.assert_array_equal(shown[frame][:15], poses.joints[frame])
    red, green, blue = PEOPLE[place]
    rgba = (red << 24) + (green << 16) + (blue << 8) + 255
    for entity in (f"/world/skeleton/{name}/bones", f"/world/cameras/cam1/skeleton/{name}"):
        assert set(every_frame(logged, entity, "colors")[0]) == {rgba}


def test_each_has_a_status_and_a_confidence(logged, people):
    for name, poses in people.items():
        texts = every_frame(logged, f"/status/{name}", "text")
        assert texts == [[f"frame {100 + i}: {STATUS_NAMES[s]}"] for i, s in enumerate(poses.status)]
        means = np.ravel(every_frame(logged, f"/confidence/{name}/joints", "scalars"))
        np.testing.assert_allclose(means, poses.confidence.mean(1))
        assert logged[f"/confidence/{name}/sides", "names"][None] == [f"{name}: left and right"]
    assert every_frame(logged, "/world/skeleton/anna/joints", "positions")[LOST] == []
    assert ("/world/skeleton/joints", "positions") not in logged


def test_people_of_other_frames_are_refused(view, recording, people, tmp_path):
    with pytest.raises(ValueError, match="ben: has other frames"):
        view.save_view(tmp_path / "no.rrd", recording, people | {"ben": replace(people["ben"], fps=7.0)})
    assert list(tmp_path.iterdir()) == []


def test_the_command_shows_everybody(view, recording, people, tmp_path):
    write_recording(tmp_path / "scene.npz", recording)
    write_people_poses(tmp_path, {name: replace(poses, covariance=None) for name, poses in people.items()})
    done = jaxskel("view", "scene.npz", "poses.npz", "--frames", "3:5", "--save", "a.rrd", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("a.rrd: 2 frames, 4 views, with poses of 2 people, 0.")
    assert sorted(read(tmp_path / "a.rrd")["/status/ben", "text"]) == [103, 104]
