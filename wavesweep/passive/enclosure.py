"""Matrices that depend on parameters, enclosed over a box: a polynomial of second degree with a bound, and its stability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Enclosure:
    """Matrices within `rest` of `centre + sum_k slopes_k e_k + sum_(i<=j) curves_ij e_i e_j`, e in [-1, 1]^k a point.

    centre, rest: `(..., rows, columns)`, rest at least 0; slopes, curves: the same with an axis before the last two, for
    k parameters and their pairs as `np.triu_indices(k)` has them. Sums and products enclose those of every two matrices
    at the same e: a Taylor model of second order (M. Berz, K. Makino, Verified integration of ODEs and flows using
    differential algebraic methods on high-order Taylor models, Reliable Computing 4, 361-369, 1998). A plain array in a
    sum or a product is a matrix that depends on nothing.
    Accuracy: rounding of the sums is not enclosed; a proof has to leave room for it.
    """

    centre: np.ndarray
    slopes: np.ndarray
    curves: np.ndarray
    rest: np.ndarray

    __array_ufunc__ = None  # so that an array on the left leaves the operation to this class

    @property
    def parts(self) -> tuple[np.ndarray, ...]:
        """All four."""
        return self.centre, self.slopes, self.curves, self.rest

    @property
    def radius(self) -> np.ndarray:
        """How far an entry may be from the centre's."""
        return np.abs(self.slopes).sum(-3) + np.abs(self.curves).sum(-3) + self.rest

    def __add__(self, other) -> Enclosure:
        if isinstance(other, Enclosure):
            return Enclosure(*(a + b for a, b in zip(self.parts, other.parts, strict=True)))
        return Enclosure(self.centre + other, self.slopes, self.curves, self.rest)

    __radd__ = __add__

    def __neg__(self) -> Enclosure:
        return Enclosure(-self.centre, -self.slopes, -self.curves, self.rest)

    def __sub__(self, other) -> Enclosure:
        return self + (-other)

    def __rsub__(self, other) -> Enclosure:
        return -self + other

    def __matmul__(self, other) -> Enclosure:
        return _product(self, other, np.matmul)

    def __rmatmul__(self, other) -> Enclosure:
        each = other[..., None, :, :]
        return Enclosure(other @ self.centre, each @ self.slopes, each @ self.curves, np.abs(other) @ self.rest)

    def __mul__(self, other) -> Enclosure:
        """Entry by entry, a number being `(..., 1, 1)`."""
        return _product(self, other, np.multiply)

    __rmul__ = __mul__

    def part(self, rows, columns) -> Enclosure:
        """The entries at `rows` and `columns`, lists of indices."""
        at = (..., np.asarray(rows)[:, None], np.asarray(columns))
        return Enclosure(*(part[at] for part in self.parts))

    @property
    def transposed(self) -> Enclosure:
        """Rows in place of columns."""
        return Enclosure(*(np.swapaxes(part, -1, -2) for part in self.parts))


def _product(x: Enclosure, y, times) -> Enclosure:
    if not isinstance(y, Enclosure):
        y = np.asarray(y)
        each = y if y.ndim < 3 else y[..., None, :, :]
        return Enclosure(times(x.centre, y), times(x.slopes, each), times(x.curves, each), times(x.rest, np.abs(y)))
    x0, y0 = x.centre[..., None, :, :], y.centre[..., None, :, :]
    i, j = np.triu_indices(x.slopes.shape[-3])
    curves = times(x0, y.curves) + times(x.curves, y0) + times(x.slopes[..., i, :, :], y.slopes[..., j, :, :])
    mixed = np.flatnonzero(i != j)
    curves[..., mixed, :, :] += times(x.slopes[..., j[mixed], :, :], y.slopes[..., i[mixed], :, :])
    x1, y1, x2, y2 = (np.abs(part).sum(-3) for part in (x.slopes, y.slopes, x.curves, y.curves))
    rest = times(np.abs(x.centre) + x1 + x2, y.rest) + times(x.rest, np.abs(y.centre) + y1 + y2 + y.rest)
    rest = rest + times(x1, y2) + times(x2, y1 + y2)
    return Enclosure(times(x.centre, y.centre), times(x0, y.slopes) + times(x.slopes, y0), curves, rest)


