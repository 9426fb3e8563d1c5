"""Intervals of a number from panels of its span, each of which is in an interval, or not, as a whole; else it is halved."""

from typing import NamedTuple, Protocol

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.intervals import NEAR_ZERO, Intervals

PANELS = 16  # of a column to begin with
OFTEN = 16  # times so many, in all
ENTRIES = 2_000_000  # of matrices at a time
RIM = np.exp(1j * np.pi * (np.arange(8) + 0.5) / 8)  # of a disc; its lower half is the conjugate
NARROW = 16  # see Accuracy
LOOKED_AT = 0.5 ** np.arange(1, 9)  # of what is not proved next to the low end
OUTSIDE = 1e-9  # by which it would be seen to be so there
GAP = 2  # times as exact as ends are, in the middle of which one is
SAFE = 1.5  # on the largest value at points of a rim, for those between
GOOD, OPEN, LOST, BAD = range(4)  # labels of panels; of two that overlap the larger one holds


class Accuracy(NamedTuple):
    """How exact ends are, of themselves and of a NEAR_ZERO-th of the span, and how many of the narrowest panels are as wide.

    least, begun: shares of the span next to its low end, where a gain of zero may leave a drift: in the one no panel is halved;
    an interval that is proved from the other one on, of each column, begins at the low end, if nothing is outside at the values
    that are looked at in between. slow: of that share no panel is halved below a NARROW-th of its distance, since rounding does
    not tell the eigenvalue of the drift from 1.
    """

    exact: float
    finest: float
    least: float
    begun: np.ndarray
    slow: bool = False

    def of(self, p, width):
        """How exact an end at p is, in a span of that width."""
        return self.exact * (np.abs(p) + NEAR_ZERO * width)


class Judge(Protocol):
    """What labels the panels of some columns.

    order: of its matrices. many: panels of a column that are open, beyond which it is given up. smooth: whether `worst` is
    smooth in the number.
    """

    columns: np.ndarray
    order: int
    many: int
    smooth: bool

    def label(self, column, low, high, bounds) -> np.ndarray:
        """GOOD, BAD or OPEN of panels; column: index into its columns. bounds: p beyond them has no loop."""

    def worst(self, column, p) -> tuple[np.ndarray, np.ndarray]:
        """What decides at values of a column, on the unit circle or near it, less 1, and by how much it is outside."""


def along_panels(judges, known, span, period, bounds, resolved, accuracy: Accuracy) -> Intervals:
    """All intervals of a number p within span = (low, high) in which all judges find GOOD, per column.

    known: columns of which anything is known, `(columns,)`. period: of the frame, s, `(columns,)`. bounds: p beyond them has no
    loop, two arrays `(columns,)`. resolved(column, low, high): whether loops have no narrow features there. What is left are
    the ends, each in a gap as narrow as ends are exact, and panels in doubt.
    """
    panels = [[(np.full(1, span[0]), np.full(1, GOOD if stable_column else LOST))] for stable_column in known]
    for judge in judges:
        owner, low, label = _panels(judge, span, [bound[judge.columns] for bound in bounds], resolved, accuracy)
        for at, column in enumerate(judge.columns.tolist()):
            of_column = owner == at
            order = np.argsort(low[of_column])
            panels[column].append((low[of_column][order], label[of_column][order]))
    rows = [
        _intervals(column, *_merged(column, panels_of, span, accuracy), judges, span, period[column], accuracy)
        for column, panels_of in enumerate(panels)
    ]
    names = ("column", "index", "count", "low", "high", "low_omega", "high_omega", "doubt", "residual")
    columns_of_rows = zip(*(row for column_rows in rows for row in column_rows), strict=True)
    kinds = (int, int, int, float, float, float, float, int, float)
    return Intervals(**{name: np.array(column, kind) for name, column, kind in zip(names, columns_of_rows, kinds, strict=True)})


