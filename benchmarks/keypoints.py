"""Silhouettes and keypoints together: joints refined by either alone and by both, against reference joints.

    python benchmarks/keypoints.py RECORDING KEYPOINTS --reference JOINTS.trc [--every 11]
    python benchmarks/keypoints.py SEQUENCE.npz --simulated                  keypoints made of the truth, with noise

The first reads a recording, keypoints of BODY_25B (a folder for each camera) and markers of Pose2Sim. Its reference is
triangulated from these very keypoints, so it tells how well a body of constant lengths follows the keypoints, and not
which of both is nearer to the person. The second has a truth of its own: joints and tips of a sequence file are
projected into its views, with noise of 20 mm that is the same in all views, noise of 20 mm in each view, and 5 % of
gross errors. It is a check of the method and not of a detector.

All start from the same poses, those of the search in the silhouettes, whose bone lengths are also those of the
keypoints alone. Prints the mean over the points of the median distance (mm).
"""

import argparse
from pathlib import Path

import jax
import numpy as np
from jaxtyping import Float

from jaxskel import (
    JOINT_NAMES,
    TIP_NAMES,
    Recording,
    RefinementProblem,
    Settings,
    keep_compiled,
    read_recording,
    refine_frames,
    refinement_problem,
)
from jaxskel.body import BODY_25B, KeypointSet, Pose, place_segments
from jaxskel.cameras import in_cameras, project
from jaxskel.io import read_keypoints, read_trc
from jaxskel.io.poses import Markers
from jaxskel.recording import rotation_to_z_up
from jaxskel.refinement.terms import keypoints_term

_POINTS = JOINT_NAMES + TIP_NAMES
SIMULATED = KeypointSet("joints and tips", _POINTS, tuple({name: 1.0} for name in _POINTS))
# Pose2Sim's names of two keypoints of BODY_25B.
_MARKERS = {"UpperNeck": "Neck", "HeadTop": "Head"}
_NOISE, _WRONG = 0.02, 0.05


def truth_of(keypoints: KeypointSet, reference: Markers, frames: np.ndarray) -> Float[np.ndarray, "frames points 3"]:
    """Markers at the places of keypoints, in a world with z up (m); NaN where there is none."""
    positions = reference.positions[np.searchsorted(reference.frame_index, frames + reference.frame_index[0])]
    turned = positions @ rotation_to_z_up(reference.up).T
    names = [_MARKERS.get(name, name) for name in keypoints.names]
    found = np.full((len(frames), len(names), 3), np.nan)
    for place, name in enumerate(names):
        if name in reference.names:
            found[:, place] = turned[:, reference.names.index(name)]
    return found


def simulated(recording: Recording, rng: np.random.Generator) -> Float[np.ndarray, "frames cams points 3"]:
    """The truth as a detector might see it: errors in the world, errors in each view, and gross ones."""
    assert recording.truth is not None
    assert recording.truth.tips is not None
    points = np.concatenate([recording.truth.joints, recording.truth.tips], 1).astype(np.float64)
    points += rng.normal(scale=_NOISE, size=points.shape)
    seen = []
    for frame in points:
        u, v, _ = project(recording.cameras, frame)
        away = in_cameras(recording.cameras, frame)[2]
        pixels = np.asarray(recording.cameras.K)[:, 0, 0, None] / away
        wrong = np.where(rng.random(u.shape) < _WRONG, 15.0, 1.0)
        off = rng.normal(scale=_NOISE, size=(*u.shape, 2)) * (pixels * wrong)[..., None]
        seen.append(np.concatenate([np.stack([u, v], -1) + off, np.ones((*u.shape, 1))], -1))
    return np.stack(seen)


def points_of(problem: RefinementProblem, keypoints: KeypointSet, pose: Pose) -> Float[np.ndarray, "frames points 3"]:
    """Places of the keypoints in some poses (m)."""
    joints, tips, origins = jax.vmap(lambda each: place_segments(problem.skeleton, each))(pose)
    return np.einsum("kp,fpa->fka", keypoints.shares, np.concatenate([joints, tips, origins[:, -4:]], 1))


def compare(
    recording: Recording,
    problem: RefinementProblem,
    keypoints: KeypointSet,
    seen: Float[np.ndarray, "frames cams points 3"],
    truth: Float[np.ndarray, "people points 3"],
    weights: list[float],
) -> None:
    """Refine by silhouettes, by keypoints, and by both; print a row for each."""
    refinement = Settings().refinement
    term = keypoints_term(recording.cameras, keypoints, recording.up)
    # One objective for all, so that it is compiled once.
    whole = refinement.objective_for(problem.body).plus(keypoints=term)
    observed = problem.observed.with_data(keypoints=seen[problem.frames])

    some = (keypoints.shares != 0).any(1) & np.isfinite(truth).all((0, 2))

    def row(name: str, pose: Pose, told: str) -> None:
        away = np.linalg.norm(points_of(problem, keypoints, pose) - truth, axis=-1)
        print(f"| {name} | {1e3 * np.median(away[:, some], axis=0).mean():.1f} mm | {told} |", flush=True)

    print(f"| refined by | {int(some.sum())} points, {len(truth)} frames | converged |")
    print("|---|---|---|")
    row("search in the silhouettes only", problem.initial, "-")
    for name, objective in {
        "silhouettes": whole.weighted(keypoints=0.0),
        "keypoints, weight 1": whole.weighted(contours=0.0, inside=0.0, keypoints=1.0),
        **{f"both, weight {weight:g}": whole.weighted(keypoints=weight) for weight in weights},
    }.items():
        found = refine_frames(
            objective, refinement.parametrisation, refinement.solver, problem.skeleton, problem.initial, observed
        )
        row(name, found.pose, f"{100 * float(found.converged.mean()):.0f} %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("keypoints", type=Path, nargs="?")
    parser.add_argument("--reference", type=Path, help="TRC file with markers of Pose2Sim")
    parser.add_argument("--simulated", action="store_true", help="make keypoints of the truth")
    parser.add_argument("--every", type=int, default=11, help="take one frame in so many")
    parser.add_argument("--weights", type=float, nargs="+", default=[0.1, 0.3, 1.0], help="of the keypoints, if both")
    arguments = parser.parse_args()
    keep_compiled()
    recording = read_recording(arguments.recording)[:: arguments.every]
    turn = rotation_to_z_up(recording.up).T
    if arguments.simulated:
        if recording.truth is None or recording.truth.tips is None:
            parser.error(f"{arguments.recording}: has no true joints and tips")
        seen, keypoints = simulated(recording, np.random.default_rng(0)), SIMULATED
        truth = np.concatenate([recording.truth.joints, recording.truth.tips], 1) @ turn
    elif arguments.keypoints is None or arguments.reference is None:
        parser.error("give KEYPOINTS and --reference, or --simulated")
    else:
        seen, keypoints = read_keypoints(arguments.keypoints, recording, BODY_25B), BODY_25B
        truth = truth_of(keypoints, read_trc(arguments.reference), recording.frame_index)
    problem = refinement_problem(recording)
    compare(recording, problem, keypoints, seen, truth[problem.frames], arguments.weights)


if __name__ == "__main__":
    main()
