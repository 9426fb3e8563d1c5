"""The parts of a proof: the loop in balls, polynomials over a range, counts, and crossings."""

from math import comb

import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from meaning.reading import machine_of
from support.drawn import random_network, random_tables

import wavesweep
from wavesweep.prove.ball_crossings import count_outside, crossings
from wavesweep.prove.ball_polynomials import BallFamily, Budget, FamilyPart
from wavesweep.prove.ticks import BallLoop, UndecidedError


def floats(matrix):
    return np.array([[float(entry.mid()) for entry in row] for row in matrix.tolist()])


@pytest.mark.parametrize("tables", [*map(random_tables, range(20, 26)), random_network(3, 8)])
def test_a_frame_has_the_eigenvalues_of_the_loop_of_the_documents(tables):
    spec = wavesweep.compile(tables).spec
    with ctx.workprec(128):
        found = np.linalg.eigvals(floats(BallLoop(spec.drawing, spec.values, "k").frame(arb(spec.values["numbers.k"]))[0]))
    expected = np.linalg.eigvals(machine_of(tables).monodromy())
    for one, other in ((found, expected), (expected, found)):
        assert all(np.abs(other - z).min() < 1e-9 for z in one[np.abs(one) > 1e-2])


@pytest.mark.slow
@pytest.mark.parametrize("number", ["k", "m0", "g"])
def test_polynomials_on_a_part_enclose_those_of_each_value(number):
    spec, budget = wavesweep.compile(random_tables(9)).spec, Budget(1e9)
    span = (0.5, 0.6)
    with ctx.workprec(192):
        family = BallFamily(BallLoop(spec.drawing, spec.values, number), span, budget)
        family.find_ones()
        for part in family.over_range():
            share = arb(3) / 8
            value = part.low + (part.high - part.low) * share
            pivot = family.loop.frame(value)[1] if family.exact else 1
            for table, plain in zip(part.polynomials, family.plain(value), strict=True):
                m = table.ncols() - 1
                weights = arb_mat([[_weight(m, j, share)] for j in range(m + 1)])
                enclosed = (table * weights).tolist()
                assert all(row[0].overlaps(c * pivot) for row, c in zip(enclosed, plain, strict=True))
                assert all(row[0].rad() < 1e-20 for row in enclosed)


def _weight(m, j, t):
    return comb(m, j) * t**j * (1 - t) ** (m - j)


@pytest.mark.parametrize(("roots", "outside"), [([0.5, -0.9], 0), ([1.1, 0.2, -3.0], 2), ([0.6 + 0.9j, 0.6 - 0.9j, 0.1], 2)])
def test_roots_outside_are_counted(roots, outside):
    assert count_outside([arb(float(c.real)) for c in np.poly(roots)[::-1]]) == outside


def test_a_root_on_the_circle_is_not_counted():
    with pytest.raises(UndecidedError):
        count_outside([arb(1), arb(0), arb(1)])


@pytest.mark.parametrize("degree", [2, 3])
def test_crossings_of_a_pair_and_of_real_roots(degree):
    """z^2 - 2 c z + k crosses at k = 1 with cos(theta) = c, and at z = 1 for k = 2c - 1; with a factor z - 1/2 as well."""
    c = 0.625
    rows = [[0.0, 3.0], [-2 * c, -2 * c], [1.0, 1.0]]  # of z^j, at k = 0 and 3
    if degree == 3:
        padded = np.vstack([rows, [[0.0, 0.0]]])
        rows = np.vstack([[[0.0, 0.0]], rows]) - padded / 2
    with ctx.workprec(128):
        part = FamilyPart(arb(0), arb(3), (arb_mat([[arb(float(x)) for x in row] for row in rows]),))
        found = sorted(crossings(part, Budget(1e8)), key=lambda each: each.value.mid())
    assert [float(each.value.mid()) for each in found] == pytest.approx([2 * c - 1, 1.0])
    assert [float(each.theta.cos().mid()) for each in found] == pytest.approx([1.0, c])
