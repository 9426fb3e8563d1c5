"""Intervals in which the eigenvalues of a loop are where they have to be, along any number, by discs about them."""

from dataclasses import dataclass

import numpy as np

from wavesweep.core.monodromy.product import blocks_of
from wavesweep.core.stability.along_any import EXACT
from wavesweep.core.stability.certificate import CROWDED, NONE, ROUNDING, SEARCH
from wavesweep.core.stability.frames import level, pole_inside
from wavesweep.core.stability.intervals import Intervals
from wavesweep.core.stability.regions import NEAR_ZERO
from wavesweep.require.discs import BAD, GOOD, LOST, OPEN, Circle, Spiral, verdicts

PANELS, MANY = 16, 1024  # panels of a column to begin with; so many that are open, beyond which it is given up
LARGE, OFTEN = 50_000, 16  # entries of so many frames, of fewer panels then; times that in all
BEGUN = 1e-9  # of the span: an interval is proved from so near to its low end on, where a gain of zero leaves a drift
NARROW = 256.0  # so many of the narrowest panels are as wide as an end is exact: eigenvalues may move along the spiral
RIM = np.exp(1j * np.pi * (np.arange(8) + 0.5) / 8)  # of a disc; its lower half is the conjugate
TYPICAL = (0.53, 0.37, 0.71, 0.13, 0.91, 1e-3, 0.0, 1.0)  # of the span, where the structure of the frames is looked at
ENTRIES = 2_000_000  # of matrices at a time


def along_by_discs(frames, errors, span, columns: int, period, bounds, place: Spiral | Circle) -> Intervals:
    """All intervals of a number p within span = (low, high) in which all eigenvalues are in their place, per column.

    frames(column, p): `Frames` of these columns at these values, real or complex, of which the pivots are read. errors(column,
    p): frames less identity, perhaps in other states, and bounds on the errors of their entries. period: of the frame, s,
    `(columns,)`. bounds: p beyond them has no loop, two arrays `(columns,)`. place: of the eigenvalues, see `discs`.

    All of a panel of p is in an interval, or none of it, if that follows from Gershgorin discs of the frames in the
    eigenvectors of that in the middle. The entries there are bounded by the frames on a circle about the panel, as they are
    analytic and vanish in the middle (Schwarz's lemma), and by the errors of the frames. Otherwise the panel is halved. What is
    left are the ends, each in a gap as narrow as ends are exact, and panels in doubt. Diagonal blocks go apart.
    Accuracy: ends to 1e-9 of themselves and of a hundred-thousandth of the span; within 1e-9 of the span of its low end,
    an interval begins where it is proved from. Errors: UsageError if no loop can have its eigenvalues there.
    """
    loops, known = _loops_of(frames, errors, span, columns, place)
    panels = [[(np.full(1, span[0]), np.full(1, GOOD if known[column] else LOST))] for column in range(columns)]
    for each in loops:
        owner, low, label = each.panels(span, [part[each.columns] for part in bounds], place)
        for at, column in enumerate(each.columns.tolist()):
            own = owner == at
            order = np.argsort(low[own])
            panels[column].append((low[own][order], label[own][order]))
    rows = [_intervals(column, *_merged(some, span), loops, span, period[column], place) for column, some in enumerate(panels)]
    names = ("column", "index", "count", "low", "high", "low_omega", "high_omega", "doubt", "residual")
    parts = zip(*(row for some in rows for row in some), strict=True)
    kinds = (int, int, int, float, float, float, float, int, float)
    return Intervals(**{name: np.array(part, kind) for name, part, kind in zip(names, parts, kinds, strict=True)})


def _loops_of(frames, errors, span, columns, place):
    """The loops by diagonal blocks, without states that are 0 at the end of every frame, and the columns with known frames."""
    points = span[0] + (span[1] - span[0]) * np.array(TYPICAL)
    E, _ = errors(np.repeat(np.arange(columns), points.size), np.tile(points, columns))
    E = E.reshape(columns, points.size, *E.shape[1:])
    finite, loops = np.isfinite(E).all((-1, -2)), []
    there = (finite[..., None, None] & (E + np.eye(E.shape[-1]) != 0)).any((0, 1))
    for block in blocks_of(there):
        own = block[:, None], block
        if there[own].any():
            loops.append(_Loops(frames, errors, np.flatnonzero(finite.any(-1)), E.shape[-1], block))
            place.refuse(E[finite][:, *own])
    return loops, finite.any(-1)


