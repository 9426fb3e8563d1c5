"""Intervals of a number from panels of its span, each of which is in an interval, or not, as a
whole; else it is halved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.intervals import SHARE_OF_SPAN, Intervals

FIRST_PANELS = 2  # of a column to begin with, as of one of many pieces along a dead time
SEEN_AT = 17  # values of a column, between which ends are looked for
MOST_SECANTS = 12  # of such a search, which ends in a few where the number moves the end smoothly
# of a disc; its lower half is the conjugate
HALF_RIM = np.exp(1j * np.pi * (np.arange(8) + 0.5) / 8)
NARROW_PANEL = 4  # see Accuracy
LOW_END_PARTS = 0.5 ** np.arange(1, 9)  # of what is not proved next to the low end
SEEN_OUTSIDE = 1e-9  # by which it would be seen to be so there
GAP_EXACTNESS = 2  # times as exact as ends are, in the middle of which one is
SAFE = 1.5  # on the largest value at points of a rim, for those between
GOOD, OPEN, LOST, BAD = range(4)  # labels of panels; of two that overlap the larger one holds


class Domain(NamedTuple):
    """The values of a number at which columns of loops are asked about.

    span: the lowest and the highest one. period: of the frame, s, `(columns,)`. bounds: beyond them
    there is no loop, two arrays `(columns,)`. resolved(column, low, high): whether loops have no
    narrow features there. from_above: whether it is the high end that a drift is next to: all is
    done with the number's other sign.
    """

    span: tuple[float, float]
    period: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    resolved: Callable[..., np.ndarray]
    from_above: bool = False

    @property
    def width(self) -> float:
        """Of the span."""
        return self.span[1] - self.span[0]


class Accuracy(NamedTuple):
    """How exact ends are, of themselves and of a NEAR_ZERO-th of the span, and how many of the
    narrowest panels are as wide.

    least, begun: shares of the span next to its low end, where a gain of zero may leave a drift: in
    the one no panel is halved; an interval that is proved from the other one on, of each column,
    begins at the low end, if nothing is outside at the values that are looked at in between, and
    what is refuted from there on is so from the low end, if none of them is seen inside. slow:
    of that share no panel is halved below a NARROW_PANEL-th of its distance, since rounding does
    not tell the eigenvalue of the drift from 1.
    """

    exact: float
    finest: float
    least: float
    begun: np.ndarray
    slow: bool = False

    def of(self, p: np.ndarray | float, width: float) -> np.ndarray | float:
        """How exact an end at p is, in a span of that width."""
        return self.exact * (np.abs(p) + SHARE_OF_SPAN * width)


class Judge(Protocol):
    """What labels the panels of some columns.

    order: of its matrices. many: panels of a column that are open, beyond which it is given up.
    smooth: whether `worst` is smooth in the number. forms: `ByForms`, which may show panels too, or None.
    """

    columns: np.ndarray
    order: int
    many: int
    smooth: bool
    forms: Any

    def struggles(self, tried: np.ndarray) -> np.ndarray:
        """Of which columns forms are to be asked; tried: panels of each so far."""

    def label(self, column, low, high, bounds) -> np.ndarray:
        """GOOD, BAD or OPEN of panels; column: index into its columns. bounds: p beyond them has
        no loop."""

    def worst(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What decides at values of a column, on the unit circle or near it, less 1, and by how
        much it is outside, NaN if that is not known."""


def along_panels(
    judges: Sequence[Any], finite_columns: np.ndarray, domain: Domain, accuracy: Accuracy
) -> Intervals:
    """All intervals of a number within a domain in which all judges find GOOD, per column.

    finite_columns: columns of which anything is known, `(columns,)`. What is left are the ends, each in a
    gap as narrow as ends are exact, and panels in doubt.
    """
    if domain.from_above:
        low, high = domain.span
        turned = domain._replace(
            span=(0.0 - high, 0.0 - low),
            resolved=lambda column, low, high: domain.resolved(column, -high, -low),
            from_above=False,
        )
        return _turned(along_panels(list(map(_Turned, judges)), finite_columns, turned, accuracy))
    # Of each column partitions of the span, each as sorted low ends of panels and their labels:
    # first the span as one panel, which is in doubt if nothing is known, then those of each judge.
    partitions = []
    for is_known in finite_columns:
        label = GOOD if is_known else LOST
        partitions.append([(np.full(1, domain.span[0]), np.full(1, label))])
    for judge in judges:
        owner, low, label = _panels(judge, domain, accuracy)
        for place, column in enumerate(judge.columns.tolist()):
            of_column = np.flatnonzero(owner == place)
            of_column = of_column[np.argsort(low[of_column])]
            partitions[column].append((low[of_column], label[of_column]))

    rows = []
    for column, partitions_of_column in enumerate(partitions):
        runs = _merged(column, partitions_of_column, domain, accuracy)
        rows.extend(_rows(column, runs, judges, domain, accuracy))
    return Intervals(*map(np.array, zip(*rows, strict=True)))


