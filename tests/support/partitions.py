import numpy as np


def same_partition(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two labellings define the same partition."""
    pairs = np.unique(np.stack([one, other]), axis=1)
    return len(np.unique(one)) == len(np.unique(other)) == pairs.shape[1]
