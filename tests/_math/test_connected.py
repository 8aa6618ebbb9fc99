import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from support.partitions import same_partition

from jaxskel._math.components import connected


@settings(deadline=None)
@given(st.integers(1, 12).flatmap(lambda n: st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)))))
def test_pairs_connect_as_scipy_says(pairs):
    count = 1 + max((max(pair) for pair in pairs), default=0)
    one, other = np.array(pairs, int).reshape(-1, 2).T
    matrix = csr_array((np.ones(len(one)), (one, other)), shape=(count, count))
    expected = connected_components(matrix, directed=False)[1]
    labels = connected(one, other, count)
    assert same_partition(labels, expected)
    assert labels.max() == expected.max()
