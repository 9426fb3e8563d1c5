"""Proofs that analytic functions of several numbers are positive all over a box of these.

They are interpolated at Chebyshev nodes; their size on an ellipse about one number at a time bounds
the error between these. If the Bernstein coefficients of the interpolant do not prove that it is
positive, the box is divided.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import comb
from typing import NamedTuple, Protocol

import numpy as np

from wavesweep.engine.doubles import EPS

MOST_NODES, LEAST_NODES = 12, 3  # for each number of a box
# sum of the semi-axes of the ellipse about a number, in half widths of its part
NUMBER_ELLIPSE = 4.0
RIM_POINTS = 8  # on its upper half
NUMBER_RIM = NUMBER_ELLIPSE * np.exp(1j * np.pi * (np.arange(RIM_POINTS) + 0.5) / RIM_POINTS)
NUMBER_RIM = (NUMBER_RIM + 1 / NUMBER_RIM) / 2
NUMBER_EXTENT = (NUMBER_ELLIPSE + 1 / NUMBER_ELLIPSE) / 2
# of the other numbers, at which the ellipse about one is evaluated
COARSE_PLACES = (-1.0, 0.0, 1.0)
# largest error of the interpolant, relative to the smallest value seen
LARGEST_INTERPOLANT_ERROR = 0.25
# ratio of the ends of a number above which it is divided at their geometric mean
LOGARITHMIC_FROM = 3.0
# logarithm of the factor by which each further number increases the error of an interpolant
LOG_LEBESGUE = 0.7
SHORTENED_BY = 0.25  # part of the smallest value at a node by which an interpolant may be shortened
MOST_PIECES = 4096

Box = np.ndarray
"""Low and high ends of some numbers, `(2, numbers)`."""


class FunctionValues(NamedTuple):
    """Values of functions, `(functions, n)`: phase, logarithm of the size, and relative error in
    units of EPS.

    pivots: `(n, k)`, see `Frames`.
    """

    phase: np.ndarray
    log: np.ndarray
    error: np.ndarray
    pivots: np.ndarray


class Functions(Protocol):
    """Functions of the numbers of a box, real at real points and analytic within the bounds."""

    def units(self, middle: np.ndarray) -> np.ndarray:
        """What makes values near a point well known; `values` is given it."""

    def values(self, x: np.ndarray, units: np.ndarray) -> FunctionValues:
        """Values at points `(n, numbers)`, real or complex."""


@dataclass(frozen=True, slots=True, eq=False)
class Cover:
    """What is known about a box.

    open: the parts that are not proved, `(parts, 2, numbers)`; empty if all of the box is proved.
    unstable: points at which a function is negative, `(points, numbers)`. used: points at which
    they were computed.
    """

    open: np.ndarray
    unstable: np.ndarray
    used: int


class Resolved(Protocol):
    """Which boxes are narrow enough for the samples that are taken of functions, see
    `_loops.resolution`."""

    used: int

    def unresolved(self, box: Box) -> np.ndarray:
        """Along which numbers a box may have to be divided, a mask `(numbers,)`; none of them if
        it is narrow enough."""


def positive(
    functions: Functions, box: Box, bounds: Box, most: int, resolution: Resolved | None = None
) -> Cover:
    """Prove that functions are positive on a box; the points `unstable` are those where one is
    surely negative.

    box: a number whose two ends are equal is no dimension of it. bounds: the range of each number
    in which the functions are analytic. most: points to compute at most. resolution: asked about
    each part of the box; None if the functions have no narrow features.
    """
    box = np.asarray(box, float)
    proof = _BoxProof(functions, box, np.asarray(bounds, float), resolution)
    queue = [box]
    negative = np.zeros((0, box.shape[1]))
    while queue and proof.used < most and not len(negative):
        ends = queue.pop(0)
        with np.errstate(all="ignore"):  # what overflows is not proved
            negative, open_ = proof.judged(ends)
        queue += open_
    return Cover(np.array(queue).reshape(-1, *box.shape), negative, proof.used)


class _Piece:
    """A piece of a box, with units of the states in it.

    ends: `(2, numbers)`. wide: the numbers in which it is wider than nothing.
    """

    def __init__(self, ends, functions):
        self.ends = ends
        self.wide = np.flatnonzero(ends[0] < ends[1])
        self.middle = ends.mean(0)
        self.half = (ends[1] - ends[0]) / 2
        self.units = functions.units(self.middle)

    def placed(self, grid):
        """Points of the piece: a row of `grid`, from -1 to 1, for each."""
        x = np.repeat(self.middle[None].astype(grid.dtype), len(grid), 0)
        x[:, self.wide] += grid * self.half[self.wide]
        return x

    def divided(self, size):
        """The halves of the piece, divided along the number with the largest `size`."""
        return _halves(self.ends, self.wide[np.argmax(size)])


class _Scale(NamedTuple):
    """What functions are divided by on a piece, `exp(trend x + peak)`, x from -1 to 1: after it
    they are at most 1 at the coarse places, and a polynomial follows them more easily."""

    trend: np.ndarray
    peak: np.ndarray

    @classmethod
    def of(cls, log, grid):
        trend = _trend(log, grid)
        return cls(trend, (log - trend @ grid.T).max(1))

    def removed(self, log, places):
        """Logarithms of sizes, without those of what the functions are divided by."""
        return log - (self.trend @ places.T).real - self.peak[:, None]


class _BoxProof:
    """Functions on the pieces of a box, with a count of the points at which they were computed."""

    def __init__(self, functions, box, limits, resolution):
        self.functions = functions
        self.limits = limits
        self.resolution = resolution
        self.used = 0
        self.widths = np.where(np.ptp(box, 0) > 0, np.ptp(box, 0), 1.0)

    def judged(self, ends):
        """The unstable points found in a piece, and its parts that are not proved."""
        piece = _Piece(ends, self.functions)
        wide = piece.wide
        grid = _grid([COARSE_PLACES] * wide.size)
        points = piece.placed(grid)
        phase, log, error, pivots = self._values(points, piece.units)
        negative = (phase.real < 0) & (EPS * error < 1)
        if negative.any():
            return points[negative.any(0)], [ends]
        below = piece.middle - NUMBER_EXTENT * piece.half < self.limits[0]
        above = piece.middle + NUMBER_EXTENT * piece.half > self.limits[1]
        outside = (below | above)[wide]
        if not np.isfinite(log).all() or outside.any():
            return self._none, piece.divided(piece.half[wide] * (outside | ~outside.any()))
        if self.resolution is not None:
            before = self.resolution.used
            unresolved = self.resolution.unresolved(ends)[wide]
            self.used += self.resolution.used - before
            if unresolved.any():
                shares = (piece.half / self.widths)[wide]
                return self._none, piece.divided(unresolved * shares)
        return self._interpolated(piece, log, pivots)

    def _interpolated(self, piece, log, pivots):
        """The same, from the logarithms and pivots at the coarse places; the piece is divided if
        it needs too many nodes.

        An interpolant of n nodes is off by at most `4 far r^(1 - n)/(r - 1)`, r = NUMBER_ELLIPSE, times
        its Lebesgue constant in each number.
        """
        wide = piece.wide
        grid = _grid([COARSE_PLACES] * wide.size)
        scale = _Scale.of(log, grid)
        least = np.exp((log - scale.trend @ grid.T).min(1) - scale.peak)
        centre = pivots.real.mean(0)
        far = []
        steps = []
        for at in range(wide.size):
            size, step = self._beyond(piece, at, scale, centre)
            far.append(size)
            steps.append(step)
        far = np.stack(far)
        steps = np.max(steps, axis=0)
        allowed = LARGEST_INTERPOLANT_ERROR / max(wide.size, 1) * least
        needed = np.log(4 / (NUMBER_ELLIPSE - 1) * far / allowed).max(1, initial=0.0)
        counts = np.ceil(1 + (needed + LOG_LEBESGUE * wide.size) / np.log(NUMBER_ELLIPSE))
        counts = np.clip(counts, LEAST_NODES, np.inf)
        if not (counts <= MOST_NODES).all() or counts.prod() > 20_000:  # nodes in all
            # Divide along the number along which the sizes on the other ellipses change most.
            # A larger change of the logarithm from one coarse place to the next is steep.
            steep = np.isfinite(counts).all() and steps.max() > 0.3
            return self._none, piece.divided(steps if steep else counts)
        return self._within(piece, [nodes(int(count)) for count in counts], scale, far)

    @property
    def _none(self):
        return np.zeros((0, self.limits.shape[1]))

    def _within(self, piece, nodes, scale, far):
        """The same, from the values at these nodes."""
        wide = piece.wide
        grid = _grid(nodes)
        counts = [len(places) for places in nodes]
        points = piece.placed(grid)
        phase, log, error, _ = self._values(points, piece.units)
        negative = (phase.real < 0) & (EPS * error < 1)
        if negative.any():
            return points[negative.any(0)], [piece.ends]
        if not np.isfinite(log).all():
            return self._none, piece.divided(piece.half[wide])
        value = phase.real * np.exp(scale.removed(log, grid))
        constants = 2 / np.pi * np.log(counts) + 1  # upper bounds on the Lebesgue constants
        noise = 2 * constants.prod() * (EPS * error * np.abs(value)).max(1)
        sizes = np.array(
            [4 * NUMBER_ELLIPSE ** (1 - count) / (NUMBER_ELLIPSE - 1) for count in counts]
        )
        noise += (far * (sizes * constants.prod() / constants)[:, None]).sum(0)
        open_ = []
        for row, off in zip(value, noise, strict=True):
            open_ += _positive(row.reshape(counts), off)
        if not open_:
            return self._none, []
        low = np.min([low for low, _ in open_], 0)
        high = np.max([high for _, high in open_], 0)
        middle = piece.middle[wide]
        half = piece.half[wide]
        rest = piece.ends.copy()
        rest[0, wide] = middle + half * low
        rest[1, wide] = middle + half * high
        if (high - low).prod() <= 2 ** (wide.size - 1):
            return self._none, [rest]
        steepest = np.argmax((high - low) * np.array(counts))
        return self._none, _halves(rest, wide[steepest])

    def _values(self, x, units):
        self.used += len(x)
        return self.functions.values(x, units)

    def _beyond(self, piece, at, scale, centre):
        """Bounds on the size of each function on the ellipse about one number, with the others
        at COARSE_PLACES, infinite near a pole; and the change of its logarithm along each of the
        others."""
        count = piece.wide.size
        coarse = _grid([COARSE_PLACES] * (count - 1))
        places = coarse.astype(complex)[:, None].repeat(RIM_POINTS, 1)
        places = np.insert(places, at, NUMBER_RIM, axis=2).reshape(-1, count)
        _, log, error, pivots = self._values(piece.placed(places), piece.units)
        log = scale.removed(log + np.log1p(np.minimum(EPS * error, 10.0)), places)
        log = log.reshape(len(log), *[len(COARSE_PLACES)] * (count - 1), RIM_POINTS)
        # Between two points it may be larger than at both, by no more than they differ.
        axes = tuple(range(1, count + 1))
        steps = [np.abs(np.diff(log, axis=axis)).max(axes) for axis in axes]
        size = 2 * np.exp(log.max(axes) + sum(steps) / 2)
        # a pole may be inside
        turns = np.abs(pivots / np.where(centre == 0, 1.0, centre) - 1).max(initial=0.0) >= 1
        changes = []
        for axis in range(count):
            changes.append(0.0 if axis == at else steps[axis - (axis > at)].max())
        changes = np.nan_to_num(changes, posinf=1e9)
        return np.where(np.isfinite(size) & ~turns, size, np.inf), changes


def _grid(nodes):
    """All combinations of places of each number, a row each."""
    rows = int(np.prod([len(places) for places in nodes]))
    return np.array(list(product(*nodes)), float).reshape(rows, len(nodes))


def _halves(ends, axis):
    """The halves of a piece along a number, in the logarithm if its ends differ by much."""
    low, high = ends[:, axis]
    middle = (low + high) / 2
    if high > LOGARITHMIC_FROM * low > 0:
        middle = np.sqrt(low * high)
    lower = ends.copy()
    lower[1, axis] = middle
    upper = ends.copy()
    upper[0, axis] = middle
    return [lower, upper]


def _trend(log, grid):
    """The exponential growth rate of each function with each number, by least squares."""
    regressors = np.column_stack([grid, np.ones(len(grid))])
    return np.linalg.lstsq(regressors, log.T, rcond=None)[0][:-1].T


@lru_cache
def _to_bernstein(count):
    """From coefficients of Chebyshev polynomials to Bernstein coefficients on [-1, 1]."""
    k = np.arange(count)
    x = np.linspace(-1, 1, count)
    T = np.polynomial.chebyshev.chebvander(x, count - 1)
    B = np.stack(
        [
            comb(count - 1, j) * ((1 + x) / 2) ** j * ((1 - x) / 2) ** (count - 1 - j)
            for j in k.tolist()
        ],
        axis=1,
    )
    return np.linalg.solve(B, T)


def _turned(array, matrices):
    """The array with a matrix applied along each axis."""
    for axis, matrix in enumerate(matrices):
        array = along(matrix, array, axis)
    return array


def _positive(values, noise):
    """The parts of [-1, 1]^n in which an interpolant is not proved to exceed the noise, as pairs
    (low, high).

    Small terms of high degree are dropped, and their size is added to the noise: the rest is
    divided faster, and its Bernstein coefficients lose fewer digits.
    """
    dimensions = values.ndim
    series = _turned(values, map(to_series, values.shape))
    noise += 2**dimensions * values.size * EPS * np.abs(values).max()
    series, left_out = _shortened(series, SHORTENED_BY * max(values.min() - noise, 0.0))
    to = list(map(_to_bernstein, series.shape))
    noise += left_out
    rounding = (
        50 * EPS * np.abs(series).sum() * np.prod([np.linalg.norm(matrix, np.inf) for matrix in to])
    )
    pieces = _turned(series, to)
    pieces = pieces[None]
    low = np.full((1, dimensions), -1.0)
    high = np.full((1, dimensions), 1.0)
    over = tuple(range(1, dimensions + 1))
    for _ in range(9 * dimensions):  # halvings of an interpolant, for each number
        open_ = pieces.min(over) <= noise + rounding
        pieces = pieces[open_]
        low = low[open_]
        high = high[open_]
        if not len(pieces) or len(pieces) > MOST_PIECES:
            break
        slopes = [
            np.abs(np.diff(pieces, axis=1 + axis)).max(over, initial=0.0)
            for axis in range(dimensions)
        ]
        steepest = np.stack(slopes).argmax(0)
        halves = []
        for axis in np.unique(steepest):
            index = steepest == axis
            lower = low[index]
            upper = high[index]
            middle = (lower[:, axis] + upper[:, axis]) / 2
            below = upper.copy()
            above = lower.copy()
            below[:, axis] = above[:, axis] = middle
            halves += zip(
                _halved(pieces[index], 1 + axis), (lower, above), (below, upper), strict=True
            )
        pieces, low, high = (np.concatenate(arrays) for arrays in zip(*halves, strict=True))
    return list(zip(low, high, strict=True))


def _shortened(series, room):
    """The series without its highest degrees in each number, and the sum of the dropped terms,
    at most `room`."""
    size = np.abs(series)
    low = []
    for axis in range(size.ndim):
        by_degree = size.sum(tuple(i for i in range(size.ndim) if i != axis))
        tail = np.cumsum(by_degree[::-1])[::-1]  # of this degree and all above
        low.append(slice(max(1, int((tail > room / size.ndim).sum()))))
    low = tuple(low)
    return series[low], size.sum() - size[low].sum()


def _halved(b, axis):
    """The Bernstein coefficients of both halves, by de Casteljau's algorithm."""
    b = np.moveaxis(b, axis, -1)
    count = b.shape[-1]
    left = []
    right = []
    now = b
    for _ in range(count):
        left.append(now[..., 0])
        right.append(now[..., -1])
        now = (now[..., :-1] + now[..., 1:]) / 2
    return np.moveaxis(np.stack(left, -1), -1, axis), np.moveaxis(
        np.stack(right[::-1], -1), -1, axis
    )


@lru_cache(maxsize=64)
def nodes(count: int) -> np.ndarray:
    """Return so many Chebyshev nodes on [-1, 1]."""
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


@lru_cache(maxsize=64)
def to_series(count: int) -> np.ndarray:
    """Return the matrix from values at the nodes to the coefficients of Chebyshev polynomials."""
    series = 2 / count * np.cos(np.outer(np.arange(count), np.arccos(nodes(count))))
    series[0] /= 2
    return series


def along(matrix: np.ndarray, array: np.ndarray, axis: int) -> np.ndarray:
    """Return the array with a matrix applied along an axis."""
    return np.moveaxis(np.tensordot(matrix, array, (1, axis)), 0, axis)
