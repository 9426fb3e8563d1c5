"""The ranges and chances of the table [for_all] as a value; a spec has it, so that it loads no
numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.tables import TableValue

DELAY = "environment.delay"


@dataclass(frozen=True, slots=True)
class ForAllRanges(TableValue):
    """The table [for_all].

    axes: the range or the values of each number. varying: paths of those that may change from frame
    to frame; the others are unknown but constant. lost: how many slow results in a row may fail to
    come. At random instead: shares, weights of lengths of frames, a row if they are independent, or
    for each length a row of those of the next; delays, weights of environment.delay, a row, or one
    for each length of the frame; both empty if none are given; loss, the probability that a result
    never comes.
    """

    members: ClassVar[str] = "[for_all]"
    axes: tuple[Axis, ...]
    varying: frozenset[str] = frozenset()
    lost: int = 0
    shares: tuple[tuple[float, ...], ...] = ()
    delays: tuple[tuple[float, ...], ...] = ()
    loss: float = 0.0

    @property
    def at_random(self) -> bool:
        """Whether what varies has probabilities."""
        return bool(self.shares or self.delays or self.loss)

    @property
    def lengths(self) -> tuple[tuple[float, ...], ...]:
        """The probabilities of lengths of frames, a row, or one after each length; of a single
        length without shares."""
        return tuple(tuple(weight / sum(row) for weight in row) for row in self.shares or ((1.0,),))

    @property
    def results(self) -> tuple[tuple[float, ...], ...]:
        """The probabilities of delays, and then that a result never comes: a row, or one in
        frames of each length."""
        rows = self.delays or ((1.0,),)
        return tuple(
            (*((1 - self.loss) * weight / sum(row) for weight in row), self.loss) for row in rows
        )

    @property
    def changing(self) -> tuple[Axis, ...]:
        """The numbers that may change from frame to frame; one with a single value is constant."""
        return tuple(
            axis for axis in self.axes if axis.path in self.varying and len(axis.choices) > 1
        )

    @property
    def unknown(self) -> tuple[Axis, ...]:
        """The numbers that are constant."""
        return tuple(axis for axis in self.axes if axis not in self.changing)

    def apart(self, values: Mapping[str, object]) -> list[str]:
        """The numbers of a spec with these values that the table leaves out, each with its
        value, as texts."""
        left_out = []
        for axis in self.axes:
            value = values[axis.path]
            if axis.choices:
                inside = value in axis.choices
            else:
                inside = axis.start <= value <= axis.stop
            if not inside:
                left_out.append(f"{axis.name} = {value:g}")
        return left_out

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        table: dict[str, object] = {}
        for axis in self.axes:
            if axis.scale is None:
                range_ = {"values": list(axis.values)}
            else:
                range_ = {"start": axis.start, "stop": axis.stop}
            if axis.path in self.varying:
                range_["varying"] = True
            of_delay = axis.path == DELAY
            shares = self.delays if of_delay else self.shares
            rows = [list(row) for row in shares] if axis in self.changing else []
            if len(rows) > 1 and not of_delay:
                range_["next"] = rows
            elif rows:
                range_["shares"] = rows if rows[1:] else rows[0]
            table[axis.name] = range_
        return (
            table
            | ({"lost": self.lost} if self.lost else {})
            | ({"loss": self.loss} if self.loss else {})
        )