def solved_left(E: Enclosure, row: Enclosure) -> Enclosure:
    """Enclosure of `row E^-1`: solved order by order, with the residual times a bound of `|E^-1|` as the rest.

    `|E^-1| <= |E0^-1| (I - R |E0^-1|)^-1`, R the radius of E, if no entry of the inverse on the right is negative; else
    the rest is infinite.
    """
    inverse = inverted(E.centre)
    each = inverse[..., None, :, :]
    l0 = row.centre @ inverse
    l1 = (row.slopes - l0[..., None, :, :] @ E.slopes) @ each
    i, j = np.triu_indices(E.slopes.shape[-3])
    pairs = l1[..., i, :, :] @ E.slopes[..., j, :, :]
    mixed = np.flatnonzero(i != j)
    pairs[..., mixed, :, :] += l1[..., j[mixed], :, :] @ E.slopes[..., i[mixed], :, :]
    guess = Enclosure(l0, l1, (row.curves - l0[..., None, :, :] @ E.curves - pairs) @ each, np.zeros(l0.shape))
    left = row - guess @ E
    size = np.abs(inverse)
    shrink = inverted(np.eye(size.shape[-1]) - E.radius @ size)
    sure = np.isfinite(shrink).all((-1, -2)) & (shrink >= 0).all((-1, -2))
    error = (np.abs(left.centre) + left.radius) @ size @ np.where(sure[..., None, None], shrink, 0.0)
    return Enclosure(guess.centre, guess.slopes, guess.curves, np.where(sure[..., None, None], error, np.inf))


def inverted(A):
    """The inverse, infinite if there is none."""
    sign, size = np.linalg.slogdet(A)
    regular = ((sign != 0) & np.isfinite(size))[..., None, None]
    return np.where(regular, np.linalg.inv(np.where(regular, A, np.eye(A.shape[-1]))), np.inf)


def stacked(blocks) -> Enclosure:
    """Rows of enclosures and arrays side by side, put below each other."""
    some = [block for row in blocks for block in row if isinstance(block, Enclosure)]
    batch = np.broadcast_shapes(*(block.rest.shape[:-2] for block in some))
    count = some[0].slopes.shape[-3]
    parts = [[_whole(block, batch, count) for block in row] for row in blocks]
    return Enclosure(*(
        np.concatenate([np.concatenate([part[i] for part in row], axis=-1) for row in parts], axis=-2) for i in range(4)
    ))  # fmt: skip


def _whole(block, batch, count):
    """The four parts over the whole batch."""
    if not isinstance(block, Enclosure):
        block = constant(block, count)
    tails = (part.shape[-axes:] for part, axes in zip(block.parts, (2, 3, 3, 2), strict=True))
    return [np.broadcast_to(part, (*batch, *tail)) for part, tail in zip(block.parts, tails, strict=True)]


