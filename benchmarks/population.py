"""How people differ: makes the tables of bone lengths and flesh that `calibrate_body` starts from.

    python benchmarks/population.py SEQUENCE.npz ... -o jaxskel/body/adults.csv

Each sequence file shows a different person, whose dimensions and joints are known. The position of the flesh of
`make_body` around these joints is found as `calibrate_body` does it. Means, principal components and residual
deviations of each quantity are written to a table of `jaxskel/body/`: adults.csv, children.csv.

The package's tables were made from 160 adults and 80 children of MakeHuman (`benchmarks/makehuman.py`), each in 16
frames of one clip of the CMU database: 01_01, 02_05, 05_02, 13_18 and 16_11 in turn, the clips that all settings were
chosen on.
"""

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from jaxskel import Skeleton, default_adult, read_recording, refinement_problem
from jaxskel._runtime.batching import filled, on_device
from jaxskel._runtime.cores import take_core
from jaxskel.body import (
    BAG_BALLS,
    BALL_NAMES,
    FLESH_FROM,
    FREE_BALLS,
    HAIR_BALLS,
    LENGTH_NAMES,
    QUANTITIES,
    Prior,
    Shape,
    lengths_of,
    measured_body,
    place_joints,
)
from jaxskel.body_calibration import bundle_adjust

AXES = 40
LEFT_OUT = ("fingertip", "fingers front", "fingers out", "palm ", "finger ", "hem ", *BAG_BALLS, *HAIR_BALLS)
"""Of hands only the length to the palm counts, because people open and close their hands."""
_STEPS = 25
# Wide priors for flesh (m) and for the direction of fingers (tangent of an angle); lengths and the middle are fixed.
_ANYWHERE, _ANY_WAY, _FIXED = 0.03, 5.0, 1e-5
# Frames in which a joint is farther than this from its known place (m) are left out.
_WRONG = 0.15


def measured(path: Path) -> Float[np.ndarray, " quantities"]:
    """The unknowns of `Shape` that stand for a person: lengths, and the flesh that outlines show around the joints.

    Flesh is given as shares of the stature.

    Raises:
        ValueError: The file lacks dimensions or joints.
    """
    recording = read_recording(path)
    if recording.skeleton is None or recording.truth is None:
        raise ValueError(f"{path}: keys 'rest_joints', 'joints': give sequence files with known dimensions and joints")
    template = default_adult(recording.skeleton.stature)
    prior = _known_lengths(recording.skeleton, template)
    skeleton = measured_body(template, prior.mean).skeleton
    problem = refinement_problem(eqx.tree_at(lambda r: r.skeleton, recording, skeleton))
    assert problem.truth is not None
    found = np.asarray(place_joints(problem.skeleton, problem.initial)[0])
    used = np.linalg.norm(found - problem.truth, axis=-1).max(1) < _WRONG
    initial, observed = jax.tree.map(np.asarray, (problem.initial, problem.observed.thinned(3)))
    start, joints, stack = filled(initial), filled(problem.truth), on_device(observed)
    vector = bundle_adjust(template, prior, prior.mean, start, stack, used, _STEPS, 0.0, joints).shape.vector
    return np.concatenate([vector[:FLESH_FROM], vector[FLESH_FROM:] / template.height])


def _known_lengths(skeleton: Skeleton, template: Skeleton) -> Prior:
    """A prior with fixed lengths and nearly free flesh."""
    lengths = np.log(lengths_of(skeleton) / lengths_of(template))
    deviations = np.full(len(QUANTITIES), _ANYWHERE)
    for place, quantity in enumerate(QUANTITIES):
        if quantity.startswith("fingers"):
            deviations[place] = _ANY_WAY
        elif (
            quantity in LENGTH_NAMES
            or (quantity.endswith(" out") and quantity.split()[0] in BALL_NAMES)
            or quantity.split()[0] in BAG_BALLS + HAIR_BALLS
        ):
            deviations[place] = _FIXED
    return Prior(Shape(lengths, np.zeros(2), np.zeros((len(FREE_BALLS), 4))), np.diag(deviations**-2.0))


def table(vectors: Float[np.ndarray, "bodies quantities"]) -> str:
    """Means, principal components and residual deviations, a line for each quantity."""
    varied = vectors.std(0) > 1e-9
    rows = [i for i, name in enumerate(QUANTITIES) if varied[i] and not name.startswith(LEFT_OUT)]
    chosen = vectors[:, rows]
    spread = chosen.std(0, ddof=1)
    # Principal components, each quantity in its own unit.
    _, sizes, axes = np.linalg.svd((chosen - chosen.mean(0)) / spread, full_matrices=False)
    axes = (sizes[:AXES, None] / np.sqrt(len(chosen) - 1) * axes[:AXES]).T * spread[:, None]
    rest = np.sqrt(np.maximum(spread**2 - (axes**2).sum(1), 0))
    lines = [",".join(["quantity", "mean", "rest", *(f"axis {number + 1}" for number in range(AXES))])]
    for row, mean, left, own in zip(rows, chosen.mean(0), rest, axes, strict=True):
        lines.append(",".join([QUANTITIES[row], *(f"{value:.5f}" for value in (mean, left, *own))]))
    return "\n".join(lines) + "\n"


def _begin(cores: Any) -> None:
    take_core(cores.get())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    vectors = []
    # Each process has one core, where several threads of NumPy would only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    processes, context = os.cpu_count() or 1, get_context("spawn")
    cores = context.Queue()
    for core in range(processes):
        cores.put(core)
    with ProcessPoolExecutor(processes, context, _begin, (cores,)) as pool:
        for path, vector in zip(arguments.sequences, pool.map(measured, arguments.sequences), strict=True):
            vectors.append(vector)
            print(f"{path}: {len(vectors)} of {len(arguments.sequences)}", flush=True)
    arguments.output.write_text(table(np.array(vectors)))
    print(f"{arguments.output}: {len(vectors)} people")


if __name__ == "__main__":
    main()
