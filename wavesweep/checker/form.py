"""Whether P - A' Q A > 0 for all values of a cell's sides, in matrices of polynomials with a bound on the rest.

If P - A(p)' P A(p) > 0 all over a cell, no eigenvalue of A(p) is on the unit circle, and as many are outside as P has negative
ones (Ostrowski and Schneider, "Some theorems on the inertia of general matrices", 1962). P itself may depend on p: it is regular
wherever the inequality holds, so its inertia does not change within the cell. With another radius A is divided by it. With a turn
of 1 or -1 the same is looked at as X' (P - A' P A) X > 0 with any regular X near (1 + turn A)^-1.
"""

from collections.abc import Iterable
from fractions import Fraction
from itertools import product as all_of
from math import inf
from operator import mul
from typing import NamedTuple

from .balls import BITS, ONE, Cell, Refused
from .reader.loops import diagonal, product, transposed

HALF = BITS // 2  # digits of what a file gives, so that L' S L is exact
KEPT = 3  # orders of a frame that its form sees; the rest counts as an error
Rows = list[list[int]]


class Matrix(NamedTuple):
    """The sum of parts[m] times the monomial m, +- error, entry by entry, in units of 2^-BITS."""

    parts: dict[tuple[int, ...], Rows]
    error: Rows

    @property
    def size(self) -> Rows:
        """A bound of each entry, without the error."""
        return _sum([[abs(x) for x in row] for row in part] for part in self.parts.values())


def _sum(matrices: Iterable[Rows]) -> Rows:
    first, *further = matrices
    total = [list(row) for row in first]
    for matrix in further:
        total = [
            [x + y for x, y in zip(row, addend, strict=True)]
            for row, addend in zip(total, matrix, strict=True)
        ]
    return total


def _dot(A: Rows, B: Rows) -> Rows:
    """The product in units of 2^-BITS, rounded down."""
    columns = transposed(B)
    return [[sum(map(mul, row, column)) >> BITS for column in columns] for row in A]


def _mirrored(A: Rows, B: Rows) -> Rows:
    """The same above the diagonal, and mirrored below: of terms whose sum is symmetric."""
    columns = transposed(B)
    upper = [
        [sum(map(mul, row, column)) >> BITS for column in columns[index:]]
        for index, row in enumerate(A)
    ]
    size = range(len(A))
    return [[upper[min(index, other)][abs(index - other)] for other in size] for index in size]


def multiplied(first: Matrix, second: Matrix, dot=_dot, order: float = inf) -> Matrix:
    """|(A + a)(B + b) - A B| <= |A| b + a (|B| + b), and 1 for each product that is rounded down. Parts above an order are errors,
    as products of sizes."""
    found: dict[tuple, Rows] = {}
    bounds = []
    for m, A in first.parts.items():
        for k, B in second.parts.items():
            both = tuple(i + j for i, j in zip(m, k, strict=True))
            if sum(both) <= order:
                term = dot(A, B)
                found[both] = _sum((found[both], term)) if both in found else term
    for degree in {sum(m) for m in first.parts}:
        beyond = {k: B for k, B in second.parts.items() if degree + sum(k) > order}
        if beyond:
            of_degree = {m: A for m, A in first.parts.items() if sum(m) == degree}
            bounds.append(_dot(Matrix(of_degree, []).size, Matrix(beyond, []).size))
    rounded = len(first.parts) * len(second.parts) + 2
    bounds.append([[rounded] * len(second.error[0]) for _ in first.error])
    if any(map(any, second.error)):
        bounds.append(_dot(first.size, second.error))
    if any(map(any, first.error)):
        bounds.append(_dot(first.error, _sum((second.size, second.error))))
    return Matrix(found, _sum(bounds))


def turned(matrix: Matrix) -> Matrix:
    return Matrix(
        {m: transposed(part) for m, part in matrix.parts.items()}, transposed(matrix.error)
    )


def minus(left: Matrix, subtrahend: Matrix) -> Matrix:
    difference = dict(left.parts)
    for m, part in subtrahend.parts.items():
        negative = [[-x for x in row] for row in part]
        difference[m] = _sum((difference[m], negative)) if m in difference else negative
    return Matrix(difference, _sum((left.error, subtrahend.error)))


def _cut(matrix: Matrix, order: int) -> Matrix:
    """Parts above an order as errors."""
    high = {m: part for m, part in matrix.parts.items() if sum(m) > order}
    low = {m: part for m, part in matrix.parts.items() if sum(m) <= order}
    return Matrix(low, _sum((matrix.error, Matrix(high, []).size)) if high else matrix.error)


