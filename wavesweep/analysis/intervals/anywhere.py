"""Stable intervals along any number of a loop, from its eigenvalues."""

from dataclasses import replace

import numpy as np

from wavesweep.analysis.intervals.bracket import bracketed_roots
from wavesweep.analysis.intervals.panels import panel_roots
from wavesweep.analysis.intervals.regions import count_where_clear, cut_span
from wavesweep.analysis.intervals.stable import Intervals, intervals_of

ATTACHED = 1e-9  # of the span; a crossing so near to its low end, where a gain of zero leaves a drift, is given as there
NARROWEST = 1e-10  # of the span; a panel this narrow that proves nothing gives its column up
MANY = 128  # so many open panels of one column do so too
PAIR, ONE, MINUS_ONE = 0, 1, 2  # the three functions: a complex pair, z = 1, z = -1
WIDE = 6.0  # ratio of the span's ends above which its logarithm is the variable
LARGEST = 1e150  # of an entry; products of two eigenvalues overflow beyond
CLEAR = 1e-10  # | |z|^2 - 1 | at an end, up to which the end is believed


def stable_anywhere(evaluate, span, columns: int, period, bounds=(-np.inf, np.inf)) -> Intervals:
    """All stable intervals within span = (low, high) of a parameter that may enter in any smooth way; see `_stable`.

    Over a span of several octaves its logarithm is the variable: masses, impedances and cutoffs act by their ratios.
    """
    low, high = span
    if not (low > 0 and high > WIDE * low):
        return _stable(evaluate, span, columns, period, bounds)
    logs = tuple(np.log(end) if end > 0 else -np.inf for end in (low, high, *bounds))
    found = _stable(lambda column, t: evaluate(column, np.exp(t)), logs[:2], columns, period, logs[2:])
    # The range's own ends are given back as they were, not as exp(log(end)).
    ends = [np.where(part == log, end, np.exp(part)) for part, log, end in
            ((found.low, logs[0], low), (found.high, logs[1], high))]
    return replace(found, low=ends[0], high=ends[1])


def _stable(evaluate, span, columns, period, bounds) -> Intervals:
    """All stable intervals of every column within span = (low, high) of a parameter p that may enter in any smooth way.

    evaluate(column, p): `(n, order, order)` frame-to-frame matrices less identity of these columns at these values.
    period: of the frame, s, `(columns,)`. bounds: p beyond them has no loop.

    With eigenvalues z_i of the frame, `prod_{i<j} (1 - z_i z_j)`, `prod (1 - z_i)` and `prod (1 + z_i)` are real analytic
    functions of p that vanish where a complex pair, z = 1 or z = -1 is on the unit circle (the first also where two real
    eigenvalues are reciprocal: then the counts do not change). Their roots are found and proved on Chebyshev panels
    (`panels`), polished on the eigenvalue itself, and the counts of unstable eigenvalues at the middle of every region
    must change by 2 or 1 accordingly.
    Certified rests on the panels' decay: two crossings can be missed together only if they are so close that no trace of
    them is left in 20 samples of a panel on which the functions are otherwise polynomials of degree 13 to nine digits.
    Accuracy: ends to 1e-9 relative, usually 1e-13; those within 1e-9 of the span of its low end are given as that end.
    """
    low, high = span
    everyone = np.arange(columns)

    def sample(column, p):
        sign, log, error = (
            part.reshape(3, *p.shape) for part in _criticals(evaluate(np.repeat(column, p.shape[-1]), p.ravel()))
        )
        peak = log.max(-1, keepdims=True)
        with np.errstate(invalid="ignore"):  # where a sample has overflowed the panel proves nothing
            size = np.exp(np.where(np.isfinite(peak), log - peak, np.inf))
            return sign * size, size * error

    found = panel_roots(sample, everyone, np.full(columns, float(low)), np.full(columns, float(high)), columns,
                        NARROWEST * (high - low), MANY, bounds)
    column, kind, value, theta, miss, good = _polished(evaluate, found, high - low)
    proved = found.complete.copy()
    proved[column[~good]] = False
    crossing = (kind != PAIR) | (theta > 0)  # a reciprocal pair of real eigenvalues crosses nothing
    column, kind, value, theta, miss = (part[crossing] for part in (column, kind, value, theta, miss))
    jump = np.where(kind == PAIR, 2.0, 1.0)
    parts = cut_span(span, columns, column, value, theta, jump, slack=ATTACHED * (high - low))
    everywhere = np.arange(parts.column.size)
    unstable, clear = count_where_clear(parts, everywhere, lambda some, value: evaluate(parts.column[some], value))
    change = np.abs(unstable[parts.later] - unstable[parts.earlier])
    regions = parts.labelled(unstable, clear, change == parts.gain[parts.later], np.abs(miss[parts.order]))
    proved[regions.column[~regions.sound]] = False
    return intervals_of(regions, proved, period)


