"""Frames of loops at values of a number, for the methods that look at frames and not at a cut."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import prod

import numpy as np

from wavesweep.engine._drawing.drawing import name_of
from wavesweep.engine._loops.domain import domains
from wavesweep.engine._loops.from_drawing import FACTOR, PRODUCT
from wavesweep.engine._loops.resolution import ResolvedAlong
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.open_ticks import OpenTicks
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._monodromy.radius import errors_within, within
from wavesweep.engine._search.lines_of_loops import lines_in_discs
from wavesweep.engine._search.question import Question
from wavesweep.engine._stability.intervals import Intervals
from wavesweep.engine._stability.sampled_frames import Frames, ParametricFrames
from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct_rows


@dataclass(frozen=True, slots=True, eq=False)
class FramesAlong:
    """Loops of a batch at values p of the number `along`; `number` says which of the loops.

    ticks: of a frame. period: of their frames, s. bounds: of the values with which there are loops.
    resolved: between which of them all expressions of a loop are resolved. open_ticks: the loops
    without the number in their ticks, if it is one scalar gain of them. shared: path of another
    number that is one, in which loops differ: without it in their ticks these are the same loops.
    radius: of each loop, a circle in place of the unit circle.
    """

    loops: Loops
    along: str
    ticks: int
    period: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    resolved: ResolvedAlong
    drift: MarginalModes
    open_ticks: OpenTicks | None
    shared: str = ""
    radius: np.ndarray | None = None

    @staticmethod
    def of(question: Question, loops: Loops, size: int) -> "FramesAlong":
        """The loops of `size` slices within the span, without the number in their ticks if it is
        one scalar gain of them."""
        path_of_number = question.along
        drawn = loops.drawn()
        open_ticks = None
        if loops.drawing.scalar_place(question.number):
            with suppress(IllPosedLoopError), np.errstate(all="ignore"):
                at_one = loops.changed({path_of_number: 1.0})
                opened = at_one.drawn(question.number)
                open_ticks = OpenTicks.of(opened, at_one.drawn(), PRODUCT, FACTOR)
        scalars = []
        for path, value in loops.values.items():
            is_other = np.ndim(value) and path != path_of_number
            if is_other and open_ticks is None and loops.drawing.scalar_place(name_of(path)):
                scalars.append(path)
        return FramesAlong(
            loops=loops,
            along=path_of_number,
            ticks=drawn.ticks,
            period=np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,)),
            bounds=domains(*loops, path_of_number, question.span, size),
            resolved=ResolvedAlong(*loops, path_of_number),
            drift=loops.changed({path_of_number: np.array(question.span)}).drift_of_frames(),
            open_ticks=open_ticks,
            shared=scalars[0] if scalars else "",
        )

    @property
    def family(self) -> ParametricFrames:
        """The same as functions of the number."""
        return ParametricFrames(
            frames=self.frames,
            period=self.period,
            bounds=self.bounds,
            errors=self.errors,
            tight=partial(self.errors, tight=True),
            resolved=self.resolved,
        )

    def _at(self, number: np.ndarray, p: np.ndarray) -> Loops:
        return self.loops.some(number).changed({self.along: p})

    def frames(self, number: np.ndarray, p: np.ndarray) -> Frames:
        """The frames, number and p being broadcast together; NaN for loops of direct terms
        without a solution."""
        p = np.where(p == 0, NEXT_TO_ZERO, p)
        shape = p.shape
        varied = self._at(number, p)
        frames = None
        if self.open_ticks is not None:
            E, *facts = self.open_ticks.frames(number, p)
            frames = _frames(self.drift.removed_from(E), facts, shape)
        elif self.shared:
            frames = self._shared(number, p)
        if frames is None:
            frames = frames_where_solvable(varied, self.drift, shape)
        if self.radius is not None:
            radius = np.broadcast_to(self.radius[number], shape).ravel()
            frames = replace(frames, E=within(frames.E, radius))
        divisors = varied.guards_at(self.along, shape).reshape(p.size, -1)
        return replace(frames, pivots=np.concatenate([frames.pivots, divisors], axis=-1))

    def _shared(self, number: np.ndarray, p: np.ndarray) -> Frames | None:
        """The frames from ticks without the shared number; None if too few loops share them, or
        some have no solution."""
        number, p = (array.ravel() for array in np.broadcast_arrays(number, p))
        other_numbers = {
            path: v[number]
            for path, v in self.loops.values.items()
            if np.ndim(v) and path != self.shared
        }
        first, label = distinct_rows(other_numbers | {"real": p.real, "imag": p.imag}, p.size)
        if 2 * first.size > p.size:
            return None
        at_one = self._at(number[first], p[first]).changed({self.shared: 1.0})
        with suppress(IllPosedLoopError), np.errstate(all="ignore"):
            ticks = OpenTicks.of(
                at_one.drawn(name_of(self.shared)), at_one.drawn(), PRODUCT, FACTOR
            )
            E, *facts = ticks.frames(label, self.loops.values[self.shared][number])
            return _frames(self.drift.removed_from(E), facts, p.shape)
        return None

    def turns(
        self,
        number: np.ndarray,
        p: np.ndarray,
        delta: np.ndarray,
        radius: np.ndarray,
        margin: float,
    ) -> np.ndarray:
        """What modes turn in a frame (rad), `(n, r, 3)`: see `lines_in_discs`.

        p: `(n, points)`, in the middle of panels, and on circles about these. delta, radius:
        eigenvalues less 1 in the middle, and of discs about them, `(n, r)`. Infinite are the
        highest ones of loops without a solution.
        """
        angle = np.abs(np.angle(1 + delta))
        told = np.stack([angle, angle, np.full(angle.shape, np.inf)], axis=-1)
        with suppress(IllPosedLoopError), np.errstate(all="ignore"):
            ticks = self._closed(np.broadcast_to(number[:, None], p.shape).ravel(), p.ravel())
            points = p.shape[1]
            told = lines_in_discs(
                self.loops.drawing, self.drift, ticks, points, delta, radius, margin
            )
        return told

    def _closed(self, number: np.ndarray, p: np.ndarray) -> Ticks:
        """The ticks of loops at values p, `(n,)`, with the sizes of their terms."""
        p = np.where(p == 0, NEXT_TO_ZERO, p)
        if self.open_ticks:
            return self.open_ticks.closed(number, p, terms=True)
        return _ticks(self._at(number, p), terms=True)

    def errors(
        self, number: np.ndarray, p: np.ndarray, *, tight: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Frames at values p, `(n,)`, and bounds on the errors of their entries; NaN for loops
        without a solution.

        tight: see `MarginalModes.frames_with_errors`.
        """
        try:
            ticks = self._closed(number, p)
        except IllPosedLoopError:
            if p.size == 1:
                order = max(2, len(self.drift.remaining))
                unknown = np.full((1, order, order), np.nan)
                return unknown, unknown
            frames = []
            bounds = []
            for index, value in zip(*np.broadcast_arrays(number, p), strict=True):
                E, dE = self.errors(index[None], value[None], tight=tight)
                frames.append(E)
                bounds.append(dE)
            return np.concatenate(frames), np.concatenate(bounds)
        with np.errstate(all="ignore"):
            arrays = self.drift.frames_with_errors(ticks, tight=tight)
        E, dE = (np.broadcast_to(array, (p.size, *array.shape[-2:])) for array in arrays)
        if self.radius is None:
            return E, dE
        radius = np.broadcast_to(self.radius[number], p.shape)
        return within(E, radius), errors_within(E, dE, radius)


