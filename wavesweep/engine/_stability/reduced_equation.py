"""Loops with long delays along a number: where eigenvalues cross the unit circle, proved without
computing them.

docs/proof.md, "Long delays", has the method. An eigenvalue z is where

    S = z - 1 - A - sum over m of G_m z^-m

is singular: A of the states that no delay line has, less identity, and G_m what returns to these
after m steps in a line. In a box of angles and of the number, S is nonsingular if, with its value
S0 in the middle,

    |S0^-1 S_theta| a + |S0^-1 S_x| b + |S0^-1| (a^2/2 R_tt + a b R_tx + b^2/2 R_xx + rounding)

takes some positive weights to less: a and b are half of the sides, and R bound the second
derivatives all over the box. Boxes that are not proved are halved. About what is left Newton's
method finds crossings; windows about these, as narrow as ends are exact, are left out of the range,
and the rest is proved. Between windows no eigenvalue crosses, so one count holds for all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._monodromy.resolvent import DelayLines
from wavesweep.engine._monodromy.unit_circle import inverse, solve
from wavesweep.engine._stability.covering import WINDOW_OF_ERRORS
from wavesweep.engine._stability.entries import Panels
from wavesweep.engine._stability.spectrum import count_outside
from wavesweep.engine._stability.tiles import OVERLAID, WINDOW, Tiles
from wavesweep.engine.doubles import EPS, FEW_ROUNDINGS
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows

LONG_LINES = 24  # states of delay lines, from which on this costs less than eigenvalues
CONVERGED_STEP = 1e-9  # of the last step, in parts of a panel
BESIDE_CROSSING = 1e-7  # next to a crossing, in parts of a panel, where S is not singular
MOST_SPLITS, MOST_BOXES = 120, 300_000  # of a box; of a column
WANTED_WEIGHTS = 0.93  # of weights, what is wanted to be left of them
SHRUNK_WEIGHTS = 0.95  # and what is left of them at most: room for rounding between the two
SUM_ROUNDING = 256 * EPS  # of the terms of a sum, and a quarter of it for each state of a line
MOST_OFF_LINK = 1e-11  # of a link of a line, which is 1: delays of two rates in series need 1e-13
# by which a circle is larger than the unit circle, outside of which another eigenvalue is while one
# crosses
LARGER_CIRCLE = 1e-7


@dataclass(frozen=True, slots=True)
class _Boxes(Rows):
    """Boxes of panels: middle and half of each side, x on the panel and theta; splits: how often
    each was halved."""

    panel: np.ndarray
    x: np.ndarray
    wide: np.ndarray
    theta: np.ndarray
    arc: np.ndarray
    splits: np.ndarray


class _Bounds(NamedTuple):
    """Bounds on the second derivatives of S by the angle, by both, and by x, and on its
    rounding but for that of `z - 1`."""

    by_angle: np.ndarray
    by_both: np.ndarray
    by_x: np.ndarray
    rounding: np.ndarray


class _Crossings(NamedTuple):
    """Crossings at x of panels, the angles of the eigenvalues there, and how far rounding may
    move them along x."""

    panel: np.ndarray
    x: np.ndarray
    theta: np.ndarray
    moved: np.ndarray


class _Series(NamedTuple):
    """Entries as Chebyshev series on panels: those that A, B and C in each term have, one after the
    other.

    constant: first coefficients, `(panels, entries)`. varies: which entries have others; c: all of
    these, `(panels, degrees, varying)`. error: bounds on errors, and bends: on second derivatives,
    both `(panels, entries)`.
    """

    constant: np.ndarray
    varies: np.ndarray
    c: np.ndarray
    error: np.ndarray
    bends: np.ndarray

    @classmethod
    def of(
        cls,
        panels: Panels,
        places: tuple[
            tuple[np.ndarray, np.ndarray],
            tuple[np.ndarray, np.ndarray],
            tuple[np.ndarray, np.ndarray],
        ],
    ) -> _Series:
        """places: pairs of rows and columns of the frame."""
        coefficients = []
        errors = []
        for rows, columns in places:
            of_place = panels.coefficients[..., rows, columns]
            coefficients.append(of_place.reshape(*of_place.shape[:2], -1))
            errors.append(panels.error[..., rows, columns].reshape(len(panels.error), -1))
        c = np.concatenate(coefficients, -1)
        varies = np.flatnonzero(c[:, 1:].any((0, 1)))
        varying = c[..., varies]
        degree = np.arange(c.shape[1])
        steepest = degree**2 * (degree**2 - 1) / 3  # of second derivatives, at x = 1 (Markov 1892)
        bends = np.zeros_like(c[:, 0])
        bends[:, varies] = np.einsum("k,pkv->pv", steepest, np.abs(varying))
        return cls(c[:, 0], varies, varying, np.concatenate(errors, -1), bends)


class ReducedEquation:
    """S and its derivatives on panels, for the states that no delay line has: `z - 1 - A - sum_m
    G_m z^-m`.

    A term of G_m is the product of an entry of B, from where a state enters a line, and one of C,
    from where the line is read m steps later. lag: m of each term. place: the entry of S that it
    belongs to, as a matrix of ones, `(terms, n n)`. off_link: see `_off_link`.
    """

    def __init__(self, panels: Panels, lines: DelayLines, off_link: float) -> None:
        self.panels = panels
        self.per_link = SUM_ROUNDING / 4 + 1.01 * off_link  # (1 + x)^m - 1 is hardly more than m x
        self.n = lines.solved.size
        self.longest = max(map(len, lines.lines))
        solved = lines.solved
        nonzero = (np.abs(panels.coefficients).sum(1) + panels.error > 0).any(0)
        row, column, entered, read, self.lag = _terms(nonzero, lines)
        self.place = np.zeros((row.size, self.n**2))
        self.place[np.arange(row.size), row * self.n + column] = 1
        places = (solved[:, None], solved), (entered, solved[column]), (solved[row], read)
        self.series = _Series.of(panels, places)
        self.ends_of_parts = self.n**2, self.n**2 + row.size
        self.degrees = np.arange(panels.coefficients.shape[1])

    @property
    def portion(self) -> int:
        """Points at a time."""
        # Of what delay lines show, at a time.
        return max(1, 2**19 // (self.series.constant.shape[1] + self.n**2))

    def split(self, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, and the entries of B and of C in each term, of rows of entries."""
        A, B, C = np.split(flat, self.ends_of_parts, axis=-1)
        return A.reshape(-1, self.n, self.n), B, C

    def summed(self, terms: np.ndarray) -> np.ndarray:
        """The sums of terms at their places, `(points, n, n)`."""
        return (terms @ self.place).reshape(-1, self.n, self.n)

    def entries(self, panel: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The entries of A, B and C at places x of panels, -1 to 1, by their Chebyshev series, and
        their derivatives by x, `(points, entries)`; see `split`."""
        series = self.series
        degree = self.degrees
        angle = np.arccos(np.clip(x, -1, 1))[:, None]
        # T_k(cos a) = cos(k a), and its derivative k sin(k a)/sin(a); at the ends of a panel that
        # is k^2.
        with np.errstate(all="ignore"):
            rising = degree * np.sin(degree * angle) / np.sin(angle)
        at_end = np.abs(x) >= 1
        rising[at_end] = degree**2 * np.sign(x[at_end])[:, None] ** (degree + 1)
        both = np.stack([np.cos(degree * angle), rising], axis=1)
        value = series.constant[panel].copy()
        slope = np.zeros((panel.size, series.constant.shape[1]))
        for number in np.unique(panel).tolist():
            of_panel = np.flatnonzero(panel == number)
            sums = both[of_panel] @ series.c[number]
            value[of_panel[:, None], series.varies] += sums[:, 0] - series.c[number, 0]
            slope[of_panel[:, None], series.varies] = sums[:, 1]
        return value, slope

    def bounds(
        self, panel: np.ndarray, value: np.ndarray, slope: np.ndarray, wide: np.ndarray
    ) -> _Bounds:
        """Bounds on the second derivatives and on the rounding of S in parts of panels that are
        so wide."""
        unit = np.eye(self.n)
        wide = wide[:, None]
        bends = self.series.bends[panel]
        slopes = np.abs(slope) + wide * bends
        A, B, C = self.split(np.abs(value) + wide * slopes)
        _, B1, C1 = self.split(slopes)
        A2, B2, C2 = self.split(bends)
        dA, dB, dC = self.split(self.series.error[panel])
        of_entries = dA + self.summed(dC * (B + dB) + C * dB)
        of_sums = SUM_ROUNDING * A + self.summed((SUM_ROUNDING + self.per_link * self.lag) * C * B)
        return _Bounds(
            by_angle=unit + self.summed(self.lag**2 * C * B),
            by_both=self.summed(self.lag * (C1 * B + C * B1)),
            by_x=A2 + self.summed(C2 * B + 2 * C1 * B1 + C * B2),
            rounding=of_entries + of_sums,
        )

    def around(
        self, value: np.ndarray, slope: np.ndarray, theta: np.ndarray, radius: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`S = w I - A - sum_m C_m B_m z^-m` at points `z = radius e^(i theta)`, w = z - 1, and its
        derivatives by theta and by x, `(points, n, n)` each. value, slope: see `entries`."""
        unit = np.eye(self.n)
        A, B, C = self.split(value)
        A1, B1, C1 = self.split(slope)
        turned = np.exp(1j * theta)[:, None, None]
        # z - 1 of z = radius exp(j theta), with the digits that it has next to 1.
        w = (radius - 1) + radius * (2j * np.sin(theta / 2) * np.exp(0.5j * theta))[:, None, None]
        late = radius**-self.lag * np.exp(-1j * self.lag * theta[:, None])  # z^-m
        S = w * unit - A - self.summed(C * B * late)
        by_angle = 1j * (radius * turned * unit + self.summed(self.lag * C * B * late))
        by_x = -A1 - self.summed((C1 * B + C * B1) * late)
        return S, by_angle, by_x

    def rounding_at(self, theta: np.ndarray, radius: float = 1.0) -> np.ndarray:
        """A bound on the rounding of `z - 1` at some points of a circle, and on what is between
        boxes that meet there: both are parts of the distance from 1."""
        size = radius - 1 + 2 * radius * np.abs(np.sin(theta / 2))
        return SUM_ROUNDING * size[:, None, None] * np.eye(self.n)

    def judged(self, boxes: _Boxes, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Whether boxes are proved, and whether it is rather x than the angle that keeps them
        open."""
        good = np.zeros(boxes.x.size, bool)
        by_x = np.zeros(boxes.x.size, bool)
        for first in range(0, boxes.x.size, self.portion):
            rows = slice(first, first + self.portion)
            good[rows], by_x[rows] = self._judged_at_once(boxes.take(rows), radius)
        return good, by_x

    def _judged_at_once(self, boxes: _Boxes, radius: float) -> tuple[np.ndarray, np.ndarray]:
        """See `judged`. In a box with the half sides a and b, `S^-1 S' = I + X` with `|X| <= change = a |S^-1
        S_theta| + b |S^-1 S_x| + |S^-1| (bounds on second derivatives and rounding)`, by Taylor: S' is
        regular if the spectral radius of `change` is below 1."""
        # Boxes of different angles share the entries of the frame.
        facts = np.stack([boxes.panel, boxes.x, boxes.wide])
        _, distinct, of = np.unique(facts, axis=1, return_index=True, return_inverse=True)
        of = of.reshape(-1)
        value, slope = self.entries(boxes.panel[distinct], boxes.x[distinct])
        bounds = self.bounds(boxes.panel[distinct], value, slope, boxes.wide[distinct])
        R_tt, R_tx, R_xx, rounding = (bound[of] for bound in bounds)
        rounding = rounding + self.rounding_at(boxes.theta, radius)
        S, S_theta, S_x = self.around(value[of], slope[of], boxes.theta, radius)
        back = inverse(S)
        a = boxes.arc[:, None, None]
        b = boxes.wide[:, None, None]
        turned = a * np.abs(back @ S_theta)
        moved = b * np.abs(back @ S_x)
        of_angles = a**2 / 2 * R_tt + a * b * R_tx
        rest = np.abs(back) @ (radius**2 * of_angles + b**2 / 2 * R_xx + rounding)
        change = turned + moved + rest
        # w = (1 - change/s)^-1 1 is positive if the spectral radius is below s, and then change w =
        # s (w - 1) < s w
        weight = solve(np.eye(self.n) - change / WANTED_WEIGHTS, np.ones((boxes.x.size, self.n, 1)))
        good = ((weight > 0) & (change @ weight <= SHRUNK_WEIGHTS * weight)).all((1, 2))
        weight = np.abs(change) @ np.abs(weight)
        by_x = (moved @ weight / weight).max((1, 2)) > (turned @ weight / weight).max((1, 2))
        return good, by_x

    def crossings(self, boxes: _Boxes) -> _Crossings:
        """The crossings to which Newton's method leads from boxes next to them."""
        step = self.newton_step(boxes.panel, boxes.x, boxes.theta)
        # Sizes of a box to the crossing next to it, at most.
        boxes = boxes.take((np.abs(step) <= 4 * np.stack([boxes.arc, boxes.wide])).all(0))
        panel = boxes.panel
        x = boxes.x
        theta = boxes.theta
        for _ in range(8):  # steps towards that crossing
            step = self.newton_step(panel, x, theta)
            theta = theta + step[0]
            x = np.clip(x + step[1], -1, 1)
        converged = (np.abs(step) < CONVERGED_STEP).all(0)
        panel = panel[converged]
        x = x[converged]
        theta = np.abs((theta[converged] + np.pi) % (2 * np.pi) - np.pi)
        return _Crossings(panel, x, theta, self.moved(panel, x + BESIDE_CROSSING, theta))

    def moved(self, panel: np.ndarray, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """How far rounding of S may move a crossing along x, from a place next to it, `(places,)`.

        S stays singular if `a dtheta + b dx + tr(S^-1 R) = 0` for its rounding R, with a and b the
        traces of `S^-1 S_theta` and `S^-1 S_x`: so `|dx| <= |a| |tr|/|Im(a* b)|`.
        """
        value, slope = self.entries(panel, x)
        S, S_theta, S_x = self.around(value, slope, theta)
        back = inverse(S)
        rounding = self.bounds(panel, value, slope, np.zeros(panel.size)).rounding
        rounding = rounding + self.rounding_at(theta)
        a = _trace(back @ S_theta)
        b = _trace(back @ S_x)
        off = _trace(np.abs(back) @ rounding)
        with np.errstate(all="ignore"):
            return np.abs(a) * off / np.abs(a.real * b.imag - a.imag * b.real)

    def newton_step(self, panel: np.ndarray, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """The steps of angles and of x to where det S is 0, to first order, `(2, points)`; log
        det S has traces as slopes."""
        step = np.zeros((2, x.size))
        for first in range(0, x.size, self.portion):
            index = slice(first, first + self.portion)
            value, slope = self.entries(panel[index], x[index])
            S, S_theta, S_x = self.around(value, slope, theta[index])
            back = inverse(S)
            a = _trace(back @ S_theta)
            b = _trace(back @ S_x)
            # 1 + a d_theta + b d_x = 0 in its real and its imaginary part
            with np.errstate(all="ignore"):
                steps = np.stack([-b.imag, a.imag]) / (a.real * b.imag - a.imag * b.real)
            step[:, index] = np.nan_to_num(steps, nan=np.inf)
        return step


def _terms(nonzero: np.ndarray, lines: DelayLines) -> np.ndarray:
    """Return the terms of `sum_m G_m z^-m`: row, column, the delayed states that are entered and
    read, and the lag m, `(terms,)` each.

    The solved state `column` enters a line at one state, and `row` reads it at the same one, a frame
    later, or at one behind it, a frame later for each:

        G_m[row, column] = sum of C[row, read] B[entered, column].

    nonzero: which entries of the frame, `(n, n)`, may be other than 0 on some panel.
    """
    solved = lines.solved
    terms = []
    for line in lines.lines:
        states = line.tolist()
        for first, entered in enumerate(states):
            for column in np.flatnonzero(nonzero[entered, solved]).tolist():
                for lag, read in enumerate(states[first:], start=1):
                    for row in np.flatnonzero(nonzero[solved, read]).tolist():
                        terms.append((row, column, entered, read, lag))
    return np.array(terms, int).reshape(-1, 5).T  # five rows also if there is no term


def _trace(matrices: np.ndarray) -> np.ndarray:
    return np.trace(matrices, axis1=1, axis2=2)


def halved(boxes: _Boxes, by_x: np.ndarray) -> _Boxes:
    """Boxes halved along one of their sides."""
    wide = np.where(by_x, boxes.wide / 2, boxes.wide)
    arc = np.where(by_x, boxes.arc, boxes.arc / 2)
    sides = []
    for sign in (-1, 1):
        x = boxes.x + np.where(by_x, sign * wide, 0.0)
        theta = boxes.theta + np.where(by_x, 0.0, sign * arc)
        sides.append(_Boxes(boxes.panel, x, wide, theta, arc, boxes.splits + 1))
    return _Boxes.join(sides)


def tiles_by_lines(
    panels: Panels,
    errors: Callable[..., Any],
    points: np.ndarray,
    span: tuple[float, float],
    slack: Callable[..., Any],
) -> Tiles | None:
    """Return the tiles of the spans of columns, as `covering.tiles_of` does.

    None if delay lines are short, or something is left open. points: of the span, at which frames
    show their lines; errors, slack: see `tiles_of`.
    """
    equation = _reduced(panels, errors, points)
    if equation is None:
        return None
    pad = FEW_ROUNDINGS * np.abs(span).max() / panels.half
    low = (panels.low - panels.middle) / panels.half - pad
    high = (panels.high - panels.middle) / panels.half + pad
    whole = _around_circle(equation, np.arange(panels.low.size), low, high)
    # Halvings of a box before Newton's method looks for a crossing in it.
    boxes = _left_open(equation, whole, 12)
    if boxes is None:
        return None
    windows = _windows(panels, equation.crossings(boxes), span, slack)
    for column, low, high in zip(windows.column, windows.low, windows.high, strict=True):
        boxes = _without(boxes, panels, column, low, high, pad)
    undecided = _left_open(equation, boxes, MOST_SPLITS)
    if undecided is None or undecided.x.size:
        return None
    stretches = _counted(_stretches(panels, windows), errors)
    return Tiles.join([stretches, _labelled(windows, stretches, equation, errors)])


def _reduced(
    panels: Panels, errors: Callable[..., Any], points: np.ndarray
) -> ReducedEquation | None:
    """Return the equation of panels in the states outside of delay lines, None if these are short."""
    if panels.error.shape[-1] < LONG_LINES:
        return None
    column = np.unique(panels.column)
    E, _ = errors(np.repeat(column, points.size), np.tile(points, column.size))
    if not np.isfinite(E).all():
        return None
    lines = DelayLines.of(E)
    if lines.delayed.size < max(LONG_LINES, E.shape[-1] / 2):
        return None
    off_link = _off_link(panels, lines)
    if off_link > MOST_OFF_LINK:
        return None
    equation = ReducedEquation(panels, lines, off_link)
    return equation if equation.lag.size <= 1000 else None  # terms of S


def _off_link(panels: Panels, lines: DelayLines) -> float:
    """By how much a link of these lines may be off 1 on all panels; infinite if another entry of theirs
    is anything but exactly 0, since a loop of large gains may be closed by the smallest one."""
    rows = lines.delayed[:, None]
    links = -np.eye(panels.error.shape[-1])
    for line in lines.lines:
        links[line[1:], line[:-1]] = 1
    links = links[rows, lines.delayed]
    c = panels.coefficients[..., rows, lines.delayed]
    off = np.abs(c[:, 0] - links) + np.abs(c[:, 1:]).sum(1) + panels.error[:, rows, lines.delayed]
    return float(np.where((links == 0) & (off > 0), np.inf, off).max())


def _around_circle(
    equation: ReducedEquation, panel: np.ndarray, low: np.ndarray, high: np.ndarray
) -> _Boxes:
    """Boxes of parts of panels, with arcs of the upper half of the circle each."""
    # Over an arc the longest line turns by one rad either way at first.
    count = int(np.ceil(np.pi * equation.longest / 2))
    many = panel.size * count
    arcs = np.pi * np.arange(1, 2 * count, 2) / (2 * count)
    x = np.repeat((low + high) / 2, count)
    wide = np.repeat((high - low) / 2, count)
    theta = np.tile(arcs, panel.size)
    arc = np.full(many, np.pi / (2 * count))
    return _Boxes(np.repeat(panel, count), x, wide, theta, arc, np.zeros(many, int))


def _left_open(
    equation: ReducedEquation, boxes: _Boxes, splits: int, radius: float = 1.0
) -> _Boxes | None:
    """The boxes that are halved so often and not proved; None if there are too many."""
    columns = np.unique(equation.panels.column).size
    undecided = []
    used = 0
    while boxes.x.size:
        used += boxes.x.size
        if used > MOST_BOXES * columns:
            return None
        with np.errstate(all="ignore"):
            good, by_x = equation.judged(boxes, radius)
        open_ = ~good
        boxes = halved(boxes.take(open_), by_x[open_])
        last = boxes.splits >= splits
        undecided.append(boxes.take(last))
        boxes = boxes.take(~last)
    return _Boxes.join([*undecided, boxes])


def _windows(
    panels: Panels, crossings: _Crossings, span: tuple[float, float], slack: Callable[..., Any]
) -> Tiles:
    """Windows about the crossings, those that meet joined; a crossing that is found again is the
    same one."""
    panel = crossings.panel
    value = panels.middle[panel] + panels.half[panel] * crossings.x
    column = panels.column[panel]
    inside = (value >= span[0]) & (value <= span[1])
    half = np.maximum(slack(value) / 2, WINDOW_OF_ERRORS * panels.half[panel] * crossings.moved)
    low = np.maximum(value - half, span[0])
    high = np.minimum(value + half, span[1])
    order = np.flatnonzero(inside)[np.lexsort((low[inside], column[inside]))]
    value, low, high, column = (ordered[order] for ordered in (value, low, high, column))
    first_of_joined: list[
        int
    ] = []  # the first of those that meet, which reaches as far as any of them
    for index in range(order.size):
        last = first_of_joined[-1] if first_of_joined else index
        if first_of_joined and column[last] == column[index] and low[index] <= high[last]:
            high[last] = max(high[last], high[index])
        else:
            first_of_joined.append(index)
    windows = np.full(order.size, WINDOW)
    theta = crossings.theta[order]
    miss = EPS * np.abs(value)
    wide = high - low > 2 * WINDOW_OF_ERRORS * slack(value)
    doubt = np.where(wide, Doubt.ROUNDING, Doubt.NONE)
    found = Tiles(column, low, high, windows, value, theta, miss, doubt)
    return found.take(np.array(first_of_joined, int))


def _without(
    boxes: _Boxes, panels: Panels, column: int, low: float, high: float, pad: np.ndarray
) -> _Boxes:
    """Boxes without what is in a window of a column."""
    middle = panels.middle[boxes.panel]
    half = panels.half[boxes.panel]
    a = middle + half * (boxes.x - boxes.wide)
    b = middle + half * (boxes.x + boxes.wide)
    meets = (panels.column[boxes.panel] == column) & (a < high) & (b > low)
    remaining = [boxes.take(~meets)]
    for start, stop in ((a, np.full(b.size, low)), (np.full(a.size, high), b)):
        crossed = np.flatnonzero(meets & (stop > start))
        cut = boxes.take(crossed)
        margin = pad[cut.panel]
        begin = (start[crossed] - middle[crossed]) / half[crossed] - margin
        end = (stop[crossed] - middle[crossed]) / half[crossed] + margin
        remaining.append(replace(cut, x=(begin + end) / 2, wide=(end - begin) / 2))
    return _Boxes.join(remaining)


def _stretches(panels: Panels, windows: Tiles) -> list[np.ndarray]:
    """The parts of the panels of a column between its windows: column, low, high."""
    rows = []
    for column in np.unique(panels.column).tolist():
        inside = np.flatnonzero(windows.column == column)
        order = np.flatnonzero(panels.column == column)
        order = order[np.argsort(panels.low[order])]
        runs = np.split(order, np.flatnonzero(panels.low[order[1:]] > panels.high[order[:-1]]) + 1)
        for run in runs:
            begin = float(panels.low[run[0]])
            for low, high in zip(
                windows.low[inside].tolist(), windows.high[inside].tolist(), strict=True
            ):
                if begin < low < panels.high[run[-1]]:
                    rows.append((column, begin, low))
                begin = max(begin, high)
            if begin < panels.high[run[-1]]:
                rows.append((column, begin, float(panels.high[run[-1]])))
    return [np.array(fact) for fact in zip(*rows, strict=True)]


def _counted(stretches: list[np.ndarray], errors: Callable[..., Any]) -> Tiles:
    """Tiles of stretches in which nothing crosses, with the number of eigenvalues outside, as
    far as a count is clear."""
    column, low, high = stretches
    outside = np.full(column.size, -1)
    for share in (0.5, 0.37, 0.71, 0.13, 0.91):  # of a stretch, where eigenvalues are counted
        uncounted = np.flatnonzero(outside < 0)
        if not uncounted.size:
            break
        count, clear = count_outside(
            *errors(column[uncounted], low[uncounted] + share * (high - low)[uncounted])
        )
        outside[uncounted] = np.where(clear, count, -1)
    return Tiles.of(column, low, high, outside).take(outside >= 0)


def _labelled(
    windows: Tiles, stretches: Tiles, equation: ReducedEquation, errors: Callable[..., Any]
) -> Tiles:
    """Windows, those as OVERLAID in which another eigenvalue is outside of a larger circle all
    the while."""
    panels = equation.panels
    label = windows.outside.copy()
    for index, (column, low, high) in enumerate(
        zip(windows.column, windows.low, windows.high, strict=True)
    ):
        neighbours = (stretches.column == column) & (
            (stretches.high == low) | (stretches.low == high)
        )
        if not neighbours.any() or stretches.outside[neighbours].min() < 1:
            continue
        meeting = np.flatnonzero(
            (panels.column == column) & (panels.low <= high) & (panels.high >= low)
        )
        ends = [(end - panels.middle[meeting]) / panels.half[meeting] for end in (low, high)]
        undecided = _left_open(
            equation, _around_circle(equation, meeting, *ends), MOST_SPLITS, 1 + LARGER_CIRCLE
        )
        E, dE = errors(np.array([column]), windows.value[index : index + 1])
        # Eigenvalues z = 1 + delta as parts of the larger circle's radius.
        smaller = (E - LARGER_CIRCLE * np.eye(E.shape[-1])) / (1 + LARGER_CIRCLE)
        count, clear = count_outside(smaller, dE)
        if undecided is not None and not undecided.x.size and clear[0] and count[0] > 0:
            label[index] = OVERLAID
    return replace(windows, outside=label)
