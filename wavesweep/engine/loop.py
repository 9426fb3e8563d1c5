"""Loops of one structure with their numbers put in: what the engine computes with, one loop or a batch."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np

from wavesweep.engine._drawing import complex_gain, gain_at_signal
from wavesweep.engine._drawing.delays_in_series import with_delays_of_one_step
from wavesweep.engine._drawing.drawing import Drawing, name_of, path_of, scalars
from wavesweep.engine._drawing.expressions import Tree
from wavesweep.engine._loops import dead_time, domain, from_drawing
from wavesweep.engine._loops.common_tick import with_common_tick
from wavesweep.engine._loops.from_drawing import Ports
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._stability.spectrum import radius_of
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.rows import distinct, items_of, selected

Floats = np.ndarray[Any, np.dtype[np.float64]]
Bools = np.ndarray[Any, np.dtype[np.bool_]]
Span = tuple[float, float]


class Loops(NamedTuple):
    """Loops of one structure with their numbers put in.

    drawing: the structure. values: path -> number, or array over the loops of a batch; a number
    that is zero in one of them is zero in all.
    """

    drawing: Drawing
    values: Mapping[str, Any]

    @property
    def read(self) -> Self:
        """The loops with the numbers that their drawing reads alone."""
        read_values = {
            p: value
            for p, value in self.values.items()
            if p in self.drawing.reads or p in self.drawing.building
        }
        return type(self)(self.drawing, read_values)

    @property
    def unbuilt(self) -> Self:
        """The loops without the whole ticks of dead times with which they were built."""
        building = self.drawing.building
        return type(self)(
            self.drawing,
            {path: value for path, value in self.values.items() if path not in building},
        )

    def at_any_value_of(self, path: str) -> Self:
        """The loops at any value of a number: `unbuilt` if dead times follow from it."""
        return self.unbuilt if name_of(path) in self.drawing.timing else self

    def with_gain_at(self, signal: str, number: str = gain_at_signal.GAIN) -> "Loops":
        """The loops with a gain behind a signal, the number of that name, with the value 1: with it
        they are cut there."""
        drawing = gain_at_signal.with_gain(self.drawing, signal, number)
        return Loops(drawing, {**self.values, path_of(number): 1.0})

    def later_at_gain(self, runs: int) -> "Loops":
        """These loops, cut by `with_gain_at`, in which all wires read the signal behind the gain so
        many runs of its block later."""
        if not runs:
            return self
        return Loops(gain_at_signal.with_late_signal(self.drawing, runs), self.values)

    def with_complex_factor(self, re: Tree, im: Tree) -> "Loops":
        """These loops, cut by `with_gain_at`, with the factor `re + j im` in place of the gain, as
        real loops of twice the size, see `complex_gain`."""
        drawing = complex_gain.with_complex_factor(self.drawing, re, im)
        values = dict(self.values)
        built = dead_time.built(self.drawing, scalars(values))
        for path in drawing.building:  # of both parts dead times have the same whole ticks
            values[path] = built[path.replace(complex_gain.TWIN, "")]
        return Loops(drawing, values)

    @property
    def items(self) -> tuple[tuple[str, Any], ...]:
        """The pairs of the numbers, by which a loop is remembered; arrays of one as tuples."""
        return items_of(self.values)

    @classmethod
    def remembered(cls, drawing: Drawing, items: tuple[tuple[str, Any], ...]) -> Self:
        """The loops that are remembered by such pairs."""
        values = {
            path: np.array(numbers) if isinstance(numbers, tuple) else numbers
            for path, numbers in items
        }
        return cls(drawing, values)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the arrays among the numbers."""
        return np.broadcast_shapes(*(np.shape(value) for value in self.values.values()))

    @property
    def rate(self) -> Any:
        """The rate of the tick (Hz), a number or an array over the loops."""
        return from_drawing.rate_of(self.drawing, self.values)

    def changed(self, changes: Mapping[str, Any]) -> Self:
        """The loops with other numbers."""
        return type(self)(self.drawing, {**self.values, **changes})

    def some(self, part: Any) -> Self:
        """Some of the loops; part: an index, a slice or an array of indices."""
        return type(self)(self.drawing, selected(self.values, part))

    def one(self, index: int) -> Self:
        """One of the loops, with plain numbers."""
        values = selected(self.values, index)
        plain = {
            path: value.item() if isinstance(value, np.generic) else value
            for path, value in values.items()
        }
        return type(self)(self.drawing, plain)

    def building(self) -> dict[str, Any]:
        """The whole numbers by which dead times decide how the loops are built, by their paths; of
        complex numbers after a small step of their imaginary parts, see `dead_time.structure`."""
        return dead_time.structure(self.drawing, self.values)

    def built_alike(self, members: np.ndarray) -> Iterator[tuple[np.ndarray, "Loops"]]:
        """Yield some of the members, and their loops with the whole numbers of ticks of their dead times.

        members: what the loops are called by the caller, `(loops,)`.
        """
        if not self.drawing.dead_times:
            yield members, self
            return
        building = {
            path: np.broadcast_to(number, members.shape).astype(int)
            for path, number in self.building().items()
        }
        for batch in distinct(list(building.values()), members.size):
            ticks = {path: int(number[batch[0]]) for path, number in building.items()}
            yield members[batch], Loops(self.drawing, selected(self.values, batch) | ticks)

    def in_common_tick(self) -> "Loops":
        """The loops drawn with the longest tick that they have in common, for analyses that look at whole frames alone."""
        return Loops(*with_common_tick(self.drawing, self.values))

    def in_whole_ticks(self, path: str) -> "Loops | None":
        """One loop with a tick of which its dead times are whole numbers, for exact arithmetic; None if there is none."""
        drawing = dead_time.in_whole_ticks(self.drawing, self.values, path)
        return None if drawing is None else Loops(drawing, self.values)

    def dead_times(self) -> dict[str, dead_time.DeadTime]:
        """The dead times of the loops by the names of their blocks."""
        return dead_time.of_loops(self.drawing, self.values)

    def breaks(self, path: str, span: Span) -> list[float]:
        """The ends of a number's span and the values within it at which dead times decide anew how one loop is built."""
        return dead_time.breaks(self.drawing, self.values, path, span)

    def pieces(self, path: str, span: Span) -> Iterator[tuple[Span, dict[str, int]]]:
        """Yield the parts of a number's span in which one loop is built alike, with the whole numbers by which it is."""
        yield from dead_time.pieces_of(self.drawing, self.values, path, span)

    def domain(self, path: str, span: Span) -> Span:
        """The values of a number, about a span, between which all loops are analytic functions of it on the real axis.

        Errors: UsageError if there is a value within the span at which one of them is not.
        """
        return domain.domain(self.drawing, self.values, path, span)

    def guards_at(self, path: str, shape: tuple[int, ...]) -> np.ndarray:
        """What must not vanish where the loops are analytic in a number, `(*shape, guards)`."""
        return domain.guards_at(self.drawing, self.values, path, shape)

    def unsuitable(self) -> Bools:
        """Which of the loops have a number that a key does not accept, `(loops,)`."""
        return domain.unsuitable(self.drawing, self.values)

    def refuse_unsuitable(self) -> None:
        """Raise UsageError if one of the loops has a number that a key does not accept."""
        domain.refuse_unsuitable(self.drawing, self.values)

    def drawn(self, out: str = "", beside: str = "") -> MultirateLoop:
        """The loops compiled to blocks on a common tick, perhaps without one number or two.

        out, beside: these; what they multiply is the signal PRODUCT, what comes of it FACTOR, of
        the second one BESIDE.
        """
        return from_drawing.assembled(self.drawing, self.values, out, beside)

    def twins(self, out: str = "", beside: str = "") -> tuple[MultirateLoop, MultirateLoop]:
        """Two loops between those of the batch, in which drift is searched for, or one twice if no number varies."""
        return from_drawing.twins(self.drawing, self.values, out, beside)

    def drift(
        self, out: str = "", watched: tuple[str, ...] = (), second: str = ""
    ) -> MarginalModes:
        """What nothing opposes in the loops.

        out, second: numbers that are taken out, see `drawn`. watched: signals that are read in
        every tick.
        """
        return _drift_of_structure(
            (self.drawing, self._structure, out, second, tuple(watched)),
            lambda: _drift(*self.twins(out, second), tuple(watched)),
        )

    def drift_of_frames(self) -> MarginalModes:
        """`drift`, and with it what nothing opposes from frame to frame, whatever it does in
        between."""
        return _drift_of_structure(
            (self.drawing, self._structure), lambda: _drift_of_frames(*self.twins())
        )

    @property
    def _structure(self) -> tuple[tuple[str, Any], ...]:
        """The pairs of the numbers; of one that varies, and that decides nothing about how loops
        are built, the signs of its ends in place of its values."""
        if self.drawing.dead_times:
            return self.items
        pairs = dict(self.items)
        for path, value in self.values.items():
            if isinstance(value, np.ndarray) and name_of(path) not in self.drawing.shaping:
                low = float(np.min(value.real))
                high = float(np.max(value.real))
                pairs[path] = (np.sign(low), np.sign(high), "varied") if low < high else low
        return tuple(pairs.items())

    def drift_at_hand(self) -> MarginalModes:
        """The drift as the hand's port sees it."""
        return self.drift(watched=Ports.of_hand(self.drawing).signals)

    def frames(self, drift: MarginalModes) -> Floats:
        """Frame-to-frame matrices less identity, without drift, `(..., n, n)`; NaN where rounding leaves nothing of them."""
        drawn = self.drawn()
        with drawn.naming_blocks(), np.errstate(all="ignore"):
            return drift.closed_frame(drawn)

    def frames_with_reliability(
        self, drift: MarginalModes, drawn: MultirateLoop | None = None
    ) -> tuple[Floats, Bools]:
        """`frames`, and whether rounding hides their spectral radius, `(...)`.

        drawn: the blocks of the loops, if the caller has them.
        """
        drawn = drawn or self.drawn()
        with drawn.naming_blocks(), np.errstate(all="ignore"):
            return drift.frame_with_reliability(drawn)

    def radii(self, size: int = 1) -> Floats:
        """Spectral radius per frame of each of `size` loops, `(size,)`, without drift.

        Infinite after overflow, and NaN if rounding could move it by a thousandth of itself or of
        1.
        """
        radii = np.array(
            np.broadcast_to(
                radius_of(*self.frames_with_reliability(self.drift_of_frames())), (size,)
            )
        )
        if size > 1:
            for index in np.flatnonzero(np.isnan(radii)).tolist():
                alone = self.one(index)
                radii[index] = radius_of(
                    *alone.frames_with_reliability(alone.drift_of_frames())
                ).item()
        return radii

    def blocks_without_solution(self) -> list[str] | None:
        """Names of the blocks on a loop of direct terms that has no solution with these numbers; None if all have one."""
        return _blocks_without_solution(self.drawing, self.items)