def _frames(
    E: np.ndarray,
    facts: Sequence[np.ndarray | complex],
    shape: tuple[int, ...],
) -> Frames:
    """Frames of a batch of that shape, which E, pivots and conditions broadcast to, one after
    the other."""
    pivot, condition = facts
    size = prod(shape)

    def flat(array: np.ndarray | complex, *tail: int) -> np.ndarray:
        return np.broadcast_to(array, (*shape, *tail)).reshape(size, *tail)

    pivots = flat(np.asarray(pivot)[..., None], 1)
    return Frames(flat(E, *E.shape[-2:]), pivots, flat(condition))


def _ticks(loops: Loops, *, terms: bool = False) -> Ticks:
    drawn = loops.drawn()
    with drawn.naming_blocks(), np.errstate(all="ignore"):
        return Ticks.of(drawn, alone=True, terms=terms)


def frames_where_solvable(loops: Loops, drift: MarginalModes, shape: tuple[int, ...]) -> Frames:
    """The frames of a batch of that shape, which the numbers broadcast to, one after the other.

    They are NaN for loops of direct terms without a solution, which a search may come across.
    """
    size = prod(shape)
    try:
        ticks = _ticks(loops)
        with np.errstate(all="ignore"):
            return _frames(drift.frames_of(ticks), ticks.facts, shape)
    except IllPosedLoopError:
        if size == 1:
            order = max(2, len(drift.remaining))
            return Frames(np.full((1, order, order), np.nan), np.zeros((1, 1)), np.full(1, np.inf))
    flat = {}
    for path, value in loops.values.items():
        if np.ndim(value):
            flat[path] = np.broadcast_to(value, shape).ravel()
    loops = loops.changed(flat)
    halves = np.array_split(np.arange(size), 2)
    parts = [frames_where_solvable(loops.some(half), drift, half.shape) for half in halves]
    return Frames.join(parts)


def in_own_time(intervals: Intervals, loops: Loops, path: str) -> Intervals:
    """Intervals whose omegas are of the rate at their ends, if the number is one that the rate
    of the tick follows from."""
    if name_of(path) not in loops.drawing.rating:
        return intervals
    of_rows = loops.some(intervals.column)
    omegas = {}
    for end in ("low", "high"):
        rate = of_rows.changed({path: getattr(intervals, end)}).rate
        omegas[f"{end}_omega"] = getattr(intervals, f"{end}_omega") * (rate / of_rows.rate)
    return replace(intervals, **omegas)
