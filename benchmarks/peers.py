"""Times every stage and the whole pipeline against other libraries, and compares with bounds and a stored run.

    python benchmarks/peers.py SEQUENCE.npz [--film FILM.npz] [--json FILE] [--baseline FILE] [--stages carve graph ...]

Install peers by `python -m pip install ".[peers]"`; missing ones are reported and left out. All stages, ours and
theirs, are measured on one core. `whole` starts processes of its own, each on one core, so give it two cores or more.
Tracking needs the consecutive frames of a film: without `--film` it is measured on the sequence, with no bound. Exit
code 1 if `--baseline` shows a regression.
"""

import argparse
import os
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path

import jax
import numpy as np
from _measure import HEADER, Contender, Report, Row, regressions
from _peers_hull import (
    kimimaro_skeletons,
    naive_jax,
    numba_early_exit,
    numpy_gather,
    open3d_carving,
    simple_scooping,
    skimage_thinning,
)
from _peers_pose import dtaidistance_matrices, scipy_refinement
from _presets import PRESETS
from _whole import start_up, throughput

from jaxskel import paper_settings, prepare, read_recording, unpack_silhouettes
from jaxskel._runtime.batching import single_precision, take
from jaxskel._runtime.cores import keep_to
from jaxskel.graph import skeletal_graphs
from jaxskel.hull import VisualHulls, carve, see_people
from jaxskel.matching import cost_matrices, describe_ends, labelled_limbs, template_ends
from jaxskel.pipeline._evidence import observed_graph
from jaxskel.pipeline._reconstruct import BATCH
from jaxskel.refinement import refine_frames
from jaxskel.refinement.solvers import NormalEquationsLM
from jaxskel.search import initial_poses

STAGES = ("carve", "graph", "dtw", "refine", "whole")
_FEW = 2
"""Number of frames that a slow peer processes in each turn."""
_BOUNDS = {"paper": 200.0, "default": 15.0, "tracked": 40.0}  # frames per second and core


