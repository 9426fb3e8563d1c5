"""Forms of cells: how many eigenvalues are outside the unit circle all over each."""

import numpy as np
import pytest

from wavesweep.engine._switched.inertia import inertia_of_cells
from wavesweep.engine._switched.norm_check import outside_each
from wavesweep.engine.sets import Polynomials


def _linear(A, moves, rest=0.0):
    """Matrices `A + moves s` of cells `(cells, n, n)`, of one number and order 2."""
    terms = np.stack([A, moves, np.zeros_like(A)])
    return Polynomials(terms, np.full(A.shape, rest), 1, 2)


@pytest.mark.parametrize("n", [2, 5])
def test_what_forms_prove_of_cells_is_what_eigenvalues_are_at_every_place(n):
    rng = np.random.default_rng(n)
    A = rng.normal(size=(300, n, n)) / np.sqrt(n)
    moves = rng.normal(size=A.shape) * 10 ** rng.uniform(-3, -0.5, (300, 1, 1))
    found = inertia_of_cells(_linear(A, moves)).outside
    assert {*range(-1, 3)} <= {*found.tolist()}
    for s in np.linspace(-1, 1, 21):
        outside = (np.abs(np.linalg.eigvals(A + s * moves)) > 1).sum(-1)
        assert (outside == found)[found >= 0].all()


def test_a_form_that_is_wrong_or_a_matrix_that_is_not_known_proves_nothing():
    A = np.array([[[0.5, 0.2], [0.0, 1.5]]])
    still = np.zeros_like(A)
    assert inertia_of_cells(_linear(A, still)).outside.tolist() == [1]
    assert inertia_of_cells(_linear(A, still, 0.2)).outside.tolist() == [-1]
    form = np.zeros((3, 1, 2, 2))
    form[0] = np.diag([1.0, 1.0])
    forms = Polynomials(form, still, 1, 2)
    assert outside_each(forms, _linear(A, still))[0].tolist() == [-1]
    # an eigenvalue that crosses the circle within the cell
    assert inertia_of_cells(_linear(A, np.diag([0.0, 0.6])[None])).outside.tolist() == [-1]
