"""Loops with long delays along a number: where eigenvalues cross the unit circle, proved without computing them.

An eigenvalue z is where `S = z - 1 - A - C L(z) B` is singular: A, B and C of the states that no delay line has, closed by the
lines L, which are of any length. In a box of angles and of the number, S is nonsingular if, with its value S0 in the middle,

    |S0^-1 S_theta| a + |S0^-1 S_x| b + |S0^-1| (a^2/2 R_tt + a b R_tx + b^2/2 R_xx + rounding)

takes some positive weights to less: a and b are half of the sides, and R bound the second derivatives all over the box. Boxes
that are not proved are halved. About what is left Newton's method finds crossings; windows about these, as narrow as ends are
exact, are left out of the range, and the rest is proved. Between windows no eigenvalue crosses, so one count holds for all.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.monodromy.resolvent import DelayLines
from wavesweep.engine.monodromy.unit_circle import inverse, solve
from wavesweep.engine.rows import Rows
from wavesweep.engine.stability.covering import FIRM, OVERLAID, WINDOW, Tiles
from wavesweep.engine.stability.entries import EPS, Panels
from wavesweep.engine.stability.spectrum import count_outside

LONG = 24  # states of delay lines, from which on this costs less than eigenvalues
TURN = 1.0  # rad by which the longest line turns over an arc at first
SPLITS = 12  # times that a box is halved before Newton's method looks for a crossing in it
NEXT, STEPS = 4, 8  # sizes of a box to the crossing next to it, at most; steps of Newton's method towards that
CONVERGED, BESIDE = 1e-9, 1e-7  # the last step; next to a crossing, in parts of a panel, where S is not singular
MOST_TERMS = 1000  # of S
MOST_SPLITS, MOST_BOXES = 120, 300_000  # of a box; of a column
SHRINKS, SURELY = 0.93, 0.95  # of weights, what is wanted to be left of them, and what is left at most
ROUNDED = 256 * EPS  # of the terms of a sum, and so much for each state of a line, three quarters of it for its link
ENTRIES = 2**19  # of what delay lines show, at a time
LINKED = 0.75 * ROUNDED  # of a link of a delay line, which is 1
BEYOND = 1e-7  # by which a circle is larger than the unit circle, outside of which another eigenvalue is while one crosses
SHARES = (0.5, 0.37, 0.71, 0.13, 0.91)  # of a stretch, where eigenvalues are counted


@dataclass(frozen=True, slots=True)
class _Boxes(Rows):
    """Boxes of panels: middle and half of each side, x on the panel and theta; splits: how often each was halved."""

    panel: np.ndarray
    x: np.ndarray
    wide: np.ndarray
    theta: np.ndarray
    arc: np.ndarray
    splits: np.ndarray


class _Bounds(NamedTuple):
    """Bounds on the second derivatives of S by the angle, by both, and by x, and on its rounding."""

    by_angle: np.ndarray
    by_both: np.ndarray
    by_x: np.ndarray
    rounding: np.ndarray


class _Crossings(NamedTuple):
    """Crossings at x of panels, the angles of the eigenvalues there, and how far rounding may move them along x."""

    panel: np.ndarray
    x: np.ndarray
    theta: np.ndarray
    moved: np.ndarray


class ReducedEquation:
    """S and its derivatives on panels, for the states that no delay line has: `z - 1 - A - sum_m G_m z^-m`.

    A term of G is the product of an entry of B, from where a state enters a line, and one of C, from where the line is read m
    steps later.
    """

    def __init__(self, panels: Panels, lines: DelayLines) -> None:
        solved, self.panels, self.n = lines.solved, panels, lines.solved.size
        nonzero = (np.abs(panels.coefficients).sum(1) + panels.error > 0).any(0)
        terms = [
            (row, column, entered, read, 1 + later - first)
            for line in lines.lines
            for first, entered in enumerate(line.tolist())
            for column in np.flatnonzero(nonzero[entered, solved]).tolist()
            for later, read in list(enumerate(line.tolist()))[first:]
            for row in np.flatnonzero(nonzero[solved, read]).tolist()
        ]
        row, column, entered, read, self.lag = np.array(terms, int).reshape(-1, 5).T
        self.place = np.zeros((row.size, self.n**2))
        self.place[np.arange(row.size), row * self.n + column] = 1
        places = (solved[:, None], solved), (entered, solved[column]), (solved[row], read)
        c, error = (
            [array[..., rows, columns].reshape(*array.shape[:-2], -1) for rows, columns in places]
            for array in (panels.coefficients, panels.error)
        )
        self.sizes = np.cumsum([entries.shape[-1] for entries in error])[:-1]
        c, self.error = np.concatenate(c, -1), np.concatenate(error, -1)
        self.degrees, self.longest = np.arange(c.shape[1]), max(map(len, lines.lines))
        self.varies = np.flatnonzero(c[:, 1:].any((0, 1)))
        self.constant, self.c = c[:, 0], c[..., self.varies]
        self.bends = np.zeros_like(self.constant)  # at x = 1 (Markov 1892)
        steepest = self.degrees**2 * (self.degrees**2 - 1) / 3
        self.bends[:, self.varies] = np.einsum("k,pkv->pv", steepest, np.abs(self.c))

    @property
    def portion(self) -> int:
        """Points at a time."""
        return max(1, ENTRIES // (self.constant.shape[1] + self.n**2))

    def split(self, flat):
        """A, and the entries of B and of C in each term, of rows of entries."""
        A, B, C = np.split(flat, self.sizes, axis=-1)
        return A.reshape(-1, self.n, self.n), B, C

    def summed(self, terms):
        """The sums of terms at their places, `(points, n, n)`."""
        return (terms @ self.place).reshape(-1, self.n, self.n)

    def entries(self, panel, x):
        """The entries at places of panels, and their derivatives."""
        turned, at_end = np.arccos(np.clip(x, -1, 1))[:, None], np.abs(x) >= 1
        with np.errstate(all="ignore"):
            rising = self.degrees * np.sin(self.degrees * turned) / np.sin(turned)
        rising[at_end] = self.degrees**2 * np.sign(x[at_end])[:, None] ** (self.degrees + 1)
        value, slope = self.constant[panel].copy(), np.zeros((panel.size, self.constant.shape[1]))
        both = np.stack([np.cos(self.degrees * turned), rising], axis=1)
        for number in np.unique(panel).tolist():
            at = np.flatnonzero(panel == number)
            sums = both[at] @ self.c[number]
            value[at[:, None], self.varies] += sums[:, 0] - self.c[number, 0]
            slope[at[:, None], self.varies] = sums[:, 1]
        return value, slope

    def bounds(self, panel, value, slope, wide) -> _Bounds:
        """Bounds on the second derivatives and on the rounding of S in parts of panels that are so wide."""
        unit, wide, bends = np.eye(self.n), wide[:, None], self.bends[panel]
        steep = np.abs(slope) + wide * bends
        (A, B, C), (_, B1, C1) = self.split(np.abs(value) + wide * steep), self.split(steep)
        (A2, B2, C2), (dA, dB, dC) = self.split(bends), self.split(self.error[panel])
        rounding = dA + self.summed(dC * (B + dB) + C * dB) + ROUNDED * (2 * unit + A + self.summed((1 + self.lag) * C * B))
        by_angle, both = unit + self.summed(self.lag**2 * C * B), self.summed(self.lag * (C1 * B + C * B1))
        return _Bounds(by_angle, both, A2 + self.summed(C2 * B + 2 * C1 * B1 + C * B2), rounding)

    def around(self, value, slope, theta, radius=1.0):
        """S at some points of a circle, and its derivatives by the angle and by x."""
        turned = np.exp(1j * theta)[:, None, None]
        w = (radius - 1) + radius * (2j * np.sin(theta / 2) * np.exp(0.5j * theta))[:, None, None]
        unit, (A, B, C), (A1, B1, C1) = np.eye(self.n), self.split(value), self.split(slope)
        late = radius**-self.lag * np.exp(-1j * self.lag * theta[:, None])
        S = w * unit - A - self.summed(C * B * late)
        by_angle = 1j * (radius * turned * unit + self.summed(self.lag * C * B * late))
        return S, by_angle, -A1 - self.summed((C1 * B + C * B1) * late)

    def judged(self, boxes: _Boxes, radius=1.0):
        """Whether boxes are proved, and whether it is rather x than the angle that keeps them open."""
        good, by_x = np.zeros((2, boxes.x.size), bool)
        for first in range(0, boxes.x.size, self.portion):
            chunk = boxes.take(np.arange(first, min(first + self.portion, boxes.x.size)))
            _, at, of = np.unique(np.stack([chunk.panel, chunk.x, chunk.wide]), axis=1, return_index=True, return_inverse=True)
            of = of.reshape(-1)
            value, slope = self.entries(chunk.panel[at], chunk.x[at])
            bounds = self.bounds(chunk.panel[at], value, slope, chunk.wide[at])
            angle, both, number, rounding = (bound[of] for bound in bounds)
            S, by_angle, by_number = self.around(value[of], slope[of], chunk.theta, radius)
            back, a, b = inverse(S), chunk.arc[:, None, None], chunk.wide[:, None, None]
            turned, moved = a * np.abs(back @ by_angle), b * np.abs(back @ by_number)
            rest = np.abs(back) @ (radius**2 * (a**2 / 2 * angle + a * b * both) + b**2 / 2 * number + rounding)
            change = turned + moved + rest
            # w = (1 - change/s)^-1 1 is positive if the spectral radius is below s, and then change w = s (w - 1) < s w
            weight = solve(np.eye(self.n) - change / SHRINKS, np.ones((chunk.x.size, self.n, 1)))
            rows = slice(first, first + chunk.x.size)
            good[rows] = ((weight > 0) & (change @ weight <= SURELY * weight)).all((1, 2))
            weight = np.abs(change) @ np.abs(weight)
            by_x[rows] = (moved @ weight / weight).max((1, 2)) > (turned @ weight / weight).max((1, 2))
        return good, by_x

    def crossings(self, boxes: _Boxes) -> _Crossings:
        """The crossings to which Newton's method leads from boxes next to them."""
        step = self.newton_step(boxes.panel, boxes.x, boxes.theta)
        boxes = boxes.take((np.abs(step) <= NEXT * np.stack([boxes.arc, boxes.wide])).all(0))
        panel, x, theta = boxes.panel, boxes.x, boxes.theta
        for _ in range(STEPS):
            step = self.newton_step(panel, x, theta)
            theta, x = theta + step[0], np.clip(x + step[1], -1, 1)
        theta, converged = np.abs((theta + np.pi) % (2 * np.pi) - np.pi), (np.abs(step) < CONVERGED).all(0)
        panel, x, theta = panel[converged], x[converged], theta[converged]
        return _Crossings(panel, x, theta, self.moved(panel, x + BESIDE, theta))

    def moved(self, panel, x, theta):
        """How far rounding of S may move a crossing along x, from a place next to it."""
        value, slope = self.entries(panel, x)
        S, *slopes = self.around(value, slope, theta)
        back, rounding = inverse(S), self.bounds(panel, value, slope, np.zeros(panel.size)).rounding
        a, b = (np.trace(back @ by, axis1=1, axis2=2) for by in slopes)
        off = np.trace(np.abs(back) @ rounding, axis1=1, axis2=2)
        with np.errstate(all="ignore"):
            return np.abs(a) * off / np.abs(a.real * b.imag - a.imag * b.real)

    def newton_step(self, panel, x, theta):
        """The steps of angles and of x to where det S is 0, to first order, `(2, points)`; log det S has traces as slopes."""
        step = np.zeros((2, x.size))
        for index in (slice(first, first + self.portion) for first in range(0, x.size, self.portion)):
            S, *slopes = self.around(*self.entries(panel[index], x[index]), theta[index])
            back = inverse(S)
            a, b = (np.trace(back @ slope, axis1=1, axis2=2) for slope in slopes)
            with np.errstate(all="ignore"):
                step[:, index] = np.nan_to_num(np.stack([-b.imag, a.imag]) / (a.real * b.imag - a.imag * b.real), nan=np.inf)
        return step