class Bench:
    """A batch of frames, carved and labelled by the paper's method, for the stages to start from."""

    def __init__(self, path: Path, film: Path | None, report: Report, repeat: int):
        self.path, self.film, self.report, self.repeat = path, film, report, repeat
        self.recording = read_recording(path)
        self.settings = paper_settings()
        self.prepared = prepare(self.recording, self.settings)
        self.cameras = self.prepared.cameras
        self.silhouettes = np.ascontiguousarray(self.recording.silhouettes[:BATCH])
        seen = see_people(
            self.silhouettes, self.prepared.cameras, self.prepared.table, self.prepared.edge, self.prepared.max_misses
        )
        assert seen.hulls is not None, f"{path}: no hull in the first {BATCH} frames"
        self.hulls = seen.hulls
        self.roots = self.settings.graph.root_finder.roots(self.hulls, self.prepared.skeleton)
        self.graphs = skeletal_graphs(self.hulls, self.roots, self.settings.graph.min_branch)

    def carve(self) -> None:
        """Packed masks to hulls; the others get the masks unpacked."""
        table = self.prepared.table
        assert table is not None
        masks = unpack_silhouettes(self.silhouettes, table.size[1])
        few = masks[:_FEW]
        contenders = [Contender("jaxskel", lambda: carve(self.silhouettes, table), len(masks))]
        self._peer(contenders, "NumPy gather", lambda: numpy_gather(few, table), _FEW, 20)
        self._peer(contenders, "naive JAX, vmap 8", lambda: naive_jax(masks, table), len(masks), 6)
        self._peer(contenders, "numba, early exit", lambda: numba_early_exit(few, table), _FEW, 2.5)
        self._peer(contenders, "Open3D", lambda: open3d_carving(few[:1], table, self.cameras), 1, 100)
        ours, *others = self.report.race("carve", contenders, self.repeat)
        dense = np.stack([ours.dense(f) for f in range(len(masks))]).reshape(len(masks), -1)
        for contender, other in zip(contenders[1:], others, strict=True):
            own = dense[: len(other)]
            overlap = float((own & other).sum() / (own | other).sum())
            exact = None if contender.name == "Open3D" else 1.0
            self.report.add(Row("carve", f"{contender.name}: overlap of the hulls", overlap, "IoU", required=exact))

    def graph(self) -> None:
        """Hulls to pruned graphs. Thinning gives no graph, and none of the other peers prunes."""
        few = self.hulls[np.arange(_FEW)]
        contenders = [Contender("jaxskel", lambda: skeletal_graphs(self.hulls, self.roots), len(self.hulls))]
        self._peer(contenders, "simple scooping", lambda: simple_scooping(few, self.roots[:_FEW]), _FEW, 12)
        self._peer(contenders, "skimage skeletonize", lambda: skimage_thinning(few), _FEW, 7)
        self._peer(contenders, "kimimaro", lambda: kimimaro_skeletons(few), _FEW, 20)
        self.report.race("graph", contenders, self.repeat)
        own = np.flatnonzero(self.hulls.inside[0])
        one = VisualHulls(self.hulls.voxels[own], np.ones((1, len(own)), bool), self.hulls.grid)
        root = np.searchsorted(own, self.roots[:1])
        contenders = [Contender("jaxskel", lambda: skeletal_graphs(one, root), 1)]
        self._peer(contenders, "skimage skeletonize", lambda: skimage_thinning(one), 1, 3)
        self.report.race("graph, one frame", contenders, self.repeat)

    def dtw(self) -> None:
        """Costs of matching end nodes with the template's."""
        ends, template = describe_ends(self.graphs), template_ends(self.prepared.skeleton)
        ours = lambda: np.asarray(cost_matrices(ends.distances, ends.count, template))  # noqa: E731
        contenders = [Contender("jaxskel", ours, len(ends.count))]
        self._peer(contenders, "dtaidistance, C", lambda: dtaidistance_matrices(ends, template), len(ends.count), 2)
        self.report.race("dtw", contenders, self.repeat)
        if len(contenders) > 1:
            with jax.enable_x64(True):
                doubles = ends.distances.astype(float), ends.count, template.astype(float)
                exact = np.asarray(cost_matrices(*doubles))
            theirs = contenders[1].run()
            error = max(float(np.abs(exact[f, : len(m)] - m).max()) for f, m in enumerate(theirs))
            row = Row("dtw", "largest difference in float64", error, "m", required=1e-12, largest=True)
            self.report.add(row)

    def refine(self) -> None:
        """The paper's objective with exact bones, a batch of 64; SciPy's costs beside ours."""
        s, matching = self.settings.refinement, self.settings.matching
        limbs, facing, _ = labelled_limbs(self.graphs, self.prepared.skeleton, matching.matcher, matching.descriptor)
        frames = np.resize(np.arange(len(limbs.paths)), 64)
        skeleton, objective = single_precision((self.prepared.skeleton, s.objective_for(self.prepared.body)))
        start = initial_poses(limbs, facing, skeleton)
        initial, observed = single_precision(take((start, observed_graph(limbs, {})), frames))
        ours = partial(
            refine_frames, objective, s.parametrisation, s.solver, skeleton, initial, observed, s.rounds, s.max_steps
        )
        first, seen = take(initial, np.arange(8)), take(observed, np.arange(8))
        contenders = [Contender("jaxskel", lambda: jax.block_until_ready(ours()), 64)]
        assert isinstance(s.solver, NormalEquationsLM)
        rounds, ftol = s.rounds, s.solver.ftol
        scipy = partial(scipy_refinement, objective, s.parametrisation, skeleton, first, seen, rounds, ftol)
        self._peer(contenders, "SciPy LM, jitted", scipy, 8, 4)
        refined, theirs = self.report.race("refine", contenders, self.repeat)
        costs = np.asarray(sum(refined.costs.values()))[:8]
        share = float(np.median(costs) / np.median(theirs))
        self.report.add(Row("refine", "median cost, of SciPy's", share, "", required=1.05, largest=True))
        # Bone lengths, which must be the template's, computed in float64 from the joints.
        joints, parents = np.asarray(refined.joints, float), np.array([0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 0, 12, 13])
        lengths = np.linalg.norm(joints[:, 1:] - joints[:, parents], axis=-1)
        error = 1e3 * float(np.abs(lengths - self.prepared.skeleton.bone_lengths).max())
        self.report.add(Row("refine", "bone lengths", error, "mm", required=1e-3, largest=True))

    def whole(self) -> None:
        """Masks in memory to poses, on one core and on two; memory, accuracy, start-up."""
        for preset in PRESETS:
            path, bound = self.path, _BOUNDS[preset]
            if preset == "tracked":
                path, bound = (self.film, bound) if self.film else (path, None)
            throughput(path, preset, 1, 0.1)  # compiling takes memory, which is not released
            one = throughput(path, preset, 1, 10.0)
            add = self.report.add
            add(Row(f"whole, {preset}", "one core", one.frames_per_second, "frames/s", required=bound))
            add(Row(f"whole, {preset}", "memory", one.megabytes, "MB", required=1536, largest=True))
            add(Row(f"whole, {preset}", "median error", one.median_mm, "mm"))
            if preset == "paper" and len(os.sched_getaffinity(0)) > 1:
                two = throughput(self.path, preset, 2, 10.0).frames_per_second / one.frames_per_second
                add(Row(f"whole, {preset}", "two processes over one", two, "", required=1.8))
        seconds = start_up(self.path, ("--preset", "paper"))
        self.report.add(Row("start-up", "jaxskel run --preset paper", seconds, "s", required=2.5, largest=True))

    def _peer(
        self, contenders: list[Contender], name: str, make: Callable[[], Callable], frames: int, required: float
    ) -> None:
        try:
            contenders.append(Contender(name, make(), frames, required))
        except ImportError as error:
            print(f"left out: {name} ({error}); python -m pip install '.[peers]' brings it", file=sys.stderr)


@contextmanager
def _one_core() -> Iterator[None]:
    """Restrict all threads of this process, including JAX's, to one core."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    keep_to({min(cores)})
    try:
        yield
    finally:
        keep_to(cores)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--film", type=Path, help="a sequence of consecutive frames, to be tracked")
    parser.add_argument("--repeat", type=int, default=7, help="turns of each contender")
    parser.add_argument("--stages", nargs="+", choices=STAGES, default=list(STAGES))
    parser.add_argument("--json", type=Path, help="write all rows there")
    parser.add_argument("--baseline", type=Path, help="compare with the rows of an earlier run")
    arguments = parser.parse_args()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    report = Report(f"{platform.machine()}, {cores} core(s), {jax.default_backend()}", arguments.sequence.stem)
    print(f"{report.sequence} on {report.machine}, batch {BATCH}\n\n{HEADER}")
    bench = Bench(arguments.sequence, arguments.film, report, arguments.repeat)
    for stage in arguments.stages:
        with nullcontext() if stage == "whole" else _one_core():
            getattr(bench, stage)()
    if arguments.json:
        report.write(arguments.json)
        print(f"\nwritten: {arguments.json}")
    worse = regressions(report, arguments.baseline) if arguments.baseline else []
    for line in worse:
        print(f"worse than before: {line}", file=sys.stderr)
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
