"""Labels of end nodes on other templates than the paper's human: how many are right, by the paper's preset.

    python benchmarks/templates.py hand quadruped [--poses 50] [--seed 0] [--dtw] [--picture FOLDER]

Each template's capsules are rendered in random poses within the limits of its joints, by eight cameras. Its size is not
known to the method. A label is right if its end node is nearer to its own tip than to any other, and within 15 % of the
template's size from it.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from jaxskel import Poses, Recording, Settings, Skeleton, keep_compiled, paper_settings, reconstruct
from jaxskel.io.templates import BUILT_IN, built_in
from jaxskel.matching import DtwMatcher
from jaxskel.pipeline import observe_batch, prepare
from jaxskel.synthetic import camera_ring, make_scene, random_poses

_AT_ONCE = 32
_NEAR = 0.15


def scene_of(skeleton: Skeleton, poses: int, seed: int = 0) -> Recording:
    """Random poses of a template, whose dimensions are not told, in eight views of 640 x 480 pixels."""
    size = skeleton.size
    cameras = camera_ring(
        8, radius=2.4 * size, heights=(0.75 * size, 1.5 * size), volume=(1.6 * size, 1.3 * size)
    )  # fmt: skip
    scene = make_scene(cameras=cameras, skeleton=skeleton, motion=random_poses(skeleton, poses, seed))
    return replace(scene, skeleton=None)


def right_labels(scene: Recording, settings: Settings) -> Bool[np.ndarray, "frames tips"]:
    """Which labels of end nodes are right in each frame; none in frames without a graph."""
    assert scene.truth is not None
    assert scene.truth.tips is not None
    assert settings.template is not None
    tips = scene.truth.tips
    prepared, right = prepare(scene, settings), np.zeros(tips.shape[:2], bool)
    for first in range(0, len(scene), _AT_ONCE):
        found = observe_batch(scene[first : first + _AT_ONCE], prepared, settings, outlines=False)
        if found.labelled is None:
            continue
        frames, limbs = first + found.seen.frames, found.labelled.limbs
        apart = np.linalg.norm(limbs.ends[:, :, None] / prepared.scale - tips[frames, None], axis=-1)
        own = np.diagonal(apart, axis1=1, axis2=2)
        near = own < _NEAR * settings.template.size
        right[frames] = limbs.found & near & (apart.argmin(2) == np.arange(apart.shape[1]))
    return right


def errors(poses: Poses, scene: Recording) -> tuple[float, float]:
    """Median and 95th percentile of the distance of all joints from the truth (m)."""
    assert scene.truth is not None
    apart = np.linalg.norm(poses.joints - scene.truth.joints, axis=-1)
    return float(np.nanmedian(apart)), float(np.nanpercentile(apart, 95))


def draw(poses: Poses, scene: Recording, path: Path) -> None:
    """Poses of twelve frames over the silhouettes of a view."""
    import matplotlib.pyplot as plt

    from jaxskel.cameras import project
    from jaxskel.recording import unpack_silhouettes

    figure, axes = plt.subplots(3, 4, figsize=(16, 12))
    template, masks = poses.template, unpack_silhouettes(scene.silhouettes[:12, 0], int(scene.cameras.size[0, 0]))
    for axis, points, mask in zip(
        axes.flat, np.concatenate([poses.joints, poses.tips], 1)[:12], masks, strict=True
    ):  # fmt: skip
        axis.imshow(mask, cmap="gray_r", alpha=0.4)
        seen = np.stack(project(scene.cameras, points)[:2], -1)[0]
        for point, parent in enumerate(template.point_parents):
            if parent >= 0:
                axis.plot(*seen[[point, parent]].T, "-o", markersize=3)
        axis.set_axis_off()
    figure.tight_layout()
    figure.savefig(path, dpi=60)
    plt.close(figure)


def main() -> None:
    """Print a line for each template."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("templates", nargs="+", choices=BUILT_IN)
    parser.add_argument("--poses", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--dtw", action="store_true", help="match by DTW, as in the paper, not exactly")
    parser.add_argument("--picture", type=Path, help="folder for a picture of each template's poses")
    given = parser.parse_args()
    keep_compiled()
    for name in given.templates:
        skeleton = built_in(name)
        scene, settings = scene_of(skeleton, given.poses, given.seed), paper_settings(skeleton)
        if given.dtw:
            settings = replace(settings, matching=replace(settings.matching, matcher=DtwMatcher()))
        right, poses = right_labels(scene, settings), reconstruct(scene, settings)
        by_tip = ", ".join(
            f"{tip} {share:.0%}" for tip, share in zip(skeleton.template.tip_names, right.mean(0), strict=True)
        )
        median, most = (100 * error / skeleton.size for error in errors(poses, scene))
        print(f"{name}: {right.mean():.1%} of {right.size} labels right ({by_tip}); {int(poses.has_pose.sum())} poses, "
              f"joints off by {median:.1f} % of the size (95th percentile {most:.1f} %)")  # fmt: skip
        if given.picture is not None:
            given.picture.mkdir(parents=True, exist_ok=True)
            draw(poses, scene, given.picture / f"{name}.png")


if __name__ == "__main__":
    main()