def halved(boxes: _Boxes, by_x) -> _Boxes:
    """Boxes halved along one of their sides."""
    wide, arc = np.where(by_x, boxes.wide / 2, boxes.wide), np.where(by_x, boxes.arc, boxes.arc / 2)
    sides = []
    for sign in (-1, 1):
        x, theta = boxes.x + np.where(by_x, sign * wide, 0.0), boxes.theta + np.where(by_x, 0.0, sign * arc)
        sides.append(_Boxes(boxes.panel, x, wide, theta, arc, boxes.splits + 1))
    return _Boxes.join(sides)


def tiles_by_lines(panels: Panels, errors, points, span, slack) -> Tiles | None:
    """Return the tiles of the spans of columns, as `covering.tiles_of` does.

    None if delay lines are short, or something is left open. points: of the span, at which frames show their lines; errors,
    slack: see `stable_along_any`.
    """
    if panels.error.shape[-1] < LONG:
        return None
    column = np.unique(panels.column)
    E, _ = errors(np.repeat(column, points.size), np.tile(points, column.size))
    if not np.isfinite(E).all():
        return None
    lines = DelayLines.of(E)
    if lines.delayed.size < max(LONG, E.shape[-1] / 2):
        return None
    if not _same_lines(panels, lines) or (equation := ReducedEquation(panels, lines)).lag.size > MOST_TERMS:
        return None
    pad = 4 * EPS * np.abs(span).max() / panels.half
    ends = [(end - panels.middle) / panels.half + sign * pad for sign, end in ((-1, panels.low), (1, panels.high))]
    boxes = _around_circle(equation, np.arange(panels.low.size), *ends)
    boxes = _left_open(equation, boxes, SPLITS)
    if boxes is None:
        return None
    windows = _windows(panels, *equation.crossings(boxes), span, slack)
    for column, low, high in zip(windows.column, windows.low, windows.high, strict=True):
        boxes = _without(boxes, panels, column, low, high, pad)
    left = _left_open(equation, boxes, MOST_SPLITS)
    if left is None or left.x.size:
        return None
    stretches = _counted(_stretches(panels, windows), errors)
    return Tiles.join([stretches, _labelled(windows, stretches, equation, errors)])


