"""Matrices of polynomials with bounds: sums and products enclose those of all their members, and no more than rounding adds."""

import random
from fractions import Fraction
from itertools import product
from math import prod

import numpy as np
import pytest

from wavesweep.checker import form
from wavesweep.checker.balls import ONE, Cell

BITS = 100, 190, 193  # of entries: where rounding is all, and where it is nothing


def array(rows) -> np.ndarray:
    return np.array(rows, dtype=object)


def drawn(draw: random.Random, width: int, shape: tuple[int, int]) -> form.Matrix:
    bits = draw.choice(BITS)
    powers = [m for m in product(range(3), repeat=width) if sum(m) <= 2 and (not sum(m) or draw.random() < 0.8)]
    error = draw.choice((0, 1 << bits // 2, 1 << (bits - 9)))
    entries = np.vectorize(lambda size: draw.randint(-size, size), otypes=[object])
    parts = {m: entries(np.full(shape, 1 << bits, object)).tolist() for m in powers}
    return form.Matrix(parts, abs(entries(np.full(shape, error, object))).tolist())


def member(matrix: form.Matrix, s, signs=0) -> np.ndarray:
    """A matrix that it encloses: at a point, with errors of some signs."""
    parts = [
        prod((x**power for x, power in zip(s, m, strict=True)), start=Fraction(1)) * array(part)
        for m, part in matrix.parts.items()
    ]
    return sum(parts) + signs * array(matrix.error)


@pytest.mark.parametrize("width", range(3))
def test_matrices_enclose_those_of_their_members(width):
    draw = random.Random(width)  # noqa: S311
    for _ in range(40):
        A, B, C = (drawn(draw, width, shape) for shape in ((3, 2), (2, 3), (3, 2)))
        s = [Fraction(draw.choice((-1, 1, draw.uniform(-1, 1)))) for _ in range(width)]
        by = Fraction(draw.randint(1, 99), draw.randint(1, 99))
        a, b, c = (member(each, s, array([[draw.choice((-1, 1)) for _ in row] for row in each.error])) for each in (A, B, C))
        e, f, g = (array(each.error) for each in (A, B, C))
        size, other = array(A.size) + Fraction(0), array(B.size) + f + Fraction(0)
        high = f + sum(abs(array(part)) for m, part in B.parts.items() if sum(m) > 1)
        for found, exact, bound, rounded in (
            (form.multiplied(A, B), a @ b / ONE, (size @ f + e @ other) / ONE, len(A.parts) * len(B.parts) + 2),
            (form.minus(A, C), a - c, e + g, 0),
            (form.divided(A, by), a / by, e / by, len(A.parts) + 1),
            (form.turned(A), a.T, e.T, 0),
            (form._cut(B, 1), b, high, 0),
        ):
            assert (abs(exact - member(found, s)) <= array(found.error)).all()
            assert (array(found.error) <= bound + rounded).all()


@pytest.mark.parametrize("width", range(1, 5))
@pytest.mark.parametrize("power", [1, 2])
def test_a_matrix_is_positive_where_all_of_its_members_are(width, power):
    """1 - sum of c_k s_k^p is above 0 on [-1, 1] where the sum of c is below 1."""
    for share, radius, expected in ((0.49, 0, True), (0.49, 0.5, True), (0.49, 0.52, False), (1.01, 0, False)):
        size = int(share * ONE / width)
        parts = {tuple(power * int(k == side) for k in range(width)): [[-size, 0], [0, size // 3]] for side in range(width)}
        parts[(0,) * width] = [[ONE, 0], [0, ONE]]
        assert form.positive(form.Matrix(parts, [[int(radius * ONE), 0], [0, 0]])) == expected


@pytest.mark.parametrize(("x", "y"), [(3, 2), (1, 5), (7, -4)])
def test_a_form_is_definite_up_to_rounding(x, y):
    """[[x^2, x y], [x y, y^2 + off]] is so for off > 0 alone, less errors of any entry."""
    for off, definite in ((1 << 152, True), (0, False), (-1, False)):
        F = [[x * x << 192, x * y << 192], [x * y << 192, (y * y << 192) + off]]
        for place in (None, (0, 0), (0, 1), (1, 0), (1, 1)):
            error = [[(1 << 154) * (place == (i, j)) for j in range(2)] for i in range(2)]
            assert form.positive(form.Matrix({(): F}, error)) == (definite and not place)
    for size in (1, 1 << 40, 1 << 250):
        assert form.positive(form.Matrix({(): [[size]]}, [[0]])) == (size > 1)
        assert not form.positive(form.Matrix({(): [[-size]]}, [[0]]))


def test_a_frame_is_a_matrix_in_the_order_of_its_states():
    cell = Cell({"k": (Fraction(0), Fraction(2))})
    A = {"b": {"a": (1, 5), "b": (2, 7, 8, 9, 10, 11)}, "a": {"b": (3, 4)}}
    found = form.matrix_of(cell, A, ["a", "b"])
    assert found.parts == {(0,): [[0, 4], [5, 7]], (1,): [[0, 0], [0, 8]], (2,): [[0, 0], [0, 9]], (3,): [[0, 0], [0, 10]]}
    assert found.error == [[0, 3], [1, 2 + 11]]
    bordered = [[[*row, 0, 0] for row in part] + [[0] * 4] * 2 for part in found.parts.values()]
    bordered[0][2:] = [[0, 0, 9, 0], [0, 0, 0, 9]]
    assert form.bordered(found._replace(error=[[0] * 2] * 2), [9, 9]) == form.Matrix(
        dict(zip(found.parts, bordered, strict=True)), [[0] * 4] * 4
    )
    assert form.matrix_of(cell, A, ["b"], ["a"]) == form.Matrix({(0,): [[5]]}, [[1]])


@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_matrix_is_a_convex_combination_of_its_control_points(width):
    """Of degree 2 in its last side, with the weights of Bernstein, but for errors."""
    draw = random.Random(width)  # noqa: S311
    matrix = drawn(draw, width, (2, 3))
    points = form.control_points(matrix)
    for _ in range(5):
        *others, s = (Fraction(draw.randint(-9, 9), 9) for _ in range(width))
        t = (1 + s) / 2
        shares = (1 - t) ** 2, 2 * t * (1 - t), t**2
        found = sum(share * member(point, others) for share, point in zip(shares, points, strict=True))
        assert (found == member(matrix, [*others, s])).all()
        assert all(point.error == matrix.error for point in points)
