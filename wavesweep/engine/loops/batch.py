"""Loops of one structure with their numbers put in, one loop or a batch, and which of them are alike."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from wavesweep.engine.drawing.drawing import Drawing
    from wavesweep.engine.loops.multirate import MultirateLoop


class Loops(NamedTuple):
    """Loops of one structure with their numbers put in.

    values: path -> number, or array over the loops of a batch; a number that is zero in one of them is zero in all.
    """

    drawing: "Drawing"
    values: Mapping[str, Any]

    @property
    def read(self) -> "Loops":
        """The loops with the numbers that their drawing reads alone."""
        read_values = {p: value for p, value in self.values.items() if p in self.drawing.reads or p in self.drawing.building}
        return Loops(self.drawing, read_values)

    @property
    def unbuilt(self) -> "Loops":
        """The loops without the whole ticks of dead times with which they were built."""
        building = self.drawing.building
        return Loops(self.drawing, {path: value for path, value in self.values.items() if path not in building})

    def drawn(self, out: str = "", beside: str = "") -> "MultirateLoop":
        """The blocks of the loops, perhaps without one number or two; see `assembled`."""
        from wavesweep.engine.loops.from_drawing import assembled

        return assembled(self.drawing, self.values, out, beside)

    def changed(self, changes: Mapping[str, Any]) -> "Loops":
        """The loops with other numbers."""
        return Loops(self.drawing, {**self.values, **changes})

    def some(self, part: Any) -> "Loops":
        """Some of the loops; part: an index, a slice or an array of indices."""
        return Loops(self.drawing, selected(self.values, part))

    def one(self, at: int) -> "Loops":
        """One of the loops, with plain numbers."""
        values = selected(self.values, at)
        return Loops(self.drawing, {p: value.item() if isinstance(value, np.generic) else value for p, value in values.items()})

    @property
    def items(self) -> tuple[tuple[str, Any], ...]:
        """The pairs of the numbers, by which a loop is remembered; arrays of one as tuples."""
        return items_of(self.values)


def distinct(columns: Sequence[np.ndarray], size: int) -> list[np.ndarray]:
    """Indices of the rows that agree in all columns, in order of first appearance."""
    if not size:
        return []
    varied = [alike for column in columns if not (alike := column == column[0]).all()]
    if not varied:
        return [np.arange(size)]
    if len(varied) == 1 and all(column.dtype == bool for column in columns):
        return [np.flatnonzero(varied[0]), np.flatnonzero(~varied[0])]
    label = _labels(columns, size)[1]
    order = np.argsort(label, kind="stable")
    return sorted(np.split(order, np.flatnonzero(np.diff(label[order])) + 1), key=lambda part: part[0])


def distinct_rows(columns: Mapping[str, np.ndarray], size: int) -> tuple[np.ndarray, np.ndarray]:
    """The first of each distinct row of `size` rows, in the order of their values, and the number of its distinct row for each.

    columns: arrays `(size,)` of numbers; none: all rows are the same.
    """
    return _labels(list(columns.values()), size)


def _labels(columns: Sequence[np.ndarray], size: int) -> tuple[np.ndarray, np.ndarray]:
    """`distinct_rows`, from the first row of every run of equal ones: many neighbours of a sweep have the same loop."""
    begins = np.append(True, np.zeros(size - 1, bool))
    for column in columns:
        begins[1:] |= column[1:] != column[:-1]
    starts = np.flatnonzero(begins)
    label = np.zeros(starts.size, int)
    for column in columns:
        values, place = np.unique(column[starts], return_inverse=True)
        label = np.unique(label * values.size + place, return_inverse=True)[1]
    first = np.unique(label, return_index=True)[1]
    return starts[first], np.repeat(label, np.diff(starts, append=size))


def items_of(values: Mapping[str, object]) -> tuple[tuple[str, Any], ...]:
    """The pairs of flat values, by which a loop is remembered; arrays of one as tuples."""
    return tuple((path, tuple(value.tolist()) if isinstance(value, np.ndarray) else value) for path, value in values.items())


def selected(values: Mapping[str, Any], part: Any) -> dict[str, Any]:
    """The flat values of some of the loops; part: an index, a slice or an array of indices."""
    return {path: v[part] if np.ndim(v) else v for path, v in values.items()}


def batches_built_alike(
    drawing: "Drawing", members: np.ndarray, values: Mapping[str, object]
) -> Iterator[tuple[np.ndarray, Loops]]:
    """Yield some of the members, and their loops with the whole numbers of ticks of their dead times.

    members: of the loops, `(n,)`. values: flat, numbers or arrays over these.
    """
    from wavesweep.engine.loops.dead_time import structure

    if not drawing.dead_times:
        yield members, Loops(drawing, values)
        return
    building = {path: np.broadcast_to(number, members.shape).astype(int) for path, number in structure(drawing, values).items()}
    for batch in distinct(list(building.values()), members.size):
        ticks = {path: int(number[batch[0]]) for path, number in building.items()}
        yield members[batch], Loops(drawing, selected(values, batch) | ticks)
