"""Drawn loops without a number that is one scalar gain of their frame, and slices that share
such a loop."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from wavesweep.engine._drawing.delays_in_series import without_whole_frames
from wavesweep.engine._drawing.drawing import Drawing, name_of, path_of
from wavesweep.engine._loops.algebraic import WORST_CONDITION
from wavesweep.engine._loops.from_drawing import (
    BESIDE,
    FACTOR,
    PRODUCT,
    Ports,
)
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.cut import LinearFractional
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.open_frame import OpenFrame, cut_of, open_frame
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct, distinct_rows

# From the blocks of loops without some numbers, their drawing, these numbers, and the signals of
# theirs that the frame is opened at, to a port that the frame is to show as well; None for none.
FindPort = Callable[[MultirateLoop, Drawing, tuple[str, ...], tuple[str, ...]], Ports | None]

TWO_VALUES = np.array([0.5, 2.0])  # of a number: what differs with them depends on it
# loops at most that are remembered together; a chunk of a large sweep is never asked again
REMEMBERED_LOOPS = 200


@dataclass(frozen=True, eq=False)
class OpenLoops:
    """Loops without a number that is one scalar gain of their frame.

    port: whose input the frame has as well, and whose reaction it shows. second: another number of
    the same wire, that they are without as well (see `shares_wire`), or empty. conserved: whether a
    combination of states drifts in the loops with the number. late: frames by which delays of the
    drawing were shortened, see `without_whole_frames`.
    """

    drawn: MultirateLoop
    frame: OpenFrame
    drift: MarginalModes
    port: Ports | None = None
    second: str = ""
    conserved: bool = False
    late: int = 0
    memo: dict[str, Any] = field(default_factory=dict, init=False, repr=False)  # see `remembered`

    def remembered(self, name: str, make: Callable[[], Any]) -> Any:
        """What was made of these loops under that name, or is made now."""
        if name not in self.memo:
            self.memo[name] = make()
        return self.memo[name]

    @cached_property
    def cut(self) -> LinearFractional | None:
        """The loops cut at the number, or at the two numbers; None if their drift cannot be
        represented in a cut."""
        cut = cut_of(self.frame, self.drift, 1 + bool(self.second), conserved=self.conserved)
        return cut and replace(cut, late=self.late)

    def batch(self, size: int) -> LinearFractional:
        """The cut as a batch of `size` loops."""
        cut: LinearFractional = self.cut  # type: ignore[assignment]  # asked of loops that have one
        return cut.remembered(("batch", size), lambda: cut.as_batch(size))


def open_loops(
    loops: Loops,
    number: str,
    second: str = "",
    *,
    find_port: FindPort | None = None,
    per_loop: bool = False,
    shortened: bool = False,
) -> OpenLoops | None:
    """The loops without a number that is one scalar gain of a frame; None if it is not one.

    second: another number of the same wire, without which they are as well; None if they drift in
    another way without it. find_port: of a port that the frame is to show. per_loop: see
    `product_with_errors`. shortened: whether delays may be shortened, if the frame shows no port.
    """
    drawing = loops.drawing
    if not drawing.scalar_place(number):
        return None
    late = 0
    whole = loops
    if shortened:
        drawing, values, late = without_whole_frames(
            drawing, loops.values, *filter(None, (number, second))
        )
        loops = Loops(drawing, values)
    read = (FACTOR, BESIDE)[: 1 + bool(second)]
    both = dict.fromkeys(map(path_of, filter(None, (number, second))), TWO_VALUES)
    with_both = loops.changed(both)
    loops = loops.changed(dict.fromkeys(both, 0.0))
    closed = with_both.drift()
    drift = loops.drift(number, read, second)
    if drift.varying or closed != with_both.drift_of_frames():
        return None
    if second:
        with_second = loops.changed({path_of(second): TWO_VALUES}).drift(number, read, second)
        if (with_second.constant, with_second.varying) != (drift.constant, drift.varying):
            return None
    conserved = bool(closed.varying)
    if conserved and len(closed.constant) + len(closed.varying) != len(drift.constant):
        return None
    drawn = loops.drawn(number, second)
    port = find_port(drawn, drawing, (number, second), read) if find_port else None
    if port and drawing != whole.drawing:
        return open_loops(whole, number, second, find_port=find_port, per_loop=per_loop)
    shown = (port.force, (port.reaction,)) if port else ("", ())
    with drawn.naming_blocks(), np.errstate(all="ignore"):
        frame = open_frame(drawn, drift, PRODUCT, read, *shown, per_loop=per_loop)
    if frame is None:
        return None
    return OpenLoops(drawn, frame, drift, port, second, conserved, late)


@lru_cache(maxsize=8)  # compiled loops are asked again and again
def remembered_loops(
    drawing: Drawing,
    items: tuple[tuple[str, float], ...],
    number: str,
    second: str,
    find_port: FindPort | None,
) -> OpenLoops | None:
    """`open_loops` of a single loop or of few; items: their numbers, in tuples over the loops."""
    values = {path: np.array(value) if isinstance(value, tuple) else value for path, value in items}
    return open_loops(Loops(drawing, values), number, second, find_port=find_port, shortened=True)


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """Slices with their loops without the number, and perhaps without another one as well.

    loop_of: the loop of each slice. second: the values of the other number. swapped: whether the
    loops are cut at that one, as at a stiffness for intervals of the damping. alone: whether each
    slice has a loop and bounds on rounding of its own.
    """

    loops: OpenLoops
    loop_of: np.ndarray
    second: np.ndarray
    swapped: bool = False
    alone: bool = False

    @staticmethod
    def of(
        loops: Loops, number: str, size: int, *, find_port: FindPort | None = None
    ) -> Opened | None:
        """Return `size` slices with their loops without the number; None if it is not one scalar
        gain of a frame.

        loops: those of the slices. Slices that differ in another number of the same wire alone have
        one loop, which is without that number as well; of several such numbers one that is varied.
        find_port: see `open_loops`. Errors: IllPosedLoopError if the loops have no solution without
        the number.
        """
        if size <= REMEMBERED_LOOPS:
            return remembered_slices(loops.drawing, loops.items, number, size, find_port)
        return _opened(loops, number, size, find_port)

    @staticmethod
    def of_each(
        loops: Loops, number: str, size: int, *, find_port: FindPort | None = None
    ) -> Opened | None:
        """`of` slices that have a loop each, with bounds on rounding of its own."""
        return _without(loops, number, size, alone=True, find_port=find_port)


@lru_cache(maxsize=8)  # what a call takes is estimated before it is done
def remembered_slices(
    drawing: Drawing,
    items: tuple[tuple[str, float | tuple[Any, ...]], ...],
    number: str,
    size: int,
    find_port: FindPort | None,
) -> Opened | None:
    """`_opened` of few slices; items: their numbers, in tuples over the loops."""
    values = {path: np.array(value) if isinstance(value, tuple) else value for path, value in items}
    return _opened(Loops(drawing, values), number, size, find_port)


def _opened(loops: Loops, number: str, size: int, find_port: FindPort | None) -> Opened | None:
    """See `Opened.of`."""
    path = _fixed_beside(loops, number)
    for swapped in (False, True) if path else ():
        with suppress(IllPosedLoopError):
            opened = _without(loops, number, size, path, swapped, find_port=find_port)
            if opened and opened.loops.cut:
                # Loops of direct terms that the second number closes have to have solutions.
                direct = opened.loops.frame.D[..., int(not swapped), 0]
                direct = np.broadcast_to(direct, (int(opened.loop_of.max()) + 1,))[opened.loop_of]
                through = opened.second * direct
                if (1 + np.abs(through) < WORST_CONDITION * np.abs(1 - through)).all():
                    return opened
    return _without(loops, number, size, find_port=find_port)


def by_zeros(loops: Loops, columns: np.ndarray) -> list[np.ndarray]:
    """Places of the columns whose numbers are zero alike, together."""
    return distinct([v[columns] == 0 for v in loops.values.values() if np.ndim(v)], columns.size)


def varied_beside(loops: Loops, number: str) -> str:
    """The path of a number of the same wire (see `shares_wire`) in which slices differ, the last
    one; else empty."""
    paths = [
        path
        for path, v in loops.values.items()
        if np.ndim(v) and loops.drawing.shares_wire(number, name_of(path))
    ]
    return paths[-1] if paths else ""


def _fixed_beside(loops: Loops, number: str) -> str:
    """The path of another number that loops are to be without as well, or empty: of one in which
    they differ, see `varied_beside`, or with which delays are in series; none if they are in series
    with the number alone."""

    def late(*numbers: str) -> int:
        return without_whole_frames(loops.drawing, loops.values, *numbers)[2]

    varied = varied_beside(loops, number)
    if late(number):
        return varied if varied and late(number, name_of(varied)) else ""
    if varied:
        return varied
    for path in loops.values:
        second_number = name_of(path)
        shares_wire = second_number != number and loops.drawing.shares_wire(number, second_number)
        if shares_wire and late(number, second_number):
            return path
    return ""


def _without(
    loops: Loops,
    number: str,
    size: int,
    path: str = "",
    swapped: bool = False,
    *,
    alone: bool = False,
    find_port: FindPort | None,
) -> Opened | None:
    """The slices with loops without the number, and without that with the path `path` if there
    is one; see `Opened`."""
    loop_of = np.arange(size)
    second = np.zeros(size)
    numbers = (number, name_of(path) if path else "")
    if swapped:
        numbers = numbers[::-1]
    if path:
        distinct_in = {name: v for name, v in loops.values.items() if np.ndim(v) and name != path}
        first, loop_of = distinct_rows(distinct_in, size)
        second = np.broadcast_to(loops.values[path], size)
        loops = loops.some(first) if first.size > 1 else loops.one(first[0])
        loops = loops.changed({path: 0.0})
    elif size == 1 and not alone:
        loops = loops.one(0)
    if alone or max(map(np.size, loops.values.values()), default=1) > REMEMBERED_LOOPS:
        without = open_loops(loops, *numbers, find_port=find_port, per_loop=alone, shortened=True)
    else:
        without = remembered_loops(loops.drawing, loops.items, *numbers, find_port)
    if without is None:
        return None
    return Opened(without, loop_of, second, swapped, alone)
