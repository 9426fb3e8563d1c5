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


def _product(pieces, s):
    A = np.eye(pieces.rest.shape[-1])
    for terms in np.moveaxis(pieces.terms, 1, 0):
        A = (terms[0] + s * terms[1]) @ A
    return A


def test_forms_of_pieces_prove_what_the_eigenvalues_of_their_product_are():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(240, 3, 3)) * 0.6
    moves = rng.normal(size=A.shape) * np.repeat(10 ** rng.uniform(-3, -0.5, (80, 1, 1)), 3, 0)
    both = _linear(A, moves)
    found = inertia_of_cells(both, 3).outside
    assert {*range(-1, 2)} <= {*found.tolist()}
    assert (found >= 0).mean() > 0.6
    for s in np.linspace(-1, 1, 11):
        for cell in np.flatnonzero(found >= 0).tolist():
            product = _product(both.of(slice(3 * cell, 3 * cell + 3)), s)
            assert (np.abs(np.linalg.eigvals(product)) > 1).sum() == found[cell]


def test_a_mode_far_outside_is_proved_in_pieces_where_their_product_is_not():
    basis = np.array([[1.0, 0.3], [0.2, 1.0]])
    one = basis @ np.diag([300.0, 0.9]) @ np.linalg.inv(basis)
    pieces = _linear(np.array([one] * 4), 0.01 * np.array([[[0.0, 20.0], [20.0, 0.0]]] * 4))
    whole = Polynomials.constant(np.eye(2)[None], 1, 2)
    for piece in range(4):
        whole = pieces.of([piece]) @ whole
    assert inertia_of_cells(pieces, 4).outside.tolist() == [1]
    pieces.rest[2] = 0.5  # of one that is not known
    assert inertia_of_cells(pieces, 4).outside.tolist() == [-1]
    assert inertia_of_cells(whole).outside.tolist() == [-1]
