"""Products of matrices of long delays, by the entries that are not zero."""

import numpy as np
import pytest

from wavesweep.engine._loops.block import SPARSE_ROWS
from wavesweep.engine._monodromy.batches import product, sparse


def chain(n, kind=float):
    """A delay of n states that follow each other, and a dense row."""
    A = np.diag(np.full(n - 1, 1.0), -1).astype(kind) - np.eye(n)
    A[0] = np.linspace(-1, 1, n) * (1 if kind is float else 1 + 2j)
    return A


@pytest.mark.parametrize("kind", [float, complex])
def test_products_of_sparse_matrices_are_those_of_dense_ones(kind):
    n = SPARSE_ROWS + 7
    A, B = chain(n, kind), np.sin(np.arange(n * n)).reshape(n, n)
    assert sparse(A) is not None
    assert sparse(B) is None
    for first, second in ((A, B), (B, A), (A, A), (B, B)):
        np.testing.assert_allclose(product(first, second), first @ second, rtol=1e-13, atol=1e-13)


def test_what_is_done_with_a_matrix_does_not_depend_on_its_batch():
    n = SPARSE_ROWS
    dense = np.cos(np.arange(n * n)).reshape(n, n)
    some = np.stack([chain(n), dense, 2 * chain(n)])
    for other in (chain(n), dense, np.stack([dense, chain(n), dense])):
        for one, another in ((some, other), (other, some)):
            whole = product(one, another)
            pairs = (np.broadcast_to(part, whole.shape) for part in (one, another))
            assert all((found == product(a, b)).all() for found, a, b in zip(whole, *pairs, strict=True))
