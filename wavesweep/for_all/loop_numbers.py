"""The frames of a loop over a box of numbers: ticks interpolated once in all numbers, and their products as polynomials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby, product

import numpy as np

from wavesweep.engine.monodromy.product import pattern_of
from wavesweep.engine.stability.positive import along, nodes, to_series
from wavesweep.engine.stability.sampled_frames import level, pole_inside
from wavesweep.for_all.loop_frames import Symbol, alive
from wavesweep.for_all.polynomials import UNIT, Polynomials, monomials, to_powers

ORDER = 5  # total degree of the polynomials
MOST_COUNT = 20  # of nodes for a number
MOST_NODES = 6000  # in all
ELLIPSE, RIM_POINTS = 3.0, 12  # sum of the semi-axes of the ellipse about a number, and points on its upper half
RIM = ELLIPSE * np.exp(1j * np.pi * (np.arange(RIM_POINTS) + 0.5) / RIM_POINTS)
RIM = (RIM + 1 / RIM) / 2
EXTENT = (ELLIPSE + 1 / ELLIPSE) / 2
SAFE = 8.0  # times the largest size at the points of a rim
SPARED = 1e-11  # of the size of the entries, for each number: coefficients that are left out
MOST_FUNCTIONS, SAME = 200, 1e-13  # functions of which ticks are sums, and how well, relative to the size of an entry
CLOSE = 1e-9  # largest error of an interpolant that is wanted, relative to the size of the entries

Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""From points `(points, numbers)` to the changes of each kind of tick, `(kinds, points, n, n)`, bounds on their errors, and
what is zero where these have a pole, `(points, k)`."""


@dataclass(frozen=True, slots=True, eq=False)
class TickSeries:
    """The ticks of a loop over a box of numbers, as Chebyshev series.

    box: `(2, numbers)`; series: `(n_1, ..., n_numbers, functions)` of some entries of `I + E`, of which all entries are sums by
    `weights`, `(functions, kinds, n, n)`; error: `(kinds, n, n)`, bounds.
    """

    box: np.ndarray
    series: np.ndarray
    weights: np.ndarray
    error: np.ndarray

    @staticmethod
    def of(evaluate: Evaluate, box: np.ndarray, counts: Sequence[int]) -> TickSeries | int:
        """Interpolate at so many nodes in each number; or return that along which a pole may be in the ellipse.

        Accuracy: along each number the error at real places is at most that on an ellipse about it, times how much smaller
        the polynomial of the nodes is there, if no pole is inside. It is looked at in RIM_POINTS of each ellipse, the other
        numbers being at nodes.
        """
        middle, half = box.mean(0), (box[1] - box[0]) / 2
        grid = np.array(list(product(*map(nodes, counts))))
        E, dE, pivots = evaluate(middle + half * grid)
        pivots = pivots.reshape(*counts, -1)
        kinds, n = len(E), E.shape[-1]
        values = (E + np.eye(n)).reshape(kinds, *counts, n, n)
        lebesgue = np.prod([2 / np.pi * np.log(count) + 1 for count in counts])
        error = 2 * lebesgue * (dE.max(1) + 8 * len(grid) * UNIT * np.abs(values).reshape(kinds, -1, n, n).max(1))
        for axis, count in enumerate(counts):
            if half[axis] > 0:
                missed = _missed(evaluate, values, pivots, middle, half, counts, axis, count)
                if missed is None:
                    return axis
                error += lebesgue * SAFE * missed
        for axis, count in enumerate(counts):
            values = along(to_series(count), values, 1 + axis)
        samples = np.moveaxis(values, 0, -3).reshape(len(grid), -1)
        few, weights, left = _few(samples)
        few = few.reshape(*counts, -1)
        return TickSeries(box, few, weights.reshape(-1, kinds, n, n), error + left.reshape(error.shape))

    def part(self, box: np.ndarray) -> TickSeries:
        """The series of a part of the box, without coefficients that hardly count there, which are part of the error."""
        middle, half, series = self.box.mean(0), (self.box[1] - self.box[0]) / 2, self.series
        nodes_of, sizes = tuple(range(series.ndim - 1)), np.abs(self.weights)
        tail_sum = 16 * sum(series.shape[:-1]) * UNIT * np.abs(series).sum(nodes_of)
        for axis in np.flatnonzero((box != self.box).any(0)):
            count = series.shape[axis]
            places = (box[:, axis].mean() - middle[axis] + (box[1, axis] - box[0, axis]) / 2 * nodes(count)) / half[axis]
            moved = to_series(count) @ np.polynomial.chebyshev.chebvander(np.clip(places, -1, 1), count - 1)
            series = along(moved if box[0, axis] < box[1, axis] else moved[:1], series, axis)
        size = np.abs(series)
        most = np.tensordot(size.max(nodes_of), sizes, 1).max(0)
        least = np.full_like(sizes, np.inf)  # nothing is lost where an entry does not have the function
        spared = np.divide(SPARED * (most + most @ most), sizes, out=least, where=sizes > 0).min((1, 2, 3))
        for axis in nodes_of:
            other_axes = tuple(other_axis for other_axis in nodes_of if other_axis != axis)
            tail = np.cumsum(size.sum(other_axes)[::-1], 0)[::-1]  # of this degree and all above
            needed = (tail > spared).any(1)
            orders = max(1, int(needed.sum()))
            if orders < needed.size:
                tail_sum = tail_sum + tail[orders]
                series, size = (np.take(array, range(orders), axis) for array in (series, size))
        return TickSeries(box, series, self.weights, self.error + np.tensordot(tail_sum, sizes, 1))

    def polynomials(self, order: int = ORDER) -> Polynomials:
        """The ticks in the box, as polynomials of a total degree in the numbers that are wide there."""
        axes, sizes = np.flatnonzero(self.box[0] < self.box[1]), np.abs(self.weights)
        series = self.series.reshape(*(self.series.shape[axis] for axis in axes), -1)
        order, nodes_of = order if axes.size else 0, tuple(range(axes.size))
        exponents = monomials(axes.size, order)[0]
        degree = sum(np.ix_(*(np.arange(size) for size in series.shape[:-1]))) if axes.size else np.zeros(())
        low = np.where((degree <= order)[..., None], series, 0.0)
        rest = np.abs(series - low).sum(nodes_of)
        low = low[tuple(slice(order + 1) for _ in axes)]
        for axis, size in enumerate(low.shape[:-1]):
            low = along(to_powers(size), low, axis)
        terms = np.zeros((len(exponents), series.shape[-1]))
        for i, exponent_row in enumerate(exponents.tolist()):
            if all(power < size for power, size in zip(exponent_row, low.shape[:-1], strict=True)):
                terms[i] = low[tuple(exponent_row)]
        rounding = (8 * 2**order * np.abs(series).sum(nodes_of) + 2 * len(sizes) * np.abs(terms).sum(0)) * UNIT
        error = self.error + np.tensordot(rest + rounding, sizes, 1)
        return Polynomials(np.tensordot(terms, self.weights, 1), error, axes.size, order)


