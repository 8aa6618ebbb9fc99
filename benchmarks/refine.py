"""Times the refinement alone on one sequence file: a repeated solve, other weights, a custom term, a whole sequence.

    taskset -c 0 python benchmarks/refine.py SEQUENCE.npz [--frames 300] [--repeat 5]

For the paper's objective and the default one, prints milliseconds per frame, medians over the repetitions. First, the
first frames of the file are refined one by one, again from their results, with new weights and a new custom term. Then
all frames are refined jointly, coupled by `Smoothness`, which requires consecutive frames. Pin the process to one core,
as above, to measure a single core.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxskel import (
    RefinementProblem,
    Settings,
    keep_compiled,
    paper_settings,
    read_recording,
    refine_frames,
    refine_sequence,
    refinement_problem,
)
from jaxskel.refinement import Refined
from jaxskel.refinement.solvers import default_solver, sequence_solver
from jaxskel.refinement.terms import Smoothness, from_function

ALONE = 64
# Poses refined before are near their goals, so two look-ups of correspondences suffice.
_ROUNDS = 2
TRACES = []


def reach(body, observed, hand, target):
    """A custom term that attracts a hand to a point."""
    count()
    return (body.joints[5] * hand + body.joints[8] * (1 - hand)) - target


def count() -> None:
    TRACES.append(1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--preset", choices=("paper", "default"), help="only one of the two")
    arguments = parser.parse_args()
    keep_compiled()
    recording = read_recording(arguments.sequence)[: arguments.frames]
    print("| objective | solve | frames | ms a frame | traced again | converged | median error |")
    print("|---|---|---|---|---|---|---|")
    presets = {"paper": paper_settings(), "default": Settings()}
    for name in presets if arguments.preset is None else [arguments.preset]:
        settings = presets[name]
        problem = refinement_problem(recording, settings)
        alone(name, problem, settings, arguments.repeat)
        together(name, problem, settings, recording.fps, arguments.repeat)


def alone(name: str, problem: RefinementProblem, settings: Settings, repeat: int) -> None:
    """Single frames: first from the start poses, then again from the results."""
    count = min(ALONE, len(problem.frames))
    initial, observed = jax.tree.map(lambda a: a[:count], (problem.initial, problem.observed))
    objective = settings.refinement.objective_for(problem.body).plus(
        reach=from_function(reach, 1.0, np.zeros(3), weight=0.01)
    )
    solver = default_solver()

    def solved(objective, initial) -> Refined:
        return refine_frames(
            objective, settings.refinement.parametrisation, solver, problem.skeleton, initial, observed,
            _ROUNDS, settings.refinement.max_steps,
        )  # fmt: skip

    first = solved(objective, initial)
    traced, rng = len(TRACES), np.random.default_rng(0)
    heaviest = next(iter(objective.terms))
    weight = float(objective.terms[heaviest].weight)

    def again() -> Refined:
        term = from_function(reach, float(rng.integers(2)), rng.normal(size=3), weight=rng.uniform(0.005, 0.02))
        return solved(objective.plus(reach=term).weighted(**{heaviest: weight * rng.uniform(0.8, 1.25)}), first.pose)

    report(name, f"again, {_ROUNDS} rounds", again, count, repeat, problem, traced)


def together(name: str, problem: RefinementProblem, settings: Settings, fps: float, repeat: int) -> None:
    """All frames at once."""
    objective = settings.refinement.objective_for(problem.body).plus(smooth=Smoothness(fps=fps, weight=0.02))
    solver = sequence_solver()

    def solved() -> Refined:
        return refine_sequence(
            objective, settings.refinement.parametrisation, solver, problem.skeleton, problem.initial, problem.observed,
            settings.refinement.rounds,
        )  # fmt: skip

    solved()
    report(name, "jointly", solved, len(problem.frames), repeat, problem, len(TRACES))


def report(
    name: str, solve: str, work: Callable[[], Refined], count: int, repeat: int, problem: RefinementProblem, traced: int
) -> None:
    """Time some work and print a row."""
    times, result = [], None
    for _ in range(repeat):
        start = time.perf_counter()
        result = jax.block_until_ready(work())
        times.append(1e3 * (time.perf_counter() - start) / count)
    assert result is not None
    error = "-"
    if problem.truth is not None:
        apart = jnp.linalg.norm(result.joints - problem.truth[:count], axis=-1)
        error = f"{1e3 * float(jnp.median(apart)):.1f} mm"
    share = 100 * float(result.converged.mean())
    print(
        f"| {name} | {solve} | {count} | {np.median(times):.2f} | {len(TRACES) - traced} | {share:.0f} % | {error} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