@dataclass(frozen=True, slots=True, eq=False)
class _Loops:
    """A diagonal block of the frames, which have `order` states, of some columns; frames, errors: of all columns."""

    frames: object
    errors: object
    columns: np.ndarray
    order: int
    block: np.ndarray

    def at(self, column, p):
        """The frames less identity, `(n, r, r)`, and bounds on the errors of their entries."""
        E, dE = self.errors(self.columns[column], p)
        if E.shape[-1] != self.order:  # states that are there at some values alone
            return (np.full((p.size, *2 * self.block.shape), np.nan),) * 2
        return E[:, self.block[:, None], self.block], np.abs(dE[:, self.block[:, None], self.block])

    def about(self, column, middle, radius):
        """`at` the middles of discs, and the frames on their rims, `(n, points, r, r)`, NaN if there may be a pole inside."""
        rim = middle[:, None] + radius[:, None] * RIM
        p, columns = np.concatenate([middle[:, None], rim], axis=1), self.columns[column][:, None]
        inside, pivots = (self.frames(columns, each).pivots for each in (middle[:, None], rim))
        pivots = pivots.reshape(*rim.shape, -1)
        poles = pole_inside(pivots, level(inside[:, None])) & (pivots != pivots[:, :1]).any((1, 2))
        E, dE = self.at(np.repeat(column, p.shape[1]), p.ravel())  # all in one call, so that they have the same states
        E, dE = (part.reshape(*p.shape, *part.shape[1:]) for part in (E, dE))
        return E[:, 0].real, dE[:, 0], np.where(poles[:, None, None, None], np.nan, E[:, 1:])

    def panels(self, span, bounds, place):
        """Panels that cover the span: their columns, low ends and labels."""
        edges, count = np.linspace(*span, PANELS + 1), len(self.columns)
        column, low, high = np.repeat(np.arange(count), PANELS), np.tile(edges[:-1], count), np.tile(edges[1:], count)
        many, tried = min(MANY, max(PANELS, LARGE // self.block.size**2)), np.zeros(count, int)
        done, width, few = [], span[1] - span[0], max(1, ENTRIES // (2 * RIM.size * self.block.size**2))
        while column.size:
            parts = [slice(first, first + few) for first in range(0, column.size, few)]
            label = np.concatenate([self._label(column[some], low[some], high[some], bounds, place) for some in parts])
            narrow = (NARROW * (high - low) <= _exact((low + high) / 2, width)) | (high - span[0] <= EXACT * NEAR_ZERO * width)
            open_ = np.bincount(column, minlength=count)
            tried += open_
            lost = ((open_ > many) | (tried > OFTEN * many))[column]
            label = np.where((label == OPEN) & ~narrow & lost, LOST, label)
            closed = (label != OPEN) | narrow
            done.append((column[closed], low[closed], label[closed]))
            column, low, high = (part[~closed] for part in (column, low, high))
            middle = (low + high) / 2
            column, low, high = np.tile(column, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
        return [np.concatenate(parts) for parts in zip(*done, strict=True)]

    def _label(self, column, low, high, bounds, place):
        """GOOD, BAD or OPEN of panels."""
        middle, half = (low + high) / 2, (high - low) / 2
        E, dE, rims = self.about(column, middle, 2 * half)
        known = (middle - 2 * half >= bounds[0][column]) & (middle + 2 * half <= bounds[1][column])
        known &= np.isfinite(E).all((-1, -2)) & np.isfinite(dE).all((-1, -2)) & np.isfinite(rims).all((-1, -2, -3))
        label = np.full(column.size, OPEN)
        some = np.flatnonzero(known)
        if some.size:
            label[some] = verdicts(E[some], dE[some], rims[some], place)
        return label

    def worst(self, column, p, place):
        """Of each loop the eigenvalue less 1 that is farthest outside of its place, and by how much."""
        E, _ = self.at(np.full(p.size, np.searchsorted(self.columns, column)), p)
        delta = np.linalg.eigvals(np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0)).astype(complex)
        beyond = place.beyond(delta)
        most = beyond.argmax(-1)[:, None]
        return np.take_along_axis(delta, most, -1)[:, 0], np.take_along_axis(beyond, most, -1)[:, 0]


def _exact(p, width):
    """How exact an end is."""
    return EXACT * (np.abs(p) + NEAR_ZERO * width)


def _merged(panels, span):
    """Low ends and labels of runs of panels: of several partitions of the span, each as sorted low ends and labels."""
    edges = np.unique(np.concatenate([low for low, _ in panels]))
    label = np.max([some[np.searchsorted(low, edges, side="right") - 1] for low, some in panels], axis=0)
    edges, label = _runs(edges, label)
    size = np.diff(edges, append=span[1])
    beside = np.concatenate([[LOST], label, [LOST]])
    slivers = (beside[:-2] == OPEN) & (beside[2:] == OPEN) & (size <= _exact(edges, span[1] - span[0]) / 8)
    return _runs(edges, np.where(slivers, OPEN, label))  # in a gap a few panels may settle


def _runs(edges, label):
    """Neighbours with the same label as one."""
    new = np.append(True, label[1:] != label[:-1])
    return edges[new], label[new]


def _intervals(column, edges, label, loops, span, period, place):
    """Yield the rows of a column from its runs of panels, sorted; edges: their low ends."""
    width, runs = span[1] - span[0], list(zip(edges, [*edges[1:], span[1]], label, strict=True))
    doubt, parts, gaps = NONE, [], {}
    for at, (low, high, what) in enumerate(runs):
        sides = [runs[next_][2] for next_ in (at - 1, at + 1) if 0 <= next_ < len(runs)]
        if what == OPEN and ({*sides} == {GOOD, BAD} or sides in ([GOOD], [BAD])):
            tight, begun = high - low <= _exact(high, width), at == 0 and sides == [GOOD] and high - low <= BEGUN * width
            doubt = max(doubt, NONE if tight or begun else ROUNDING)
            if tight or not begun:
                gaps |= dict.fromkeys((low, high), (low, high))
        elif what != BAD:
            doubt = max(doubt, {GOOD: NONE, LOST: SEARCH}.get(what, CROWDED))
            parts.append((low, high, what == GOOD))
    count = index = sum(good for *_, good in parts)
    for low, high, good in parts:
        if not good:
            yield column, -1, count, low, high, np.nan, np.nan, doubt, 0.0
            continue
        ends, omegas, left = zip(*(_end(column, edge, gaps, loops, span, period, place) for edge in (low, high)), strict=True)
        yield column, count - index, count, *ends, *omegas, doubt, max(left)
        index -= 1
    if not parts:
        yield column, -1, 0, *4 * (np.nan,), doubt, 0.0


def _end(column, edge, gaps, loops, span, period, place):
    """The end of an interval at the edge of a gap: its value, the frequency there (rad/s), and what is left of the equation."""
    if edge not in gaps:  # where the span ends, or where nothing is known beyond
        return edge, np.nan, 0.0
    low, high = gaps[edge]
    own = [each for each in loops if column in each.columns]

    def worst(p):
        found = [each.worst(column, np.array([p]), place) for each in own]
        return max(((delta[0], beyond[0]) for delta, beyond in found), key=lambda each: each[1])

    (first, one), (last, other) = worst(low), worst(high)
    p, (delta, left) = (low + high) / 2, (first, one) if one > other else (last, other)
    if place.smooth and one * other < 0:
        p = (low * other - high * one) / (other - one)
        delta, left = worst(p)
    for end, side in zip(span, (low, high), strict=True):
        if side == end:
            return end, abs(np.angle(1 + delta)) / period, 0.0
    return p, abs(np.angle(1 + delta)) / period, abs(left)