def _criticals(E):
    """Sign and logarithm of the three functions, `(3, n)` each, and how far rounding can reach, relative to each."""
    finite = (np.abs(E) < LARGEST).all((-1, -2))
    w = np.linalg.eigvals(np.where(finite[:, None, None], E, 0.0)).astype(complex)
    i, j = np.triu_indices(w.shape[-1], 1)
    # An eigenvalue is good to eps times the size of the matrix, and a small factor has nothing else to stand on.
    scale = np.maximum(1, np.abs(E).max((-1, -2)))
    signs, logs, errors = [], [], []
    for factor in (-(w[:, i] + w[:, j] + w[:, i] * w[:, j]), -w, 2 + w):
        magnitude = np.maximum(np.abs(factor), 1e-300)
        signs.append(np.where(finite, np.sign((factor / magnitude).prod(-1).real), np.nan))
        logs.append(np.where(finite, np.log(magnitude).sum(-1), np.inf))
        with np.errstate(over="ignore"):
            errors.append(np.minimum(scale / np.maximum(magnitude.min(-1, initial=1.0), 1e-30), 1e12))
    return np.stack(signs), np.stack(logs), np.stack(errors)


def _polished(evaluate, found, width):
    """Every root that was found, to rounding, duplicates of overlapping panels dropped: (column, function, p, angle of the
    eigenvalue, how far it is from its place, whether all is well)."""
    column, kind = found.column, found.function
    reach = np.minimum(found.within, 0.1 * width) + 1e-9 * width  # the disc, which no other root is in

    def value(at, x):
        sign, log, _ = _criticals(evaluate(column[at], x))
        return sign[kind[at], np.arange(at.size)], log[kind[at], np.arange(at.size)]

    x, bracketed = bracketed_roots(value, found.x - reach, found.x + reach)
    miss, theta = _nearest(evaluate, column, x, kind)
    good = bracketed & (np.abs(miss) <= CLEAR)
    order = np.lexsort((x, kind, column))
    column, kind, x, theta, miss, good = (part[order] for part in (column, kind, x, theta, miss, good))
    new = np.ones(x.size, bool)
    new[1:] = (np.diff(column) != 0) | (np.diff(kind) != 0) | (np.diff(x) > 1e-10 * width)
    return column[new], kind[new], x[new], theta[new], miss[new], good[new]


def _nearest(evaluate, column, x, kind):
    """How far the nearest eigenvalue of that kind is from its place on the circle (1 - |z|^2, or 1 - z_i z_j of a
    reciprocal pair; |z|^2 - 1 at z = +-1), and its angle (0 for a reciprocal pair)."""
    if not x.size:
        return np.zeros(0), np.zeros(0)
    w = np.linalg.eigvals(evaluate(column, x)).astype(complex)
    i, j = np.triu_indices(w.shape[-1], 1)
    pair = -(w[:, i] + w[:, j] + w[:, i] * w[:, j])
    best = np.argmin(np.abs(pair), axis=-1)[:, None]
    first = np.take_along_axis(w[:, i], best, -1)[:, 0]
    single = np.take_along_axis(w, np.argmin(np.where(kind[:, None] == ONE, np.abs(w), np.abs(w + 2)), -1)[:, None], -1)[:, 0]
    miss = np.where(kind == PAIR, np.take_along_axis(pair, best, -1)[:, 0].real, 2 * single.real + np.abs(single) ** 2)
    theta = np.where(kind == PAIR, np.abs(np.angle(1 + first)) * (first.imag != 0), np.where(kind == ONE, 0.0, np.pi))
    return miss, theta
