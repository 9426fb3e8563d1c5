"""Matrices of polynomials with bounds: sums and products enclose those of all their members, and no more than rounding adds."""

import random
from fractions import Fraction
from itertools import product

import pytest

from wavesweep.checker import form
from wavesweep.checker.balls import ONE, Cell

BITS = 100, 190, 193  # of entries: where rounding is all, and where it is nothing


def drawn(draw: random.Random, width: int, rows: int, columns: int, orders=2, bits=190) -> form.Matrix:
    def entries(size):
        return [[draw.randint(-size, size) for _ in range(columns)] for _ in range(rows)]

    powers = [m for m in product(range(orders + 1), repeat=width) if sum(m) <= orders and (not sum(m) or draw.random() < 0.8)]
    error = draw.choice((0, 1 << bits // 2, 1 << (bits - 9)))
    return form.Matrix({m: entries(1 << bits) for m in powers}, [[abs(x) for x in row] for row in entries(error)])


def member(matrix: form.Matrix, s, signs) -> list[list[Fraction]]:
    """A matrix that it encloses: at a point, with errors of some signs."""
    total = [
        [sign * Fraction(e) for sign, e in zip(row, errors, strict=True)]
        for row, errors in zip(signs, matrix.error, strict=True)
    ]
    for m, part in matrix.parts.items():
        share = Fraction(1)
        for x, power in zip(s, m, strict=True):
            share *= x**power
        total = [[x + share * y for x, y in zip(*pair, strict=True)] for pair in zip(total, part, strict=True)]
    return total


def dot(A, B) -> list:
    return [[sum(x * y for x, y in zip(row, column, strict=True)) / ONE for column in zip(*B, strict=True)] for row in A]


def signs_of(draw, matrix):
    return [[draw.choice((-1, 1)) for _ in row] for row in matrix.error]


def largest(matrix: form.Matrix) -> list:
    return [[Fraction(x) for x in row] for row in matrix.size]


@pytest.mark.parametrize("width", range(3))
def test_matrices_enclose_those_of_their_members(width):
    draw = random.Random(width)  # noqa: S311
    for _ in range(40):
        A, B, C = (drawn(draw, width, *size, bits=draw.choice(BITS)) for size in ((3, 2), (2, 3), (3, 2)))
        s = [Fraction(draw.choice((-1, 1, draw.uniform(-1, 1)))) for _ in range(width)]
        a, b, c = (member(each, s, signs_of(draw, each)) for each in (A, B, C))
        by = Fraction(draw.randint(1, 99), draw.randint(1, 99))
        over = [[x / by for x in row] for row in a]
        less = [[x - y for x, y in zip(*pair, strict=True)] for pair in zip(a, c, strict=True)]
        errors = [[Fraction(x) for x in row] for row in A.error], [[Fraction(x) for x in row] for row in B.error]
        whole = [[x + y for x, y in zip(*pair, strict=True)] for pair in zip(largest(B), errors[1], strict=True)]
        of_product = zip(dot(largest(A), errors[1]), dot(errors[0], whole), strict=True)
        wanted = [[x + y for x, y in zip(*pair, strict=True)] for pair in of_product]
        for found, exact, bound, rounded in (
            (form.multiplied(A, B), dot(a, b), wanted, len(A.parts) * len(B.parts) + 2),
            (
                form.minus(A, C),
                less,
                [[x + y for x, y in zip(*pair, strict=True)] for pair in zip(A.error, C.error, strict=True)],
                0,
            ),
            (form.divided(A, by), over, [[x / by for x in row] for row in A.error], len(A.parts) + 1),
            (form.turned(A), [list(row) for row in zip(*a, strict=True)], [list(row) for row in zip(*A.error, strict=True)], 0),
            (form._cut(B, 1), b, [[sum(x) for x in zip(*row, strict=True)] for row in zip(B.error, high(B), strict=True)], 0),
        ):
            middle = member(found, s, [[0] * len(row) for row in found.error])
            for i, row in enumerate(exact):
                for j, x in enumerate(row):
                    assert abs(x - middle[i][j]) <= found.error[i][j] <= bound[i][j] + rounded


def high(matrix: form.Matrix) -> list:
    """What the parts of second order are at most."""
    size = [[0] * len(row) for row in matrix.error]
    for m, part in matrix.parts.items():
        if sum(m) > 1:
            size = [[x + abs(y) for x, y in zip(*pair, strict=True)] for pair in zip(size, part, strict=True)]
    return size


@pytest.mark.parametrize("width", range(5))
def test_a_matrix_is_positive_where_all_of_its_members_are(width):
    """1 - sum of c_k s_k^p is above 0 on [-1, 1] where the sum of c is below 1."""
    still = (0,) * width
    for power in (1, 2):
        for share, radius, expected in ((0.49, 0, True), (0.49, 0.5, True), (0.49, 0.52, False), (1.01, 0, False)):
            if not width and share > 1:
                continue
            parts = {still: [[ONE, 0], [0, ONE]]}
            for side in range(width):
                m = tuple(power * (side == other) for other in range(width))
                size = int(share * ONE / width)
                parts[m] = [[-size, 0], [0, size // 3]]
            error = int(radius * ONE) if width else int((1 - radius) * ONE) // 100
            assert form.positive(form.Matrix(parts, [[error, 0], [0, 0]])) == (expected or not width)


def test_a_form_is_definite_up_to_rounding():
    for x, y in ((3, 2), (1, 5), (7, -4)):
        for off, definite in ((1 << 152, True), (0, False), (-1, False)):
            F = [[x * x << 192, x * y << 192], [x * y << 192, (y * y << 192) + off]]
            assert form.positive(form.Matrix({(): F}, [[0, 0], [0, 0]])) == definite, (x, y, off)
            for place in ((0, 0), (0, 1), (1, 1)):
                error = [[(1 << 154) * (place == (i, j)) for j in range(2)] for i in range(2)]
                assert not form.positive(form.Matrix({(): F}, error))
    for size in (1, 1 << 40, 1 << 250):
        assert form.positive(form.Matrix({(): [[size]]}, [[0]])) == (size > 1)
        assert not form.positive(form.Matrix({(): [[-size]]}, [[0]]))


def test_a_frame_is_a_matrix_in_the_order_of_its_states():
    cell = Cell({"k": (Fraction(0), Fraction(2))})
    A = {"b": {"a": (1, 5), "b": (2, 7, 8, 9, 10, 11)}, "a": {"b": (3, 4)}}
    found = form.matrix_of(cell, A, ["a", "b"])
    assert found.parts == {(0,): [[0, 4], [5, 7]], (1,): [[0, 0], [0, 8]], (2,): [[0, 0], [0, 9]], (3,): [[0, 0], [0, 10]]}
    assert found.error == [[0, 3], [1, 2 + 11]]
    assert form.matrix_of(cell, A, ["b"], ["a"]) == form.Matrix({(0,): [[5]]}, [[1]])
