"""Figures of the stages of one frame, like the paper's Figures 1 and 2: hull, graph, labels, skeleton."""

from pathlib import Path

import equinox as eqx
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .._runtime.picture_files import write_figure
from ..body import SkeletonTemplate
from ..graph import SkeletalGraph
from ..hull import VisualHulls
from ..matching import Limbs
from ..pipeline import Prepared, Settings, observe_batch, reconstruct_batch
from ..poses import Poses
from ..recording import Recording, unpack_silhouettes
from ._overlays import draw_silhouette, tile
from ._skeleton_style import MIDDLE, colours_of, drawn_joint_bones, node_labels

# Ten degrees off the front show depth; from 25 on the other side, the shanks of the demo hid each other.
_ASIDE = -10.0


class Stages(eqx.Module):
    """Results of each stage for one frame, in their own world with z up (m)."""

    hull: VisualHulls
    graph: SkeletalGraph
    limbs: Limbs
    joints: np.ndarray
    template: SkeletonTemplate = eqx.field(static=True)


def stages_of(recording: Recording, prepared: Prepared, settings: Settings, frame: int) -> Stages | None:
    """Run all stages on one frame and keep their results; None if there is no person."""
    alone = recording[frame : frame + 1]
    found = observe_batch(alone, prepared, settings, outlines=False)
    if found.labelled is None:
        return None
    assert found.seen.hulls is not None
    poses, _ = reconstruct_batch(alone, prepared, settings)
    return Stages(
        found.seen.hulls, found.labelled.graphs[0], found.labelled.limbs,
        prepared.scale * poses.joints[0] @ prepared.to_z_up.T, poses.template,
    )  # fmt: skip


def telling_frame(poses: Poses) -> int:
    """The frame whose pose has the hands, or what else may touch the trunk, farthest from it: every limb shows.

    Raises:
        ValueError: No frame has a pose.
    """
    if not poses.has_pose.any():
        raise ValueError("no frame has a pose: there is none to show")
    template = poses.template
    middle = poses.joints[:, list(template.inner)].mean(1)
    # Tips that do not describe the trunk are those that touch it: of a human, those of the hands.
    hands = set(range(len(template.tip_names))) - set(template.described_by) or range(len(template.tip_names))
    ends = poses.joints[:, [template.tip_parents[tip] for tip in hands]]
    nearer = np.linalg.norm(ends - middle[:, None], axis=-1).min(1)
    return int(np.argmax(np.where(poses.has_pose, nearer * poses.confidence.min(1), -1.0)))


def plot_stages(recording: Recording, prepared: Prepared, settings: Settings, frame: int, path: str | Path) -> None:
    """Draw silhouettes, hull, skeletal graph, labelled end nodes and skeleton of one frame side by side."""
    stages = stages_of(recording, prepared, settings, frame)
    if stages is None:
        return
    figure = Figure(figsize=(16, 4.2))
    FigureCanvasAgg(figure)
    flat = figure.add_axes((0.0, 0.05, 0.19, 0.79))
    masks = unpack_silhouettes(recording.silhouettes[frame], 8 * recording.silhouettes.shape[3])
    views = [draw_silhouette(_cropped(mask)) for mask in masks[:8] if mask.any()]
    flat.imshow(tile(views, [""] * len(views), columns=2, width=200)[..., ::-1])
    flat.set_axis_off()
    flat.set_title("silhouettes")
    points = stages.hull.centres[stages.hull.inside[0]]
    azimuth = _azimuth_before(stages.joints, stages.template)
    low, high = points.min(0), points.max(0)
    for i, title in enumerate(("visual hull", "skeletal graph", "labelled nodes", "skeleton")):
        axes = figure.add_axes((0.2 + 0.2 * i, 0.0, 0.2, 0.92), projection="3d")
        axes.set_title(title)
        axes.set_axis_off()
        axes.patch.set_visible(False)  # it would hide labels that reach out of the panel on the left
        axes.view_init(elev=8, azim=azimuth)  # pyright: ignore[reportAttributeAccessIssue]
        shown = points if i == 0 else points[::5]
        shade = 0.35 + 0.5 * (shown[:, 1] - low[1]) / (high[1] - low[1]) if i == 0 else np.full(len(shown), 0.85)
        axes.computed_zorder = False  # pyright: ignore[reportAttributeAccessIssue]
        size = 3 if i == 0 else 0.5
        axes.scatter(*shown.T, c=shade, cmap="gray", vmin=0, vmax=1, s=size, depthshade=False, zorder=1)
        _draw(axes, i, stages)
        axes.set_box_aspect(high - low, zoom=1.5)  # pyright: ignore[reportArgumentType, reportCallIssue]
    write_figure(path, figure, dpi=110)


def _azimuth_before(joints: np.ndarray, template: SkeletonTemplate) -> float:
    """Azimuth of a view from the front, slightly to the side (degrees); a default without a pose, or without sides."""
    lefts, rights = template.limb_pairs.T
    if not np.isfinite(joints).all() or not lefts.size:
        return -60.0
    # From right to left hip and shoulder of a human.
    left = (joints[lefts] - joints[rights]).sum(0)
    front = np.cross(left, [0.0, 0.0, 1.0])
    return float(np.degrees(np.arctan2(front[1], front[0]))) + _ASIDE


def _cropped(mask: np.ndarray) -> np.ndarray:
    """The part of a mask in a square window around the person."""
    rows, columns = np.nonzero(mask)
    half = int(0.55 * max(np.ptp(rows), np.ptp(columns))) + 4
    v, u = int(rows.min() + rows.max()) // 2 + half, int(columns.min() + columns.max()) // 2 + half
    return np.pad(mask, half)[v - half : v + half, u - half : u + half]


def _draw(axes, stage: int, stages: Stages) -> None:
    graph = stages.graph
    if stage in (1, 2):
        for node in range(1, len(graph)):
            axes.plot(*graph.positions[[node, graph.parents[node]]].T, color="#333333", lw=1, zorder=2)
    if stage == 1:
        axes.scatter(*graph.positions[graph.end_nodes].T, color="#e08a00", s=14, depthshade=False, zorder=3)
    if stage == 2:
        nodes = np.concatenate([stages.limbs.ends[0], stages.limbs.inner[0]])
        tips = colours_of(stages.template)[-len(stages.template.tip_names) :]
        colours = np.concatenate([tips, np.tile(np.array(MIDDLE, np.uint8), (len(nodes) - len(tips), 1))]) / 255
        for label, node, colour in zip(node_labels(stages.template), nodes, colours, strict=True):
            axes.scatter(*node, color=colour, s=30, depthshade=False, zorder=3)
            axes.text(*node, f" {label}", fontsize=8, zorder=4)
    if stage == 3 and np.isfinite(stages.joints).all():
        colours = colours_of(stages.template) / 255
        for joint, parent in drawn_joint_bones(stages.template):
            axes.plot(*stages.joints[[joint, parent]].T, color=colours[joint], lw=3, zorder=2)
        axes.scatter(*stages.joints.T, color="black", s=10, depthshade=False, zorder=3)