def _drift_of_structure(
    structure: tuple[Any, ...], find: Callable[[], MarginalModes]
) -> MarginalModes:
    """The drift of loops that differ in the values of numbers alone, which is looked for once.

    If the shapes of all modes are the same in two loops, they are so for any values of the numbers
    that vary, but for a few that none of the two has. A drift that depends on them is found for each
    batch, and so is none at all, which is also what is known where numbers have no exact value.
    """
    remembered = _known(structure)
    if not remembered:
        with np.errstate(all="ignore"):
            drift = find()
        if drift.varying or not drift.constant:
            return drift
        remembered.append(drift)
    return remembered[0]


@lru_cache(maxsize=256)
def _known(_: tuple[Any, ...]) -> list[MarginalModes]:
    return []


# twins of the same numbers are the same objects
_drift = lru_cache(maxsize=256)(MarginalModes.of)
_drift_of_frames = lru_cache(maxsize=256)(MarginalModes.of_frames)


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def _blocks_without_solution(
    drawing: Drawing, items: tuple[tuple[str, Any], ...]
) -> list[str] | None:
    values = dict(items)
    # A delay has no direct term, however long it is.
    short = with_delays_of_one_step(drawing, values)
    try:
        drawn = Loops(short, values).drawn()
    except IllPosedLoopError:  # within a plant
        return [block.name for plant in drawing.plants for block in plant.members]
    try:
        with drawn.naming_blocks():
            Ticks.of(drawn, alone=True)
    except IllPosedLoopError:
        return drawn.direct_blocks()
    return None
