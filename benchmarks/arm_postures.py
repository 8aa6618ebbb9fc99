"""How people hold their arms: makes the table of postures that the search prefers where silhouettes do not tell.

    python benchmarks/arm_postures.py SEQUENCE.npz ... -o jaxskel/refinement/terms/arm_postures.csv

Each sequence file must have known joints. Postures of both arms are thinned to some that are far apart, each of which
gets the share of the postures that are nearest to it; every file counts the same.

The package's table was made from recordings of the bodies p00 to p07 of a crowd and of ten clips of one body, all of
the CMU database. Clips that the other half of the crowd shows, too, were left out.
"""

import argparse
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jaxskel import read_recording
from jaxskel.refinement.terms import arm_directions

POSTURES = 256


def postures_of(path: Path) -> Float[np.ndarray, "postures 6"]:
    """Directions of the arms of one file.

    Raises:
        ValueError: The joints are not known.
    """
    truth = read_recording(path).truth
    if truth is None:
        raise ValueError(f"{path}: key 'joints': give sequence files with known joints")
    return np.asarray(arm_directions(truth.joints), np.float64).reshape(-1, 6)


def thinned(
    postures: Float[np.ndarray, "postures 6"], shares: Float[np.ndarray, " postures"], count: int
) -> tuple[Float[np.ndarray, "chosen 6"], Float[np.ndarray, " chosen"]]:
    """Means of the postures around some that are far apart, and their shares."""
    chosen = [0]
    apart = ((postures - postures[0]) ** 2).sum(-1)
    while len(chosen) < count:
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, ((postures - postures[chosen[-1]]) ** 2).sum(-1))
    nearest = ((postures[:, None] - postures[chosen][None]) ** 2).sum(-1).argmin(1)
    total = np.bincount(nearest, shares, minlength=count)
    means = np.stack([np.bincount(nearest, shares * axis, minlength=count) for axis in postures.T], 1)
    return means / total[:, None], total / total.sum()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    each = [postures_of(path) for path in arguments.sequences]
    shares = np.concatenate([np.full(len(postures), 1 / len(postures)) for postures in each])
    means, total = thinned(np.concatenate(each), shares, POSTURES)
    parts = ("upper front", "upper left", "upper up", "lower front", "lower left", "lower up")
    lines = [",".join(["share", *parts])]
    lines += [",".join([f"{share:.5f}", *(f"{x:.3f}" for x in row)]) for share, row in zip(total, means, strict=True)]
    arguments.output.write_text("\n".join(lines) + "\n")
    print(f"{arguments.output}: {POSTURES} postures of {len(shares)} arms of {len(each)} files")


if __name__ == "__main__":
    main()
