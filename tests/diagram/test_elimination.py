"""Elimination with exact zeros, and whether its zeros are exact."""

from fractions import Fraction

import numpy as np
import pytest

from wavesweep.diagram import blocks
from wavesweep.diagram.drawn import Drawn, Placed, shifts
from wavesweep.diagram.elimination import PRIME, exact_echelon, reduced_echelon, residue


def rows_of(A):
    return [{column: residue(value) for column, value in enumerate(row) if value} for row in np.asarray(A).tolist()]


@pytest.mark.parametrize("value", [0.0, 1.0, -0.1, 1e-300, 5e-324, 1.7e308, 2.0**-60])
def test_a_residue_is_that_of_the_exact_number(value):
    exact = Fraction(value)
    assert residue(value) == exact.numerator * pow(exact.denominator, -1, PRIME) % PRIME
    assert (residue(value) == 0) == (value == 0)


@pytest.mark.parametrize("seed", range(20))
def test_zeros_of_whole_numbers_are_exact_and_what_is_smaller_than_rounding_is_none(seed):
    """A row is a sum of others: its remainder vanishes. A change of one entry by its last bit stays, and rounding hides it."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    A = rng.integers(-9, 10, (n, n + 1)).astype(float) * 2.0 ** rng.integers(-20, 20)
    A[-1] = rng.integers(1, 4, n - 1) @ A[:-1]
    _, pivots = reduced_echelon(A)
    assert len(pivots) < n
    assert exact_echelon(A, rows_of(A))[-1]
    at = int(np.argmax(np.abs(A[-1])))
    A[-1, at] = np.nextafter(A[-1, at], np.inf)
    assert len(reduced_echelon(A)[1]) == len(pivots)
    assert not exact_echelon(A, rows_of(A))[-1]


def test_an_entry_that_is_zero_from_the_start_but_not_in_the_rows_is_seen():
    A = np.array([[1.0, -1.0], [0.0, 0.0]])
    assert exact_echelon(A, rows_of(A))[-1]
    assert not exact_echelon(A, [*rows_of(A)[:1], {0: residue(2.0**-70)}])[-1]


@pytest.mark.parametrize(("k", "exact"), [(45, False), (48, False), (None, True)])
def test_a_loop_that_is_built_in_python_has_a_drift_only_if_its_entries_cancel_exactly(k, exact):
    """A mode at 1 + 2^-k in a turned basis, which the gain does not reach, beside one at exactly 1."""
    turn = np.array([[1.0, 3.0], [0.5, 2.0]])
    back = np.linalg.inv(turn)
    E = turn @ np.diag([0.0 if k is None else 2.0**-k, -0.5]) @ back
    ports = (turn @ [[0.0], [1.0]]).tolist(), (np.array([[0.0, 1.0]]) @ back).tolist(), [[0.0]]
    block = blocks.ss("g", 1.0, (E + np.eye(2)).tolist(), *ports, ("u",), ("y",), discrete=True)
    (shift,), found = shifts(Drawn(1.0, (Placed(block, 1, 0),), {"g.u": {"g.y": -0.5}}))
    assert shift == pytest.approx({"g.x0": 1.0, "g.x1": 0.5})
    assert found == exact


def test_a_long_chain_of_equal_states_is_reduced_to_its_head():
    n = 400
    A = np.eye(n) - np.eye(n, k=-1)
    A[0, 0], A[7] = 0, 0
    reduced, pivots = reduced_echelon(A)
    assert len(pivots) == n - 2
    free = [column for column in range(n) if column not in pivots]
    for column, row in pivots.items():
        wanted = np.zeros(n)
        wanted[column] = 1
        wanted[free[0] if column < 7 else free[1]] = -1
        assert (reduced[row] == wanted).all()