def matrix_of(cell: Cell, A: dict, states: list[str], columns: list[str] | None = None) -> Matrix:
    """The matrix of a frame in the order of its states, or of these rows with other columns."""
    longest = max((len(c) for row in A.values() for c in row.values()), default=2)
    nothing = (0,) * longest
    entries = [[A[row].get(column, nothing) for column in columns or states] for row in states]
    parts = {}
    for place in range(1, longest):
        rows = [[c[place] if place < len(c) else 0 for c in row] for row in entries]
        if place == 1 or any(map(any, rows)):
            parts[cell.ring.monomials[place - 1]] = rows
    return _cut(Matrix(parts, [[c[0] for c in row] for row in entries]), KEPT)


def divided(A: Matrix, by: Fraction) -> Matrix:
    """A over a positive number; each coefficient is rounded down by less than 1."""
    top, bottom = by.denominator, by.numerator
    parts = {m: [[x * top // bottom for x in row] for row in part] for m, part in A.parts.items()}
    error = [[x * top // bottom + 1 + len(parts) for x in row] for row in A.error]
    return Matrix(parts, error)


def product_of(matrices: list[Matrix]) -> Matrix:
    """Of the first, and then the others: of halves, so that errors grow as products of few factors do."""
    if len(matrices) == 1:
        return matrices[0]
    half = len(matrices) // 2
    return _cut(multiplied(product_of(matrices[half:]), product_of(matrices[:half])), KEPT)


def form_of(
    width: int, L: Rows, signs: list[int], slopes: list[tuple[tuple[int, ...], Rows]]
) -> Matrix:
    """P = L' (diag(signs) + sum Q_m s^m) L. The slopes are rounded, as the form is that of the rounded ones."""
    L_t = transposed(L)
    parts = {
        (0,) * width: _dot(
            [[x * sign for x, sign in zip(row, signs, strict=True)] for row in L_t], L
        )
    }
    for m, Q in slopes:
        product_of_rows = _dot(L_t, _dot(Q, L))
        parts[m] = _symmetric(product_of_rows)
    return Matrix(parts, [[0] * len(L) for _ in L])


def control_points(A: Matrix) -> list[Matrix]:
    """Matrices of the other sides, of which A is a convex combination wherever the last side s is: c_0 + c_1 s + c_2 s^2 is one of
    its Bernstein points, and what has a higher power of s is an error.

    P - A' Q A is concave in A if Q >= 0: it is positive for all s if it is so at these points.
    """
    error = _sum(
        [
            A.error,
            *([[abs(x) for x in row] for row in part] for m, part in A.parts.items() if m[-1] > 2),
        ]
    )
    points = []
    for shares in ((1, -1, 1), (1, 0, -1), (1, 1, 1)):
        parts: dict[tuple, Rows] = {}
        for m, part in A.parts.items():
            if m[-1] <= 2:
                term = [[shares[m[-1]] * x for x in row] for row in part]
                parts[m[:-1]] = _sum((parts[m[:-1]], term)) if m[:-1] in parts else term
        points.append(Matrix(parts, error))
    return points


def bordered(P: Matrix, entries: list[int]) -> Matrix:
    """P, and after it these entries of the diagonal."""
    size = len(P.error) + len(entries)
    parts = {}
    for m, part in P.parts.items():
        parts[m] = [[*row, *[0] * len(entries)] for row in part]
        parts[m] += [[0] * size for _ in entries]
    still = parts[min(parts, key=sum)]
    for place, entry in enumerate(entries, len(P.error)):
        still[place][place] = entry
    return Matrix(parts, [[0] * size for _ in range(size)])


def _symmetric(rows: Rows) -> Rows:
    """(M + M')/2, rounded down by less than 1."""
    return [
        [(x + y) // 2 for x, y in zip(row, mirrored, strict=True)]
        for row, mirrored in zip(rows, transposed(rows), strict=True)
    ]


def decreases(P: Matrix, steps: list[tuple[Matrix | None, Matrix, Matrix]], turn: int = 0) -> bool:
    """Whether P - sum of share A' Q A > 0 all over the cell, for the steps (share as a matrix of one entry or None for 1, A, Q).

    turn: 1 or -1 for one step, of which X' (P - A' Q A) X is looked at with X near (1 + turn A)^-1: this is near P X + X' P - P,
    in which large modes are no larger than others.
    """
    several = len(next(iter(P.parts))) > 1
    order = KEPT if several else inf  # of products: of one side all of them take no longer
    try:
        X = _inverse(steps[0][1], turn) if turn else None
    except (OverflowError, ValueError):
        raise Refused("a frame that cannot be turned") from None
    total = multiplied(turned(X), multiplied(P, X, order=order), _mirrored, order) if X else P
    for share, A, Q in steps:
        moved = _cut(multiplied(A, X), KEPT) if X else A
        taken = multiplied(turned(moved), multiplied(Q, moved, order=order), _mirrored, order)
        if share is not None:
            spread = {m: diagonal([c] * len(P.error)) for m, ((c,),) in share.parts.items()}
            taken = multiplied(Matrix(spread, diagonal([share.error[0][0]] * len(P.error))), taken)
        total = minus(total, taken)
    return positive(total)


def positive(matrix: Matrix) -> bool:
    """Whether all symmetric matrices that it encloses are positive definite, by its Bernstein points of order 2 in each side."""
    width = len(next(iter(matrix.parts)))
    low = _cut(matrix, 2 if width <= 3 else 1)
    pairs = zip(
        low.error, transposed(low.error), strict=True
    )  # an entry may stand for its mirror image
    error = [[max(x, y) + len(low.parts) + 1 for x, y in zip(*pair, strict=True)] for pair in pairs]
    parts = {m: _symmetric(part) for m, part in low.parts.items()}
    degrees = [max(m[side] for m in parts) for side in range(width)]
    # of c_0 + c_1 s + c_2 s^2 the points are c_0 - c_1 + c_2, c_0 - c_2 and c_0 + c_1 + c_2, and of c_0 + c_1 s its ends
    factors = {0: ((1,),), 1: ((1, -1), (1, 1)), 2: ((1, -1, 1), (1, 0, -1), (1, 1, 1))}
    for point in all_of(*(factors[degree] for degree in degrees)):
        terms = []
        for m, part in parts.items():
            share = 1
            for row, power in zip(point, m, strict=True):
                share *= row[power]
            if share:
                terms.append([[share * x for x in row] for row in part])
        if not _definite(_sum(terms), error):
            return False
    return True


def _definite(F: Rows, R: Rows) -> bool:
    """Whether all symmetric matrices within R of F are positive definite: W' F W has a dominant diagonal, whatever W is."""
    n = len(F)
    if not all(F[k][k] > 0 for k in range(n)):
        return False
    try:
        W = [
            [int(x * 2.0**HALF) << (BITS - HALF) for x in row]
            for row in _weights([[x / ONE for x in row] for row in F])
        ]
    except (OverflowError, ValueError, ZeroDivisionError):
        return False
    G = _mirrored(transposed(W), _dot(F, W))
    size = [[abs(x) for x in row] for row in W]
    across = [sum(map(mul, row, map(sum, size))) >> BITS for row in R]  # R |W| 1
    slack = (n + 2) * (max(map(max, size)) * n // ONE + 4)  # of products that are rounded down
    for k, row in enumerate(G):
        error = (sum(size[i][k] * across[i] for i in range(n)) >> BITS) + n * slack
        if row[k] <= sum(abs(x) for column, x in enumerate(row) if column != k) + error:
            return False
    return True


# What follows is in doubles: nothing that is proved depends on it.


def _weights(F: list[list[float]]) -> list[list[float]]:
    """W with W' F W near 1, by Cholesky's decomposition."""
    n = len(F)
    unit = [F[k][k] ** 0.5 for k in range(n)]
    L = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            x = F[i][j] / unit[i] / unit[j] - sum(map(mul, L[i][:j], L[j][:j]))
            L[i][j] = x**0.5 if i == j and x > 0 else x / L[j][j]
    inverse = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            inverse[i][j] = ((i == j) - sum(L[i][k] * inverse[k][j] for k in range(j, i))) / L[i][i]
    return [[inverse[j][i] / unit[i] for j in range(n)] for i in range(n)]


def _inverse(A: Matrix, turn: int) -> Matrix:
    """X near (1 + turn A)^-1 to second order; exact as it stands."""
    parts = {m: [[x / ONE for x in row] for row in part] for m, part in A.parts.items()}
    width = len(next(iter(parts)))
    n = len(A.error)
    still = (0,) * width
    first = _solved(
        [[(i == j) + turn * x for j, x in enumerate(row)] for i, row in enumerate(parts[still])]
    )
    parts_of_inverse = {still: first}
    lower = [m for m in parts if m != still and sum(m) <= 2]
    for order in (1, 2):
        for m in all_of(range(order + 1), repeat=width):
            if sum(m) != order:
                continue
            total = [[0.0] * n for _ in range(n)]
            for k in lower:
                rest = tuple(i - j for i, j in zip(m, k, strict=True))
                if rest in parts_of_inverse:
                    term = product(parts[k], parts_of_inverse[rest])
                    total = [
                        [x - turn * y for x, y in zip(row, addend, strict=True)]
                        for row, addend in zip(total, term, strict=True)
                    ]
            if any(map(any, total)):
                parts_of_inverse[m] = product(first, total)
    exact = {
        m: [[int(x * 2.0**BITS) for x in row] for row in part]
        for m, part in parts_of_inverse.items()
    }
    return Matrix(exact, [[0] * n for _ in range(n)])


def _solved(rows: list[list[float]]) -> list[list[float]]:
    """The inverse by Gauss and Jordan."""
    n = len(rows)
    rows = [[*row, *(float(i == j) for j in range(n))] for i, row in enumerate(rows)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        if not rows[k][k]:
            raise Refused("a frame that cannot be turned")
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(n):
            if i != k and rows[i][k]:
                factor = rows[i][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[n:] for row in rows]