def _same_lines(panels, lines):
    """Whether all panels have these lines, as frames at some points have: no other entry of theirs is anything but exactly 0,
    since a loop of large gains may be closed by the smallest one."""
    rows, n = lines.delayed[:, None], panels.error.shape[-1]
    links = -np.eye(n)
    for line in lines.lines:
        links[line[1:], line[:-1]] = 1
    links, c = links[rows, lines.delayed], panels.coefficients[..., rows, lines.delayed]
    off = np.abs(c[:, 0] - links) + np.abs(c[:, 1:]).sum(1) + panels.error[:, rows, lines.delayed]
    return bool((off <= np.where(links == 0, 0.0, LINKED)).all())


def _around_circle(equation, panel, low, high):
    """Boxes of parts of panels, with arcs of the upper half of the circle each."""
    count = int(np.ceil(np.pi * equation.longest / (2 * TURN)))
    arcs, many = np.pi * np.arange(1, 2 * count, 2) / (2 * count), panel.size * count
    x, wide, panel = (np.repeat(fact, count) for fact in ((low + high) / 2, (high - low) / 2, panel))
    return _Boxes(panel, x, wide, np.tile(arcs, many // count), np.full(many, np.pi / (2 * count)), np.zeros(many, int))


def _left_open(equation, boxes, splits, radius=1.0):
    """The boxes that are halved so often and not proved; None if there are too many."""
    left, columns, used = [], np.unique(equation.panels.column).size, 0
    while boxes.x.size:
        used += boxes.x.size
        if used > MOST_BOXES * columns:
            return None
        with np.errstate(all="ignore"):
            good, by_x = equation.judged(boxes, radius)
        open_ = ~good
        boxes = halved(boxes.take(open_), by_x[open_])
        last = boxes.splits >= splits
        left.append(boxes.take(last))
        boxes = boxes.take(~last)
    return _Boxes.join([*left, boxes])


def _windows(panels, panel, x, theta, moved, span, slack):
    """Windows about the crossings, those that meet joined; a crossing that is found again is the same one."""
    value, column = panels.middle[panel] + panels.half[panel] * x, panels.column[panel]
    inside = (value >= span[0]) & (value <= span[1])
    order = np.flatnonzero(inside)[np.lexsort((value[inside], column[inside]))]
    value, column, theta = value[order], column[order], theta[order]
    half = np.maximum(slack(value) / 2, FIRM * (panels.half[panel] * moved)[order])
    low, high = np.maximum(value - half, span[0]), np.minimum(value + half, span[1])
    rows = []
    for row in zip(column.tolist(), low.tolist(), high.tolist(), value.tolist(), theta.tolist(), strict=True):
        if rows and rows[-1][0] == row[0] and row[1] <= rows[-1][2]:
            rows[-1] = (*rows[-1][:2], row[2], *rows[-1][3:])
        else:
            rows.append(row)
    column, low, high, value, theta = (np.array(fact, float) for fact in (zip(*rows, strict=True) if rows else [()] * 5))
    column, doubt = column.astype(int), np.where(high - low > 2 * FIRM * slack(value), Doubt.ROUNDING, Doubt.NONE)
    return Tiles(column, low, high, WINDOW + 0 * column, value, theta, EPS * np.abs(value), doubt)


def _without(boxes, panels, column, low, high, pad):
    """Boxes without what is in a window of a column."""
    middle, half = panels.middle[boxes.panel], panels.half[boxes.panel]
    a, b = middle + half * (boxes.x - boxes.wide), middle + half * (boxes.x + boxes.wide)
    meets = (panels.column[boxes.panel] == column) & (a < high) & (b > low)
    left = [boxes.take(~meets)]
    for start, stop in ((a, np.full(b.size, low)), (np.full(a.size, high), b)):
        at = np.flatnonzero(meets & (stop > start))
        cut, margin = boxes.take(at), pad[boxes.panel[at]]
        ends = (start[at] - middle[at]) / half[at] - margin, (stop[at] - middle[at]) / half[at] + margin
        left.append(_Boxes(cut.panel, sum(ends) / 2, (ends[1] - ends[0]) / 2, cut.theta, cut.arc, cut.splits))
    return _Boxes.join(left)


def _stretches(panels, windows):
    """The parts of the panels of a column between its windows: column, low, high."""
    rows = []
    for column in np.unique(panels.column).tolist():
        order, inside = np.flatnonzero(panels.column == column), np.flatnonzero(windows.column == column)
        order = order[np.argsort(panels.low[order])]
        runs = np.split(order, np.flatnonzero(panels.low[order[1:]] > panels.high[order[:-1]]) + 1)
        for run in runs:
            at = float(panels.low[run[0]])
            for low, high in zip(windows.low[inside].tolist(), windows.high[inside].tolist(), strict=True):
                if at < low < panels.high[run[-1]]:
                    rows.append((column, at, low))
                at = max(at, high)
            if at < panels.high[run[-1]]:
                rows.append((column, at, float(panels.high[run[-1]])))
    return [np.array(fact) for fact in zip(*rows, strict=True)]


def _counted(stretches, errors):
    """Tiles of stretches in which nothing crosses, with the number of eigenvalues outside, as far as a count is clear."""
    column, low, high = stretches
    outside = np.full(column.size, -1)
    for share in SHARES:
        at = np.flatnonzero(outside < 0)
        if not at.size:
            break
        count, clear = count_outside(*errors(column[at], low[at] + share * (high - low)[at]))
        outside[at] = np.where(clear, count, -1)
    return Tiles.of(column, low, high, outside).take(outside >= 0)


def _labelled(windows, stretches, equation, errors):
    """Windows, those as OVERLAID in which another eigenvalue is outside of a larger circle all the while."""
    panels, label = equation.panels, windows.outside.copy()
    for at, (column, low, high) in enumerate(zip(windows.column, windows.low, windows.high, strict=True)):
        neighbours = (stretches.column == column) & ((stretches.high == low) | (stretches.low == high))
        if not neighbours.any() or stretches.outside[neighbours].min() < 1:
            continue
        meeting = np.flatnonzero((panels.column == column) & (panels.low <= high) & (panels.high >= low))
        ends = [(end - panels.middle[meeting]) / panels.half[meeting] for end in (low, high)]
        left = _left_open(equation, _around_circle(equation, meeting, *ends), MOST_SPLITS, 1 + BEYOND)
        E, dE = errors(np.array([column]), windows.value[at : at + 1])
        smaller = (E - BEYOND * np.eye(E.shape[-1])) / (1 + BEYOND)
        count, clear = count_outside(smaller, dE)
        if left is not None and not left.x.size and clear[0] and count[0] > 0:
            label[at] = OVERLAID
    return Tiles(
        *(getattr(windows, name) for name in ("column", "low", "high")),
        label,
        windows.value,
        windows.theta,
        windows.miss,
        windows.doubt,
    )
