"""Intervals that hold whoever holds the device: for every passive hand, for every hand of a box, for every held force."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.doubt import NONE, SEARCH
from wavesweep.analysis.passivity import (
    HandBox,
    any_hand_walls,
    box_intervals,
    damping_needed,
    port_margin,
    port_passive_walls,
    swing_with_hand,
)
from wavesweep.diagram import WALL, draw
from wavesweep.sweep.tasks import END_HANDS, HELD, Work

METHODS = {
    "passive": "damping that every passive hand asks for against the device's own; each value looked at is proved",
    "box": "exact intervals of the hands found to matter, intersected; where settled, a cover of the box by pieces, each "
    "stable by a weighted Gershgorin bound, proves all but a thousandth of the interval at either end; else searched",
    "port": "port margin; each value looked at is proved, what lies between two of the same kind is not",
}


@dataclass(frozen=True, slots=True)
class Guarantee:
    """For whom an interval holds: "passive", "box" (of `box`) or "port"; see `METHODS`."""

    kind: str
    box: HandBox | None = None

    def records(self, values: Mapping[str, object], along: str, span: tuple[float, float]) -> np.ndarray:
        """Intervals of the key `along` within `span` for one loop, as records of column 0.

        values: flat keys, numbers. Certified are those for every passive hand of a direct coupling along the wall: its
        force is linear in the wall, so the walls that a damping pays for are a convex set, which its ends prove. The
        others are not: nothing proves that no smaller interval hides, or that no hand ends it a little sooner.
        """
        if self.kind == "box":
            return _for_box(values, span, self.box)
        if self.kind == "port":
            return _from_ends(port_passive_walls(values, span, along), span, lambda at: port_margin(_at(values, along, at)))
        found = any_hand_walls(values, span, path=along)
        convex = not draw(values).slow and along in WALL
        return _from_ends(found, span, lambda at: damping_needed(_at(values, along, at)), certified=convex)


def _at(values, along, ends):
    return {**values, along: ends}


def _from_ends(found, span, measure, certified=False) -> np.ndarray:
    records = _blank(found.low, found.high)
    if certified and found.low.size:
        records["certified"], records["settled"], records["doubt"] = True, True, NONE
    for end, border in zip(("low", "high"), span, strict=True):
        real = np.flatnonzero(records[end] != border) if found.low.size else []
        if len(real):
            records[f"{end}_omega"][real] = measure(records[end][real]).omega
    return records


def _for_box(values, span, box) -> np.ndarray:
    found = box_intervals(values, span, box)
    records = _blank(found.low, found.high)
    records["settled"] = found.settled
    for end, hands in (("low", found.low_hand), ("high", found.high_hand)):
        for row in np.flatnonzero(~np.isnan(hands[:, 0])):
            records[f"{end}_omega"][row] = swing_with_hand(values, hands[row], records[end][row])
            for name, number in zip(END_HANDS[end], hands[row], strict=True):
                records[name][row] = number
    return records


def _blank(low, high) -> np.ndarray:
    """Records with these ends, or the one of a column that has none."""
    records = np.zeros(max(low.size, 1), HELD)
    records["doubt"] = SEARCH
    for name in HELD.names:
        if HELD[name].kind == "f":
            records[name] = np.nan
    records["intervals"] = low.size
    if low.size:
        records["interval"], records["low"], records["high"] = np.arange(low.size), low, high
    return records


@dataclass(frozen=True, slots=True)
class Holders:
    """Whose intervals are asked for beside those of the free device.

    hand: "free" (nobody's more), "passive" (guaranteed for every passive hand) or "box" (for every hand of `box`).
    port: whether those too within which the port is passive for held forces.
    """

    hand: str = "free"
    box: HandBox | None = None
    port: bool = False

    def guarantees(self) -> dict[str, Guarantee]:
        """The guarantees asked for, by the name that their rows have in the column `hand`."""
        asked = {} if self.hand == "free" else {self.hand: Guarantee(self.hand, self.box)}
        return asked | ({"port": Guarantee("port")} if self.port else {})


@dataclass(frozen=True, slots=True, eq=False)
class HandWork(Work):
    """Intervals of a guarantee, a loop and a wall at a time; each takes from tenths of a second to some seconds."""

    guarantee: Guarantee | None = None

    def records(self) -> np.ndarray:
        """Solve it; columns are numbered as those of `solve`."""
        walls = len(self.walls[WALL[0]])
        found = {}
        for members, values in self.groups:
            for place, loop in enumerate(members.tolist()):
                for wall in range(walls):
                    records = self.guarantee.records(self._values(values, place, wall), self.along, self.span)
                    records["column"] = column = loop * walls + wall
                    found[column] = records
        return np.concatenate([found[column] for column in sorted(found)])

    def _values(self, values, place, wall):
        """Flat keys, numbers, of one loop and wall."""
        own = {path: v[place].item() if np.ndim(v) else v for path, v in values.items()}
        return own | {path: column[wall].item() for path, column in self.walls.items()}