def constant(array, count) -> Enclosure:
    """The enclosure of an array that depends on none of `count` parameters."""
    array = np.asarray(array)
    zero = np.zeros((*array.shape[:-2], count * (count + 1) // 2, *array.shape[-2:]))
    return Enclosure(array, zero[..., :count, :, :], zero, np.zeros(array.shape))


def over_box(low, high) -> list[Enclosure]:
    """The k parameters between `low` and `high` (`(..., k)`), each as a number `(..., 1, 1)`."""
    count = low.shape[-1]
    found = []
    for k in range(count):
        plain = constant(((low + high) / 2)[..., k, None, None], count)
        slopes = ((high - low) / 2)[..., k, None] * np.eye(count)[k]
        found.append(Enclosure(plain.centre, slopes[..., None, None], plain.curves, plain.rest))
    return found


def widened(X: Enclosure, count: int) -> Enclosure:
    """The same enclosure with `count` parameters, on the last of which it does not depend."""
    own = X.slopes.shape[-3]
    if own == count:
        return X
    i, j = np.triu_indices(count)
    curves = np.zeros((*X.curves.shape[:-3], len(i), *X.curves.shape[-2:]), X.curves.dtype)
    curves[..., j < own, :, :] = X.curves
    more = np.zeros((*X.slopes.shape[:-3], count - own, *X.slopes.shape[-2:]))
    return Enclosure(X.centre, np.concatenate([X.slopes, more], axis=-3), curves, X.rest)


ROOM = 1e-9  # of a weighted row, for its rounding
SECTORS = 4  # of the upper half of the plane, one about each of the largest eigenvalues
SWEEPS = 8  # of the power iteration that tells which parameter does most


def excluded(A: Enclosure) -> tuple[np.ndarray, np.ndarray]:
    """Whether every `I + A` is stable, `(pieces,)`, and which parameter adds most to the bound, `(pieces,)`.

    A: real matrices, near to diagonal in some basis that is common to them. For z outside, `z - I - A` is invertible
    if it is diagonally dominant in some weights: `sum_j |A_ij| d_j < |z - 1 - A_ii| d_i`. This is tried for each sector
    `|z| >= 1, a <= arg z <= b` of the upper half plane (the lower one is its image), with the least of the right side
    in it; the weights d are solved for (A. Berman, R. Plemmons, Nonnegative matrices in the mathematical sciences,
    1979: they exist exactly for a nonsingular M-matrix) and then tried.
    """
    centre, slopes, bends, rest = _flattened(A)
    finite = np.logical_and.reduce([np.isfinite(part).all(tuple(range(1, part.ndim))) for part in A.parts])
    moves = np.abs(slopes)
    radius = moves.sum(1) + rest
    d = np.arange(centre.shape[-1])
    own = 1 + centre[:, d, d]
    inside = 1 - _modulus(1 + A.centre[:, d, d], slopes[:, :, d, d], A.curves[:, :, d, d]) - A.rest[:, d, d]
    away = np.maximum(inside[:, None], _distances(own) - radius[:, None, d, d])
    off = np.abs(centre) + radius
    off[:, d, d] = 0
    finite &= np.isfinite(off).all((-1, -2)) & np.isfinite(away).all((-1, -2))
    off, away = np.where(finite[:, None, None], off, 1.0), np.where(finite[:, None, None], away, 0.0)
    clear = _dominant(off, away)
    worst = np.argmin(np.where(clear, 10.0, 0.0) + away.min(-1), axis=-1)
    least = np.take_along_axis(away, worst[:, None, None], 1)[:, 0]
    return finite & clear.all(-1), _costliest(off, least, moves, bends, np.where(finite[:, None, None], A.rest, 0.0))


def _flattened(A):
    """Centre, slopes, bounds of the terms of second degree, and a bound of all that is not linear."""
    i, j = np.triu_indices(A.slopes.shape[1])
    centre = A.centre + A.curves[:, i == j].sum(1) / 2  # e^2 is within a half of a half
    bends = np.abs(A.curves) * np.where(i == j, 0.5, 1.0)[:, None, None]
    return centre, A.slopes, bends, A.rest + bends.sum(1)


def _modulus(centre, slopes, curves):
    """A bound of `|centre + sum slopes_k e_k + sum curves_ij e_i e_j|`, to second order in its square.

    A mode that only turns with the parameters grows by its third order alone.
    """
    i, j = np.triu_indices(slopes.shape[1])
    linear = 2 * (centre[:, None].conj() * slopes).real
    square = 2 * (centre[:, None].conj() * curves).real
    square += np.where(i == j, 1, 2)[:, None] * (slopes[:, i].conj() * slopes[:, j]).real
    own, mixed = square[:, i == j], np.abs(square[:, i != j]).sum(1)
    size = np.abs(linear)  # the most of l e + q e^2: in a corner, unless q < 0 bends it down before
    hump = np.where(size < -2 * own, linear**2 / np.maximum(-4 * own, 1e-300), size + own)
    first, second = np.abs(slopes).sum(1), np.abs(curves).sum(1)
    return np.sqrt(np.maximum(np.abs(centre) ** 2 + hump.sum(1) + mixed + 2 * first * second + second**2, 0))


def _distances(own):
    """From each of `own` to each sector: `(pieces, sectors, n)`; the sectors meet midway between the largest of them."""
    upper = np.where(own.imag >= 0, np.abs(own), -1.0)
    largest = np.argsort(-upper, axis=-1, kind="stable")[:, :SECTORS]
    chosen = np.where(np.take_along_axis(upper, largest, -1) < 0, -1, np.take_along_axis(own, largest, -1))
    angles = np.sort(np.angle(chosen))
    between = (angles[:, 1:] + angles[:, :-1]) / 2
    first = np.concatenate([np.zeros((len(own), 1)), between], -1)[..., None]
    last = np.concatenate([between, np.full((len(own), 1), np.pi)], -1)[..., None]
    z, angle = own[:, None], np.angle(own)[:, None]
    edge = np.minimum(np.abs(z - np.exp(1j * first)), np.abs(z - np.exp(1j * last)))
    return np.where((angle >= first) & (angle <= last) | (np.abs(z) >= 1), 1 - np.abs(z), edge)


def _dominant(off, away):
    """In which sectors weights d > 0 with `off d < away d` were found, `(pieces, sectors)`."""
    positive = (away > ROOM).all(-1)
    diagonal = np.where(positive[..., None], away, 1.0) * (1 - ROOM)
    matrix = diagonal[..., None] * np.eye(off.shape[-1]) - np.where(positive[..., None, None], off[:, None], 0.0)
    d = _solved(matrix)
    return positive & (d > 0).all(-1) & ((off[:, None] @ d[..., None])[..., 0] < diagonal * d).all(-1)


def _solved(matrix):
    """`matrix^-1 1`, or -1 if a matrix is singular."""
    ones = np.ones((*matrix.shape[:-1], 1))
    try:
        return np.linalg.solve(matrix, ones)[..., 0]
    except np.linalg.LinAlgError:
        regular = (np.linalg.slogdet(matrix)[0] != 0)[..., None]
        solved = np.linalg.solve(np.where(regular[..., None], matrix, np.eye(matrix.shape[-1])), ones)[..., 0]
        return np.where(regular, solved, -1.0)


def _costliest(off, away, moves, bends, rest):
    """The parameter that raises the spectral radius of the weighted bound most, to first order.

    Of each bend all those that have a part in it have the whole; of the rest, a part as of the bends.
    """
    i, j = np.triu_indices(moves.shape[1])
    bent = np.stack([bends[:, (i == k) | (j == k)].sum(1) for k in range(moves.shape[1])], axis=1)
    size = 1 / (np.maximum(away, 0) + 1e-3 * off.sum(-1) + 1e-300)
    bound = size[..., None] * (off + (moves + bent).sum(1) * np.eye(off.shape[-1]))
    right, left = np.ones((*bound.shape[:-1], 1)), np.ones((len(bound), 1, bound.shape[-1]))
    for _ in range(SWEEPS):
        right, left = bound @ right, left @ bound
        right, left = right / right.max(-2, keepdims=True), left / left.max(-1, keepdims=True)
    left = left * size[:, None]
    straight, curved = ((left[:, None] @ part @ right[:, None])[..., 0, 0] for part in (moves, bent))
    beyond = (left @ rest @ right)[..., 0] / np.maximum(curved.sum(-1, keepdims=True), 1e-300)
    gain = straight + curved * (1 + beyond)
    return np.argmax(np.where(np.isfinite(gain), gain, -1), axis=-1)