class _Turned:
    """A judge of panels of the number with the other sign."""

    def __init__(self, judge: Judge) -> None:
        self.judge = judge

    def __getattr__(self, name: str) -> Any:
        return getattr(self.judge, name)

    def label(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        return self.judge.label(column, -high, -low, bounds)

    def worst(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.judge.worst(column, -p)


def _turned(intervals: Intervals) -> Intervals:
    """Intervals of the number with the other sign."""
    turned = replace(
        intervals,
        index=np.where(intervals.index < 0, -1, intervals.count - 1 - intervals.index),
        low=0.0 - intervals.high,
        high=0.0 - intervals.low,
        low_omega=intervals.high_omega,
        high_omega=intervals.low_omega,
        low_cause=intervals.high_cause,
        high_cause=intervals.low_cause,
    )
    return turned.take(np.lexsort((turned.low, turned.column)))


class _Row(NamedTuple):
    """An interval, or an open place, with the fields of `Intervals` in their order."""

    column: int
    index: int
    count: int
    low: float
    high: float
    low_omega: float
    high_omega: float
    doubt: int
    residual: float
    low_cause: int = 0
    high_cause: int = 0
    argument: int = Intervals.SAMPLED


class _End(NamedTuple):
    """The end of an interval: its value, the frequency there (rad/s), and what is left of the
    equation."""

    value: float
    omega: float
    left: float


class _Worst(NamedTuple):
    """What decides at a value, less 1, and by how much it is outside."""

    delta: complex
    beyond: float


def _panels(judge, domain, accuracy):
    """Panels that cover the span, as `[column, low, label]`, each `(panels,)`, in no order; column:
    index into judge.columns.

    Those that are neither labelled nor narrow are halved; of a column with too many of them they
    are LOST.
    """
    width = domain.width
    bounds = [bound[judge.columns] for bound in domain.bounds]
    count = len(judge.columns)
    edges = [_first_edges(judge, column, domain, accuracy) for column in judge.columns.tolist()]
    column = np.repeat(np.arange(count), [of_column.size - 1 for of_column in edges])
    low = np.concatenate([of_column[:-1] for of_column in edges])
    high = np.concatenate([of_column[1:] for of_column in edges])
    many = judge.many
    # Entries of matrices at a time.
    at_once = max(1, 2_000_000 // (2 * HALF_RIM.size * judge.order**2))
    tried = np.zeros(count, int)  # panels of each column, in all rounds
    helped = np.zeros(count, bool)  # by forms
    done = []
    while column.size:
        label = np.full(column.size, OPEN)
        portion = np.flatnonzero(domain.resolved(judge.columns[column], low, high))
        for begin in range(0, portion.size, at_once):
            batch = portion[begin : begin + at_once]
            label[batch] = judge.label(column[batch], low[batch], high[batch], bounds)

        open_panels = np.bincount(column, minlength=count)  # as this round began
        tried += open_panels
        struggles = judge.forms and (judge.struggles(tried) & ~helped)
        for place in np.flatnonzero(struggles).tolist():
            helped[place] = True
            open_of_column = (column == place) & (label == OPEN)
            stretches = judge.forms.told(
                int(judge.columns[place]), low[open_of_column], high[open_of_column]
            )
            pieces = _divided(low[open_of_column], high[open_of_column], stretches)
            column = np.append(column[~open_of_column], np.full(pieces[0].size, place))
            low, high, label = (
                np.append(whole[~open_of_column], parts)
                for whole, parts in zip((low, high, label), pieces, strict=True)
            )

        size = high - low
        from_low_end = high - domain.span[0]
        begun = accuracy.begun[judge.columns[column]] * width
        drifts = accuracy.slow & (from_low_end <= begun)
        narrow = accuracy.finest * size <= accuracy.of((low + high) / 2, width)
        narrow |= from_low_end <= accuracy.least * width
        narrow |= drifts & (NARROW_PANEL * size <= from_low_end)

        given_up = (open_panels > many) | (tried > 16 * many)  # 16 times as many, in all
        label[(label == OPEN) & ~narrow & given_up[column]] = LOST
        closed = (label != OPEN) | narrow
        done.append((column[closed], low[closed], label[closed]))

        column = np.tile(column[~closed], 2)
        low = low[~closed]
        high = high[~closed]
        middle = (low + high) / 2
        low = np.concatenate([low, middle])
        high = np.concatenate([middle, high])
    return [np.concatenate(arrays) for arrays in zip(*done, strict=True)]


def _divided(low, high, stretches):
    """Panels divided at the ends of stretches, as low ends, high ends and labels; stretches: low,
    high and label."""
    order = np.argsort(low)
    ends = [end for start, stop, _ in stretches for end in (start, stop)]
    edges = np.unique(np.concatenate([low, high, ends]))
    middles = (edges[:-1] + edges[1:]) / 2
    within = np.searchsorted(low[order], middles) - 1
    inside = (within >= 0) & (middles < high[order][within])
    label = np.full(middles.size, OPEN)
    for start, stop, told in stretches:
        label[(start < middles) & (middles < stop)] = told
    return edges[:-1][inside], edges[1:][inside], label[inside]


def _first_edges(judge, column, domain, accuracy):
    """The edges of the panels of a column to begin with: ever nearer to where `worst` is seen to go
    beyond what is asked, and to the low end if there is a drift; halves of a `smooth` judge, which
    knows more of these."""
    low, high = domain.span
    edges = np.linspace(low, high, FIRST_PANELS + 1)
    if judge.smooth:
        return edges
    p = np.linspace(low, high, SEEN_AT)
    beyond = np.nan_to_num(judge.worst(column, p)[1], nan=-1.0)
    ends = []
    for change in np.flatnonzero(np.diff(beyond > 0)):
        exact = accuracy.of(p[change], domain.width) / accuracy.finest
        before, end = p[change : change + 2]
        of_before, of_end = beyond[change : change + 2]
        for _ in range(MOST_SECANTS):
            if not abs(end - before) > exact:
                break
            with np.errstate(all="ignore"):
                step = of_end * (end - before) / (of_before - of_end)
            before, end = end, np.clip(end + step, low, high)
            of_before, of_end = of_end, judge.worst(column, np.array([end]))[1][0]
        ends.append((end, exact / 2))
    if accuracy.begun[column] > accuracy.least:
        ends.append((low, accuracy.least * domain.width))
    for end, nearest in ends:
        off = nearest * 2.0 ** np.arange(np.ceil(np.log2((high - low) / nearest)))
        edges = np.concatenate([edges, end - off, end + off])
    edges = np.unique(edges)
    return edges[(edges >= low) & (edges <= high)]


def _merged(
    column: int, panels: list[tuple[np.ndarray, np.ndarray]], domain: Domain, accuracy: Accuracy
) -> tuple[np.ndarray, np.ndarray]:
    """Low ends and labels of runs of panels: of several partitions of the span, each as sorted
    low ends and labels."""
    edges = np.unique(np.concatenate([low for low, _ in panels]))
    label = np.full(edges.size, GOOD)
    for low, of_panel in panels:
        label = np.maximum(label, of_panel[np.searchsorted(low, edges, side="right") - 1])
    edges, label = _runs(edges, label)

    # In a gap a few panels may settle.
    width = domain.width
    start, stop = domain.span
    exact = accuracy.of(edges, width)
    size = np.diff(edges, append=stop)
    before = np.append(0, size[:-1])
    after = np.append(size[1:], 0)
    open_before = np.append(LOST, label[:-1]) == OPEN
    open_after = np.append(label[1:], LOST) == OPEN
    small = (size <= exact / 8) | (before + size + after <= GAP_EXACTNESS * exact)
    edges, label = _runs(edges, np.where(open_before & open_after & small, OPEN, label))

    from_low_end = np.append(edges[1:], stop) - start
    drifts = from_low_end <= accuracy.slow * accuracy.begun[column] * width
    first = np.max(np.flatnonzero(drifts & (label == OPEN)), initial=-1) + 1
    if (label[:first] < LOST).all():
        label[:first] = OPEN
    return _runs(edges, label)


def _runs(edges: np.ndarray, label: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours with the same label as one."""
    new = np.append(True, label[1:] != label[:-1])
    return edges[new], label[new]


class _Runs(NamedTuple):
    """What runs of panels of a column tell.

    doubt: the largest. intervals: low, high, and whether it is one for certain. gaps: those that
    have an end in them, by their own ends.
    """

    doubt: Doubt
    intervals: list[tuple[float, float, bool]]
    gaps: dict[float, tuple[float, float]]


def _rows(column, runs, judges, domain, accuracy):
    """Yield the rows of a column from its runs of panels: their low ends, sorted, and labels."""
    judging = [judge for judge in judges if column in judge.columns]
    told = _told(column, runs, judging, domain, accuracy)
    doubt = told.doubt
    count = sum(good for *_, good in told.intervals)
    index = 0
    for low, high, good in told.intervals:
        if not good:
            yield _Row(column, -1, count, low, high, np.nan, np.nan, doubt, 0.0)
            continue
        start = _end(column, low, told.gaps, judging, domain)
        stop = _end(column, high, told.gaps, judging, domain)
        yield _Row(
            column,
            index,
            count,
            start.value,
            stop.value,
            start.omega,
            stop.omega,
            doubt,
            max(start.left, stop.left),
        )
        index += 1
    if not told.intervals:
        yield _Row(column, -1, 0, np.nan, np.nan, np.nan, np.nan, doubt, 0.0)


def _told(column, runs, judging, domain, accuracy) -> _Runs:
    edges, label = runs
    start, stop = domain.span
    width = domain.width
    doubt = Doubt.NONE
    intervals = []
    gaps = {}
    begun = False  # whether an interval begins at the low end, though nothing is proved there
    highs = [*edges[1:], stop]
    for index, (low, high, verdict) in enumerate(zip(edges, highs, label, strict=True)):
        sides = [*label[max(index - 1, 0) : index], *label[index + 1 : index + 2]]
        if verdict == OPEN and sorted(sides) in ([GOOD], [BAD], [GOOD, BAD]):
            near = high - low <= accuracy.begun[column] * width
            if index == 0 and near and _seen_alike(column, low, high, judging, sides == [GOOD]):
                begun = sides == [GOOD]
                continue
            if high - low > GAP_EXACTNESS * accuracy.of(high, width):
                doubt = max(doubt, Doubt.ROUNDING)
            gaps[low] = low, high
            gaps[high] = low, high
        elif verdict != BAD:
            if verdict == LOST:
                doubt = max(doubt, Doubt.SEARCH)
            elif verdict == OPEN:
                doubt = max(doubt, Doubt.CROWDED)
            first = start if begun and not intervals else low
            intervals.append((first, high, verdict == GOOD))
    return _Runs(doubt, intervals, gaps)


def _seen_alike(column, low, high, judging, inside):
    """Whether of values that are ever nearer to the low end none is seen outside; or else the
    first is, and none is seen inside."""
    looked_at = low + (high - low) * LOW_END_PARTS
    beyond = np.array([judge.worst(column, looked_at)[1] for judge in judging])
    outside = (beyond > SEEN_OUTSIDE).any(0)
    if inside:
        return not outside.any()
    return bool(outside[0]) and not (beyond <= SEEN_OUTSIDE).all(0).any()


def _end(column, edge, gaps, judging, domain) -> _End:
    """The end of an interval at the edge of a gap, by what judges this column."""
    if edge not in gaps:  # where the span ends, or where nothing is known beyond
        return _End(edge, np.nan, 0.0)
    low, high = gaps[edge]

    def worst(p: float) -> _Worst:
        worst_of_judges = [judge.worst(column, np.array([p])) for judge in judging]
        delta, beyond = max(worst_of_judges, key=lambda mode: mode[1][0])
        return _Worst(delta[0], beyond[0])

    at_low = worst(low)
    at_high = worst(high)
    p = (low + high) / 2
    at_end = at_low if at_low.beyond > at_high.beyond else at_high
    if all(judge.smooth for judge in judging) and at_low.beyond * at_high.beyond < 0:
        p = (low * at_high.beyond - high * at_low.beyond) / (at_high.beyond - at_low.beyond)
        at_end = worst(p)
    omega = abs(np.angle(1 + at_end.delta)) / domain.period[column]
    for end, side in zip(domain.span, (low, high), strict=True):
        if side == end:
            return _End(end, omega, 0.0)
    return _End(p, omega, abs(at_end.beyond))
