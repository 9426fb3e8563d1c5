"""Roots of analytic functions on an interval: Chebyshev panels, split until their roots are proved."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals.isolate import isolate

NODES, KEPT = 20, 14  # samples per panel; the Chebyshev coefficients from KEPT on must have decayed and bound the error
DECAYED = 1e-9
OVERLAP = 0.035  # of its width a panel reaches into each neighbour, so that no root stays on an edge for ever
DEGREES = (1, 2, 4, 7, 10, KEPT)  # an interpolant is cut to each of these in turn, what is cut away added to its error
NODE = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
TRANSFORM = np.cos(np.outer(np.arccos(NODE), np.arange(NODES))) * (2 / NODES)
NODE.flags.writeable = TRANSFORM.flags.writeable = False


@dataclass(frozen=True, slots=True)
class Found:
    """Roots found: which column, which function, where to within what, sign of the slope; which columns are all proved, but
    for the first and the last bit of the interval, where roots may be left in the columns open_low and open_high."""

    column: np.ndarray
    function: np.ndarray
    x: np.ndarray
    within: np.ndarray
    slope_sign: np.ndarray
    complete: np.ndarray
    open_low: np.ndarray
    open_high: np.ndarray


def panel_roots(sample, column, low, high, columns, smallest, many, bounds=(-np.inf, np.inf), end_bit=0.0) -> Found:
    """Find all roots of several functions of each column.

    sample(column, x): for panels (their columns, `(panels,)`, and points, `(panels, NODES)`) the functions' values and the
    size of what was added up for them, each `(functions, panels, NODES)`. column, low, high: the first panels.
    columns: how many columns there are. smallest: a panel narrower than this that proves nothing gives its column up;
    many: so many open panels of one column do so too. bounds: points beyond them are never asked for. end_bit: a panel at
    an end of the interval that is narrower than this and proves nothing is left open.

    On each panel the interpolant at NODES points must have decayed, and `isolate` must prove its roots for every function
    within the error bound; else the panel is split. What could be missed is a feature so narrow that it leaves no trace in
    the samples of a panel whose coefficients have decayed by nine digits.
    """
    complete, found, ends = np.ones(columns, bool), [], (low.min(initial=np.inf), high.max(initial=-np.inf))
    open_low, open_high = np.zeros(columns, bool), np.zeros(columns, bool)
    while column.size:
        reach = OVERLAP * (high - low)
        left, right = np.maximum(low - reach, bounds[0]), np.minimum(high + reach, bounds[1])
        middle, half = (left + right) / 2, (right - left) / 2
        value, size = sample(column, middle[:, None] + half[:, None] * NODE)
        good = np.ones(column.size, bool)
        pieces = []
        for function in range(value.shape[0]):
            coefficients, noise, decayed = _interpolate(value[function], size[function])
            proved = np.zeros(column.size, bool)
            for rows, roots in _proved_roots(coefficients, noise):
                proved[rows] = decayed[rows]
                at, which = np.nonzero(roots.inside & decayed[rows, None])
                panel = rows[at]
                pieces.append((panel, np.full(panel.size, function), middle[panel] + half[panel] * roots.value[at, which],
                               half[panel] * roots.radius[at, which], roots.slope_sign[at, which]))
            good &= proved
        found += [(column[panel][good[panel]], *(part[good[panel]] for part in rest)) for panel, *rest in pieces]
        left_open = [~good & (end == ends[i]) & (high - low < end_bit) for i, end in enumerate((low, high))]
        open_low[column[left_open[0]]], open_high[column[left_open[1]]] = True, True
        good |= left_open[0] | left_open[1]
        complete[column[~good & ~(high - low > smallest)]] = False
        column, low, high = _halves(column, low, high, ~good & complete[column])
        complete[np.bincount(column, minlength=columns) > many] = False
        open_ = complete[column]
        column, low, high = column[open_], low[open_], high[open_]
    parts = [np.concatenate(part) for part in zip(*found, strict=True)] if found else [np.zeros(0, int)] * 2 + [np.zeros(0)] * 3
    return Found(*parts, complete, open_low, open_high)


def _interpolate(value, size):
    """Second-kind Chebyshev coefficients `(panels, KEPT)`, their error bound on the panel, and whether they decayed."""
    value = np.where(np.isfinite(value), value, 0.0)
    # A sum and not a matrix product: BLAS may round a row differently in another batch, and bytes must not change.
    first = (value[..., None] * TRANSFORM).sum(-2)
    first[:, 0] /= 2
    largest, tail = np.abs(first).max(-1), np.abs(first[:, KEPT:]).max(-1)
    floor = 4 * NODES * np.finfo(float).eps * size.max(-1)
    second = first[:, :KEPT] / 2
    second[:, 0] *= 2
    second[:, :-2] -= first[:, 2:KEPT] / 2
    return second, NODES * (8 * tail + floor), np.isfinite(size).all(-1) & (tail <= np.maximum(DECAYED * largest, floor))


def _proved_roots(coefficients, noise):
    """Proved roots of the interpolants, as (rows, Roots) pairs; each row is tried at the lowest degree first.

    High coefficients that have decayed to rounding would leave the discs without a leading coefficient to stand on.
    """
    weight = np.arange(1, KEPT + 1) * np.abs(coefficients)
    rows = np.arange(noise.size)
    for degree in DEGREES:
        roots = isolate(coefficients[rows, :degree], noise[rows] + weight[rows, degree:].sum(-1))
        proved = roots.proved & ~roots.open_at_one & ~roots.open_at_minus_one
        yield rows[proved], roots.rows(proved)
        rows = rows[~proved]


def _halves(column, low, high, split):
    column, low, high = column[split], low[split], high[split]
    cut_at = low + 0.48 * (high - low)  # not the middle, where symmetric loops put their roots
    return np.tile(column, 2), np.concatenate([low, cut_at]), np.concatenate([cut_at, high])