def _few(whole):
    """Some of the columns, the weights by which all are sums of these, and bounds on what is left, for each column.

    Ticks of frames of many lengths differ in few functions of the numbers. The columns and weights are found from some random
    sums of the rows; what they leave is summed up.
    """
    from scipy.linalg import qr, solve_triangular

    size = np.abs(whole).sum(0)
    scaled = whole / np.where(size > 0, size, 1.0)
    sums = np.random.default_rng(0).normal(size=(min(len(whole), MOST_FUNCTIONS), len(whole))) @ scaled
    R, order = qr(sums, mode="r", pivoting=True)
    count = max(1, int((np.abs(np.diagonal(R)) > SAME * abs(R[0, 0])).sum()))
    few, weights = order[:count], np.zeros((count, len(size)))
    weights[:, order] = solve_triangular(R[:count, :count], R[:count])
    weights = weights * size / np.where(size > 0, size, 1.0)[few, None]
    left = np.abs(whole - whole[:, few] @ weights).sum(0)
    return whole[:, few], weights, left + 2 * (count + 2) * UNIT * (size[few] @ np.abs(weights) + size)


def _missed(evaluate, values, pivots, middle, half, counts, axis, count):
    """A bound on the error of the interpolation along a number, `(kinds, n, n)`, but for points between those looked at.

    None if a pole may be inside.
    """
    coarse = [np.unique([0, size // 2, size - 1]) if at != axis else np.array([0]) for at, size in enumerate(counts)]
    index = list(product(*coarse))
    points = np.array([[nodes(size)[i] for size, i in zip(counts, multi_index, strict=True)] for multi_index in index], complex)
    points = np.repeat(points, RIM_POINTS, 0)
    points[:, axis] = np.tile(RIM, len(index))
    E, _, around = evaluate(middle + half * points)
    within = np.stack([pivots[(*multi_index[:axis], slice(None), *multi_index[axis + 1 :])] for multi_index in index])
    if pole_inside(around.reshape(len(index), RIM_POINTS, -1), level(within)).any():
        return None
    kinds, n = len(E), E.shape[-1]
    rim = (E + np.eye(n)).reshape(kinds, len(index), RIM_POINTS, n, n)
    lines = np.stack(
        [values[(slice(None), *multi_index[:axis], slice(None), *multi_index[axis + 1 :])] for multi_index in index], 1
    )
    basis = np.polynomial.chebyshev.chebvander(RIM, count - 1) @ to_series(count)
    model = np.einsum("rj,kijnm->kirnm", basis, lines)
    vanishing = np.abs(np.polynomial.chebyshev.chebval(RIM, np.eye(count + 1)[-1]))  # |T_count| is at most 1 at real places
    return (np.abs(rim - model) / vanishing[:, None, None]).max((1, 2))


def _in_units(evaluate, units, points):
    E, dE, pivots = evaluate(points)
    unit = np.exp(points @ units)
    ratio = unit[:, :, None] / unit[:, None, :]
    return E * ratio, dE * np.abs(ratio), pivots


def _counts(evaluate, box):
    """The number of nodes for each number, from the decay of the coefficients along it in the middle of the others."""
    (wide,), middle, half = np.nonzero(box[0] < box[1]), box.mean(0), (box[1] - box[0]) / 2
    points = np.repeat(middle[None], wide.size * MOST_COUNT, 0)
    for i, axis in enumerate(wide):
        points[i * MOST_COUNT : (i + 1) * MOST_COUNT, axis] += half[axis] * nodes(MOST_COUNT)
    E = evaluate(points)[0]
    values = (E + np.eye(E.shape[-1])).reshape(len(E), wide.size, MOST_COUNT, *E.shape[-2:])
    size = np.abs(values).max((0, 1, 2), initial=0.0)
    counts = np.ones(box.shape[1], int)
    series = np.abs(along(to_series(MOST_COUNT), values, 2)).max(0)
    needed = (series > CLOSE * (size + size @ size)).any((2, 3))
    counts[wide] = 2 + np.max(np.arange(MOST_COUNT) * needed, axis=1)
    return np.minimum(counts, MOST_COUNT).tolist()


@dataclass(frozen=True, slots=True, eq=False)
class FramesOver:
    """The frames of a loop over a box of sides, which numbers are functions of.

    rows, samples, symbols, kept: see `LoopFrames`.
    """

    series: TickSeries
    rows: tuple[tuple[int, ...], ...]
    samples: tuple[int, ...]
    symbols: tuple[Symbol, ...]
    kept: np.ndarray

    @property
    def states(self) -> int:
        """The number of states, including those that every frame forgets."""
        return self.series.weights.shape[-1]

    @staticmethod
    def of(evaluate: Evaluate, box: np.ndarray, rows, samples, symbols, units=None) -> FramesOver | int:
        """Return the frames; or the side along which the box has to be divided first, for a pole or too many nodes.

        units: `(sides, n)`; the states x are replaced by `exp(units' s) x`, which are similar at every s.
        """
        if units is not None:
            evaluate = partial(_in_units, evaluate, units)
        counts = _counts(evaluate, box)
        if np.prod(counts) > MOST_NODES:
            return int(np.argmax(counts))
        series = TickSeries.of(evaluate, box, counts)
        if isinstance(series, int):
            return series
        inside = box[0] + (box[1] - box[0]) * np.array([[0.3], [0.7]])
        changes = list(evaluate(inside)[0])
        patterns = [pattern_of(np.array([*row, sample]), changes) for row, sample in zip(rows, samples, strict=True)]
        states = alive(np.logical_or.reduce(patterns), np.arange(changes[0].shape[-1]))
        return FramesOver(series, rows, samples, symbols, states)

    def part(self, box: np.ndarray) -> FramesOver:
        """The frames in a part of the box."""
        return replace(self, series=self.series.part(box))

    def polynomials(self, order: int = ORDER) -> Polynomials:
        """The matrices of all symbols in the box."""
        ticks, powers_known, powers = self.series.polynomials(order), {}, {}

        def power(kind, count):
            if (kind, count) not in powers:
                tick = ticks.of(kind)
                if count == 1:
                    powers[kind, count] = tick
                elif count % 2:
                    powers[kind, count] = tick @ power(kind, count - 1)
                else:
                    powers[kind, count] = power(kind, count // 2) @ power(kind, count // 2)
            return powers[kind, count]

        def joined(row):
            if row not in powers_known:
                runs = [(kind, len(list(run))) for kind, run in groupby(row)]
                if row[:-1] in powers_known:
                    powers_known[row] = ticks.of(row[-1]) @ powers_known[row[:-1]]
                elif len(runs) == 1:
                    powers_known[row] = power(*runs[0])
                else:  # in halves, since what is left out grows with the depth, and what repeats is multiplied once
                    first = sum(length for _, length in runs[: 1 << (len(runs) - 1).bit_length() - 1])
                    powers_known[row] = joined(row[first:]) @ joined(row[:first])
            return powers_known[row]

        rows = sorted(set(self.rows), key=len)
        products = {row: joined(row) for row in rows if row}
        n = ticks.terms.shape[-1]
        identity = Polynomials(np.zeros((len(ticks.terms), n, n)), np.zeros((n, n)), ticks.numbers, ticks.order)
        identity.terms[0] = np.eye(n)
        of_rows = [products.get(row, identity) for row in self.rows]
        of_rows, at = ticks.of(list(self.samples)) @ _stacked(of_rows), np.ix_(self.kept, self.kept)
        return Polynomials(of_rows.terms[..., *at], of_rows.rest[..., *at], ticks.numbers, ticks.order)


def _stacked(polynomials):
    """Polynomials of matrices as one of a stack of matrices."""
    terms = np.stack([polynomial.terms for polynomial in polynomials], 1)
    rest = np.stack([polynomial.rest for polynomial in polynomials])
    return Polynomials(terms, rest, polynomials[0].numbers, polynomials[0].order)