def _panels(judge, span, bounds, resolved, accuracy):
    """Panels that cover the span: their columns, low ends and labels."""
    edges, count = np.linspace(*span, PANELS + 1), len(judge.columns)
    column, low, high = np.repeat(np.arange(count), PANELS), np.tile(edges[:-1], count), np.tile(edges[1:], count)
    many, tried, done, width = judge.many, np.zeros(count, int), [], span[1] - span[0]
    few = max(1, ENTRIES // (2 * RIM.size * judge.order**2))
    while column.size:
        at = np.flatnonzero(resolved(judge.columns[column], low, high))
        label, batches = np.full(column.size, OPEN), [at[first : first + few] for first in range(0, at.size, few)]
        for batch in batches:
            label[batch] = judge.label(column[batch], low[batch], high[batch], bounds)
        narrow = accuracy.finest * (high - low) <= accuracy.of((low + high) / 2, width)
        at_start = accuracy.slow & (high - span[0] <= accuracy.begun[judge.columns[column]] * width)
        narrow |= (high - span[0] <= accuracy.least * width) | (at_start & (NARROW * (high - low) <= high - span[0]))
        open_ = np.bincount(column, minlength=count)
        tried += open_
        lost = ((open_ > many) | (tried > OFTEN * many))[column]
        label = np.where((label == OPEN) & ~narrow & lost, LOST, label)
        closed = (label != OPEN) | narrow
        done.append((column[closed], low[closed], label[closed]))
        column, low, high = (array[~closed] for array in (column, low, high))
        middle = (low + high) / 2
        column, low, high = np.tile(column, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
    return [np.concatenate(arrays) for arrays in zip(*done, strict=True)]


def _merged(column, panels, span, accuracy):
    """Low ends and labels of runs of panels: of several partitions of the span, each as sorted low ends and labels."""
    edges = np.unique(np.concatenate([low for low, _ in panels]))
    label = np.max([panel[np.searchsorted(low, edges, side="right") - 1] for low, panel in panels], axis=0)
    edges, label = _runs(edges, label)
    size, within = np.diff(edges, append=span[1]), accuracy.of(edges, span[1] - span[0])
    around, sizes = np.concatenate([[LOST], label, [LOST]]), np.concatenate([[0], size, [0]])
    slivers = (around[:-2] == OPEN) & (around[2:] == OPEN)
    slivers &= (size <= within / 8) | (sizes[:-2] + size + sizes[2:] <= GAP * within)
    edges, label = _runs(edges, np.where(slivers, OPEN, label))  # in a gap a few panels may settle
    around = np.append(edges[1:], span[1]) - span[0] <= accuracy.slow * accuracy.begun[column] * (span[1] - span[0])
    first = np.max(np.flatnonzero(around & (label == OPEN)), initial=-1) + 1
    if (label[:first] < LOST).all():
        label[:first] = OPEN
    return _runs(edges, label)


def _runs(edges, label):
    """Neighbours with the same label as one."""
    new = np.append(True, label[1:] != label[:-1])
    return edges[new], label[new]


def _intervals(column, edges, label, judges, span, period, accuracy):
    """Yield the rows of a column from its runs of panels, sorted; edges: their low ends."""
    width, runs = span[1] - span[0], list(zip(edges, [*edges[1:], span[1]], label, strict=True))
    doubt, intervals, gaps, begun = Doubt.NONE, [], {}, False
    for at, (low, high, verdict) in enumerate(runs):
        sides = [runs[next_][2] for next_ in (at - 1, at + 1) if 0 <= next_ < len(runs)]
        if verdict == OPEN and ({*sides} == {GOOD, BAD} or sides in ([GOOD], [BAD])):
            tight = high - low <= GAP * accuracy.of(high, width)
            if at == 0 and sides == [GOOD] and high - low <= accuracy.begun[column] * width:
                judging = [judge for judge in judges if column in judge.columns]
                looked_at = low + (high - low) * LOOKED_AT
                begun = all((judge.worst(column, looked_at)[1] <= OUTSIDE).all() for judge in judging)
                if begun:
                    continue
            doubt = max(doubt, Doubt.NONE if tight else Doubt.ROUNDING)
            gaps |= dict.fromkeys((low, high), (low, high))
        elif verdict != BAD:
            doubt = max(doubt, {GOOD: Doubt.NONE, LOST: Doubt.SEARCH}.get(verdict, Doubt.CROWDED))
            intervals.append((span[0] if begun and not intervals else low, high, verdict == GOOD))
    count = index = sum(good for *_, good in intervals)
    for low, high, good in intervals:
        if not good:
            yield column, -1, count, low, high, np.nan, np.nan, doubt, 0.0
            continue
        ends, omegas, left = zip(*(_end(column, edge, gaps, judges, span, period) for edge in (low, high)), strict=True)
        yield column, count - index, count, *ends, *omegas, doubt, max(left)
        index -= 1
    if not intervals:
        yield column, -1, 0, *4 * (np.nan,), doubt, 0.0


def _end(column, edge, gaps, judges, span, period):
    """The end of an interval at the edge of a gap: its value, the frequency there (rad/s), and what is left of the equation."""
    if edge not in gaps:  # where the span ends, or where nothing is known beyond
        return edge, np.nan, 0.0
    low, high = gaps[edge]
    judging = [judge for judge in judges if column in judge.columns]

    def worst(p):
        worst_of = [judge.worst(column, np.array([p])) for judge in judging]
        return max(((delta[0], beyond[0]) for delta, beyond in worst_of), key=lambda each: each[1])

    (first, sign_low), (last, sign_high) = worst(low), worst(high)
    p, (delta, left) = (low + high) / 2, (first, sign_low) if sign_low > sign_high else (last, sign_high)
    if all(judge.smooth for judge in judging) and sign_low * sign_high < 0:
        p = (low * sign_high - high * sign_low) / (sign_high - sign_low)
        delta, left = worst(p)
    for end, side in zip(span, (low, high), strict=True):
        if side == end:
            return end, abs(np.angle(1 + delta)) / period, 0.0
    return p, abs(np.angle(1 + delta)) / period, abs(left)
