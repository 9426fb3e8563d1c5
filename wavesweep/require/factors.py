"""Where a loop stays stable along a number while its signal at a cut is multiplied by any factor of
a range: gains from 1/g to g, or phases exp(j phi) of up to p either way.

With L the loop from the signal back to it, f a factor in the middle of some, and T = f L/(1 + f L),

    1 + f (1 + d) L = (1 + f L) (1 + d T),

so no factor f (1 + d) has an eigenvalue on the unit circle where |T| is below 1/|d| on all of it.
The factors of a range are covered by pieces, each of which has a middle f and the largest |d|. If
the loop is stable at f = 1 and |T| is below 1/|d| for each piece, on a panel of the number, it is
stable with all factors there, as no eigenvalue has crossed the circle. A piece for which this is
not shown is halved, and with |d| its circle of factors, of which the real ones, or those of size 1,
alone are asked for. Where a loop with one of the factors is not stable, the margin is missed: such
loops are those at the ends of the range, and those in the middle of pieces that stay open.

A phase makes a complex loop, which is a real one of twice the size. Real and imaginary part of T
below half the level each are enough.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import sqrt
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import BLOCK, GAIN, TWIN, path_of, with_complex_factor
from wavesweep.engine.expressions import ONE
from wavesweep.engine.intervals import SHARE_OF_SPAN, Intervals, Search
from wavesweep.require.at_cut import INPUT, refuse_cut, ticks_between
from wavesweep.require.between import needed, typical_between
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, Accuracy, along_panels
from wavesweep.require.frame_gain import BoundedGain
from wavesweep.require.gain_bound import FACTOR_GAIN, FactorBound
from wavesweep.require.gain_intervals import (
    MOST_DENSE_TICKS,
    attached,
    begun_at_low_end,
)
from wavesweep.require.long_gain import LongGain
from wavesweep.require.pencil import OTHER_TURN, TURN

if TYPE_CHECKING:
    from wavesweep.engine.loop import Loops

PHASE = "phase at the cut"  # a number of no spec
RETURNED = "what comes back to the cut"
# of an end, and of a NEAR_ZERO-th of the span: from there on rounding hides which factor is the last
END_EXACTNESS = 1e-7
FIRST_PIECES = 4  # of a range of factors
FINER_PIECES = 1  # halvings of these beyond those of a panel of the number
MOST_PIECES = 24  # open at a time on a panel, beyond which it stays open
PIECE = np.dtype([("panel", int), ("place", float), ("half", float)])  # of a range, on a panel
LOOKED_AT = 17  # places of a range, where loops are looked at first
ROUNDS = 3  # of factors of open pieces that are looked at


def along_factors(
    loops: Loops, along: str, span, period, bounds, resolved, wanted: FactorBound, stable: Intervals
) -> Intervals:
    """All intervals of a number in which loops are stable with all factors, within those in which
    they may be stable with the factor 1.

    The next: see `along_panels`. Accuracy: ends to END_EXACTNESS. Errors: UsageError for a signal at
    which loops cannot be cut, or that moves without end.
    """
    way = _way(loops, wanted)
    size = period.size
    shown = []
    for route in way.routes:
        drift, port, _, _ = typical_between(
            way.at(way.ends[1]), along, span, size, route, "margins"
        )
        kind = LongGain if port.kind.size > MOST_DENSE_TICKS else BoundedGain
        arc = np.tile([0.0, np.pi], (1, 1))
        about = way.at(way.ends[1]), along, route, 1.0, drift, needed(port.maps), port.kind.size
        shown.append(kind(*about, np.zeros(1, int), stable, arc, at_rest=False))
    judge = _Factors(way, tuple(shown), along, span, np.arange(size), stable)
    width = span[1] - span[0]
    begun = begun_at_low_end(replace(shown[0], columns=np.arange(size)), span)
    ends = Accuracy(END_EXACTNESS, 64.0, END_EXACTNESS, begun, slow=True)
    first = 0 if way.of_gain else 1  # a phase of 0 is the loop itself
    for place in np.linspace(*way.ends, LOOKED_AT)[first:].tolist():
        judge.look_at(place)
    for _ in range(ROUNDS):
        found = along_panels([judge], np.ones(size, bool), span, period, bounds, resolved, ends)
        if not found.doubt.any() or not judge.look_further():
            break
    for tried in judge.tried:
        found = attached(found, tried, SHARE_OF_SPAN * width, END_EXACTNESS)
    return attached(found, stable, SHARE_OF_SPAN * width, END_EXACTNESS)


@dataclass(frozen=True, slots=True)
class _Way:
    """The loops with a factor at the cut that is a number of its own, and what comes back there of
    an input.

    ends: of the range, as places of its pieces: logarithms of gains, or angles. level: of |T| for a
    piece of no width, times its half width.
    """

    loops: Loops
    routes: tuple[tuple[str, str], ...]
    ends: tuple[float, float]
    of_gain: bool
    ticks: int

    def at(self, place, half=0.0) -> Loops:
        """The loops with the factor in the middle of a piece about a place."""
        if self.of_gain:
            return self.loops.changed({path_of(GAIN): np.exp(place) * np.cosh(half)})
        return self.loops.changed({path_of(PHASE): place})

    def level(self, half: float) -> float:
        """What |T| has to be below for a piece of that half width; see above for the half of it.

        With u from -h to h, exp(u) is cosh(h) (1 + d), |d| <= tanh(h); and exp(j u) is 1 + d, |d|
        <= 2 sin(h/2).
        """
        if self.of_gain:
            return sqrt(self.ticks) / np.tanh(half)
        return sqrt(self.ticks) / (4 * np.sin(half / 2))


def _way(loops, wanted) -> _Way:
    refuse_cut(loops.drawing, wanted.cut)
    loops = loops.with_gain_at(wanted.cut)
    ticks = ticks_between(loops, wanted.cut)
    drawing = loops.drawing
    if wanted.margin == FACTOR_GAIN:
        end = float(np.log(wanted.size))
        wires = dict(drawing.wires)
        wires[f"{BLOCK}.u"] = (*wires[f"{BLOCK}.u"], (INPUT, ONE))
        seen = {RETURNED: wanted.cut}
        ends = (-end, end)
    else:
        cos = ("cos", ("name", PHASE, 0), 0)
        sin = ("sin", ("name", PHASE, 0), 0)
        drawing = with_complex_factor(drawing, cos, sin)
        values = {path: loops.values[path.replace(TWIN, "")] for path in drawing.building}
        loops = loops._replace(values={**loops.values, **values, path_of(PHASE): 0.0})
        wires = dict(drawing.wires)
        wires[f"{BLOCK}.u"] = (*wires[f"{BLOCK}.u"], (INPUT, cos))
        wires[f"{BLOCK}{TWIN}.u"] = (*wires[f"{BLOCK}{TWIN}.u"], (INPUT, sin))
        block, _, port = wanted.cut.rpartition(".")
        seen = {RETURNED: wanted.cut, RETURNED + TWIN: f"{block}{TWIN}.{port}"}
        ends = (0.0, float(np.radians(wanted.size)))
    outputs = tuple((name, ((signal, ONE),), "") for name, signal in seen.items())
    drawing = replace(
        drawing,
        wires=tuple(wires.items()),
        inputs=(*drawing.inputs, (INPUT, INPUT, "")),
        outputs=(*drawing.outputs, *outputs),
    )
    routes = tuple((INPUT, OUTPUT + name) for name in seen)
    return _Way(loops._replace(drawing=drawing), routes, ends, wanted.margin == FACTOR_GAIN, ticks)


@dataclass(frozen=True, slots=True, eq=False)
class _Factors:
    """A judge of panels of the number, see `along_panels`.

    shown: for each output what a panel has to have, of any level. tried: where loops with a factor
    are stable, for factors that were looked at. open: the narrowest panel with a piece that stays
    open, by its column: its width, the number and the place of the factor. kept: the pieces that
    stay open on panels, by the column and an end: the others are shown on all parts of these.
    """

    way: _Way
    shown: tuple[BoundedGain, ...]
    along: str
    span: tuple[float, float]
    columns: np.ndarray
    stable: Intervals
    tried: list[Intervals] = field(default_factory=list)
    open: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    kept: dict[tuple[int, str, float], np.ndarray] = field(default_factory=dict)
    many: ClassVar[int] = 150
    smooth: ClassVar[bool] = False

    @property
    def order(self) -> int:
        """Of the pencils."""
        return max(each.order for each in self.shown)

    def look_at(self, place: float) -> None:
        """Look where loops with the factor at a place are stable."""
        loops = self.way.at(np.full(self.columns.size, place))
        records = Search(self.along, self.span, ((self.columns, loops),), lines=False).records()
        self.tried.append(_intervals(records))

    def look_further(self) -> bool:
        """Look at the factors of pieces that stay open, if one of them is not stable; return
        whether it is so."""
        before = len(self.tried)
        for column, (_, p, place) in list(self.open.items()):
            self.look_at(place)
            if not _outside(self.tried[-1], np.array([column]), np.array([p]), np.array([p])).any():
                self.tried.pop()
        self.open.clear()
        self.kept.clear()
        return len(self.tried) > before

    def label(self, column, low, high, bounds):
        """GOOD, BAD or OPEN of panels; BAD where a loop with one of the factors is not stable."""
        label = np.full(column.size, OPEN)
        own = self.columns[column]
        label[~_touched(self.stable, own, low, high)] = BAD
        for known in self.tried:
            label[_outside(known, own, low, high)] = BAD
        at = np.flatnonzero((label == OPEN) & _inside(self.stable, own, low, high))
        halvings = np.log2((self.span[1] - self.span[0]) / (high - low)) + FINER_PIECES
        finest = self._first()[1] * 0.5**halvings
        left = self._left(at, own, low, high)
        open_pieces = [left[:0]]
        while left.size:
            half = left["half"].max()
            now = left["half"] == half
            panel = left["panel"]
            failing = now.copy()
            failing[now] = ~self._fine(left[now], own, low, high, column, bounds)
            many = np.bincount(panel, minlength=column.size) > MOST_PIECES
            stays = failing & ((half / 2 < finest[panel]) | many[panel])
            open_pieces.append(left[stays])
            left = np.concatenate([left[~now], _halves(left[failing & ~stays])])
        still_open = np.concatenate(open_pieces)
        for index in at.tolist():
            own_pieces = still_open[still_open["panel"] == index]
            self._keep(int(own[index]), low[index], high[index], own_pieces)
        label[np.setdiff1d(at, still_open["panel"])] = GOOD
        return label

    def worst(self, column, p):
        """Whether a loop with one of the factors that were looked at is not stable, 1, or all are,
        -1."""
        own = np.full(p.size, column)
        misses = [_outside(known, own, p, p) for known in self.tried]
        return np.zeros(p.size, complex), np.where(np.any(misses, axis=0), 1.0, -1.0)

    def _first(self) -> tuple[np.ndarray, float]:
        """The middles of the first pieces, and half the width of each."""
        edges = np.linspace(*self.way.ends, FIRST_PIECES + 1)
        return (edges[:-1] + edges[1:]) / 2, (edges[1] - edges[0]) / 2

    def _left(self, at, own, low, high):
        """The pieces that are to be shown on panels: those that stay open on twice as wide ones,
        or the first."""
        places, half = self._first()
        first = np.zeros(places.size, PIECE)
        first["place"] = places
        first["half"] = half
        pieces = [first[:0]]
        for index in at.tolist():
            column = int(own[index])
            wider = self.kept.get(
                (column, "from", low[index]), self.kept.get((column, "to", high[index]))
            )
            of_panel = first.copy() if wider is None else wider.copy()
            of_panel["panel"] = index
            pieces.append(of_panel)
        return np.concatenate(pieces)

    def _keep(self, column, low, high, pieces):
        """Keep the pieces that stay open on a panel."""
        self.kept[column, "from", low] = pieces
        self.kept[column, "to", high] = pieces
        narrowest = self.open.get(column, (np.inf, 0.0, 0.0))[0]
        if pieces.size and high - low < narrowest:
            place = float(pieces["place"][pieces.size // 2])
            self.open[column] = float(high - low), float((low + high) / 2), place

    def _fine(self, pieces, own, low, high, column, bounds):
        """Whether |T| is below what pieces of one width need, on their panels."""
        panel = pieces["panel"]
        half = float(pieces["half"][0])
        # In a plane of a number and a factor an eigenvalue meets the place that one map loses.
        halved = round(np.log2(self._first()[1] / half))
        turn = (TURN, OTHER_TURN)[halved % 2]
        loops = self.way.loops.some(own[panel])
        loops = replace(self.way, loops=loops).at(pieces["place"], half)
        fine = np.ones(panel.size, bool)
        of_panels = [bound[column[panel]] for bound in bounds]
        for each in self.shown:
            at = np.flatnonzero(fine)
            if at.size:
                arc = np.tile(each.arc[:1], (panel.size, 1))
                numbers = np.arange(panel.size)
                gain = replace(each, loops=loops, level=self.way.level(half), columns=numbers)
                gain = replace(gain, arc=arc, turn=turn)
                fine[at] = gain.labelled(at, low[panel[at]], high[panel[at]], of_panels) == GOOD
        return fine


def _halves(pieces):
    """Both halves of each piece."""
    below = pieces.copy()
    above = pieces.copy()
    for halves, side in ((below, -1), (above, 1)):
        halves["half"] /= 2
        halves["place"] += side * halves["half"]
    return np.concatenate([below, above])


def _intervals(records) -> Intervals:
    """Records of a search as intervals."""
    stable = records["intervals"] > 0
    return Intervals(
        column=records["slice"].astype(int),
        index=np.where(stable, 0, -1),
        count=records["intervals"].astype(int),
        low=records["low"],
        high=records["high"],
        low_omega=records["low_omega"],
        high_omega=records["high_omega"],
        doubt=records["doubt"].astype(int),
        residual=np.zeros(len(records)),
    )


def _outside(known: Intervals, own, low, high):
    """Whether panels are in none of the intervals of their columns, and nothing there is in
    doubt."""
    in_doubt = (own[:, None] == known.column) & (known.doubt != Doubt.NONE)
    return ~in_doubt.any(-1) & ~_touched(known, own, low, high)


def _touched(known: Intervals, own, low, high):
    """Whether panels have something in common with intervals of their columns, or places in
    doubt."""
    touched = own[:, None] == known.column
    touched &= (known.low < high[:, None]) & (known.high > low[:, None])
    return touched.any(-1)


def _inside(known: Intervals, own, low, high):
    """Whether panels are in one of the stable intervals of their columns."""
    within = (own[:, None] == known.column) & (known.index >= 0)
    within &= (known.low <= low[:, None]) & (known.high >= high[:, None])
    return within.any(-1)
