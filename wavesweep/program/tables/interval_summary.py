"""The summary of a table of stable intervals, counted while its rows are written."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.program.analyses.claim_words import fact_of, vouched_for
from wavesweep.program.analyses.claims import Claim, Status, of_rows, of_spec
from wavesweep.program.columns import FELT_ALIKE, Columns, axes_of, open_places, whose_column
from wavesweep.program.row_kinds import COMPUTED
from wavesweep.program.spec import find_key
from wavesweep.program.tables.columns import at_port, numbers_of, swept_range
from wavesweep.program.tables.fields import DOUBTS
from wavesweep.program.tables.frame_lengths import DecidingLengths, varying_lengths
from wavesweep.program.tables.in_common import InCommon
from wavesweep.program.tables.refuters import Refuters

Axes = Mapping[str, Sequence[float]]

MOST_SHOWN = 12  # slices whose intervals are shown one by one
BEGINS_NEAR_ZERO = 2e-3  # of the largest value, up to where what is proved begins next to 0


class Extreme:
    """The largest value seen so far, the row that has it, and the number of rows that have it.

    rounding: share of a value by which one has to be larger than another one, to be so by more than
    rounding.
    """

    def __init__(self, rounding: float = 0.0) -> None:
        self.value = -np.inf
        self.ties = 0
        self.row: dict[str, Any] = {}
        self._rounding = rounding

    def add(self, values: np.ndarray, columns: Columns) -> None:
        """Take the values of a block of rows; missing ones are passed over."""
        room = self._rounding * abs(self.value) if self.row else 0.0
        if not (values >= self.value - room).any():
            return
        largest = np.nanmax(values)
        if largest > self.value + room:
            row = int(np.argmax(values >= largest - self._rounding * abs(largest)))
            self.value = float(values[row])
            self.ties = 0
            self.row = {name: _plain(column[row]) for name, column in columns.items()}
        ties = np.abs(values - self.value) <= self._rounding * abs(self.value)
        self.ties += int(ties.sum())

    def place(self) -> dict[str, float]:
        """The axes' values in that row, without those that the loop does not read."""
        return {name: self.row[name] for name in axes_of(self.row) if not np.isnan(self.row[name])}


def _plain(value: Any) -> Any:
    """An entry of an array as a value of Python."""
    if hasattr(value, "item"):
        return value.item()
    return value


class LoopSummary:
    """Counts the rows of a table of intervals for one loop.

    claim: what its rows say. hand: their word in the column `hand` or `guarantee`, empty if there
    is none. axes: name -> values of the other axes. facts: those of the run, from which the end of
    the swept range and the units of a drawn loop's numbers follow.
    """

    def __init__(
        self,
        claim: Claim,
        hand: str = "",
        axes: Axes | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        self.claim = claim
        self._hand = hand
        self._axes = axes or {}
        self._facts = facts or {}
        self._proved = claim.status is Status.PROVED
        self._rows = 0
        self._intervals = 0
        self._split = 0  # slices with several intervals
        self._open = 0  # slices with open places
        self._doubts: Counter[str] = Counter()
        self._ruled_out = (
            ""  # what rules out every value of a slice that is known to have no interval
        )
        # whether less is felt at the high end of an interval: between its ends it may be more
        self._falls = False
        self._largest = Extreme()
        self._without_gap = Extreme()
        self._felt = Extreme(FELT_ALIKE)
        self._least = Extreme()  # of the values with the other sign
        self._ends_within = False  # whether an interval ends before the swept range does
        self._lengths = DecidingLengths(
            varying_lengths(self._facts.get("spec", {})) if self._proved else ()
        )
        self._slices: list[
            dict[str, Any]
        ] = []  # axes' values, intervals and open places of the first few
        self._in_common = InCommon()

    def add(self, columns: Columns) -> None:
        """Count a block of rows."""
        if not len(columns["along"]):
            return
        stable = columns["intervals"] > 0
        self._along = str(columns["along"][0])
        self._range = swept_range(self._facts, self._along)
        self._list(columns)
        self._in_common.add(columns)
        self._lengths.add(columns, self._range)
        self._rows += len(stable)
        self._intervals += int(stable.sum())
        # Every slice has exactly one row numbered 0.
        first = columns["interval"] == 0
        self._split += int(((columns["intervals"] > 1) & first).sum())
        first[0] = True  # also of a block that begins within a slice
        is_open = np.logical_or.reduceat(columns["open_places"] > 0, np.flatnonzero(first))
        self._open += int(is_open.sum())
        self._doubts.update(columns["doubt"][~columns["certified"]].tolist())
        none = ~stable & columns["certified"]
        if none.any() and "counterexample" in columns:
            self._ruled_out = self._ruled_out or str(columns["counterexample"][none][0])
        self._largest.add(columns["high"], columns)
        self._least.add(-columns["low"], columns)
        self._ends_within |= bool((columns["high"] < self._range[1]).any())
        begins = columns["low"] == self._range[0]
        without_gap = np.fmin(columns["high"], columns["open_low"])
        self._without_gap.add(np.where(begins, without_gap, np.nan), columns)
        self._add_felt(columns)

    def _add_felt(self, columns: Columns) -> None:
        """Take the stiffness that is felt at the ends: at the high one, unless it is lower there."""
        low = columns["felt_low"]
        high = columns["felt_high"]
        rounding = FELT_ALIKE * np.abs(low)
        at_high = np.isnan(low) | np.isnan(high) | (high > low + rounding)
        falls = ~at_high & (high < low - rounding)
        self._falls |= bool(falls.any())
        ends = np.where(at_high, columns["high"], columns["low"])
        self._felt.add(np.where(at_high, high, low), {**columns, "value": ends})

    def _list(self, columns: Columns) -> None:
        """Keep the intervals of up to one slice more than are shown."""
        names = [name for name in axes_of(columns) if len(self._axes.get(name, ())) > 1]
        for row, first in enumerate((columns["interval"] == 0).tolist()):
            if first and len(self._slices) > MOST_SHOWN:
                return
            if first:
                values = {name: float(columns[name][row]) for name in names}
                place = {name: value for name, value in values.items() if not np.isnan(value)}
                self._slices.append({"at": place, "intervals": [], "open": []})
            if columns["intervals"][row]:
                interval = [float(columns["low"][row]), float(columns["high"][row])]
                self._slices[-1]["intervals"].append(interval)
            places = open_places(columns, row)
            if places:
                self._slices[-1]["open"].append(places)

    def numbers(self) -> dict[str, Any]:
        """The summary as numbers and words that JSON can hold."""
        places = self._largest.place() if self._largest.row else ()
        names = [self._along, *self._axes, *places]
        few = len(self._slices) <= MOST_SHOWN and (self._intervals > 1 or self._open)
        drawn = bool(numbers_of(self._facts))
        numbers = {
            "along": self._along,
            "claim": fact_of(self.claim),
            "unit": self._unit(self._along),
            "units": {name: self._unit(name) for name in dict.fromkeys(names)},
            "range": [end if np.isfinite(end) else None for end in self._range],
            "required": self.claim.what.required,
            "drawn": drawn,
            "stable_intervals": self._intervals,
            "slices_with_a_hole": self._split,
            "slices_with_open_places": self._open,
            "rows": self._rows,
            "vouched": vouched_for(self.claim),
            "certified_rows": self._rows - self._doubts.total(),
            "doubts": {word: self._doubts[word] for word in DOUBTS if self._doubts[word]},
            "largest": self._largest_numbers(),
            "largest_without_gap": self._extreme(self._without_gap),
            "stiffest_felt": self._felt_numbers(),
            "least": self._least_numbers(),
            "few_slices": self._slices if few else [],
            "in_common": self._in_common.numbers(self._range) if self._intervals else None,
        }
        if self._ruled_out:
            numbers["ruled_out"] = self._ruled_out
        if lengths := self._lengths.numbers():
            numbers["lengths"] = lengths
        if self._hand in ("", *COMPUTED):  # and not of hands, or of all that may happen
            if self._facts.get("conserves"):
                numbers["conserves"] = True
            for name in ("without_wall", "in_the_way"):
                if self._facts.get(name):
                    numbers[name] = dict(self._facts[name])
        return numbers

    def _extreme(self, extreme: Extreme, **facts: Any) -> dict[str, Any] | None:
        """An extreme value and its place; None without one."""
        if not extreme.row:
            return None
        place = extreme.place()
        edges = []
        for name, value in place.items():
            values = self._axes.get(name, ())
            if len(values) > 1 and value in (min(values), max(values)):
                edges.append(name)
        return {
            "value": extreme.value,
            **facts,
            "at": place,
            "at_the_edge_of": edges,
            "equal_rows": extreme.ties,
            "certified": bool(extreme.row["certified"]),
        }

    def _largest_numbers(self) -> dict[str, Any] | None:
        # Of rows with the same value, one without a gap below it is named.
        if self._without_gap.value == self._largest.value:
            first = self._without_gap
        else:
            first = self._largest
        if not first.row:
            return None
        row = first.row
        columns = {name: np.array([value]) for name, value in row.items()}
        facts = {
            "from": row["low"],
            "ended_by": self._ended_by(row),
            "open": open_places(columns, 0),
        }
        if "high_set_by" in row:
            facts["set_by"] = row["high_set_by"]
        hand = {
            number: row.get(f"high_hand_{number}", np.nan)
            for number in ("mass", "damping", "stiffness")
        }
        refuter = _refuters(row).high
        if refuter:
            facts |= {"refuted_from": row["fails_from"], "refuted_by": refuter}
        elif not np.isnan(hand["mass"]):
            facts["ended_by_hand"] = hand
        numbers = self._extreme(first, **facts) or {}
        return {**numbers, "equal_rows": self._largest.ties}

    def _ended_by(self, row: Mapping[str, Any]) -> str:
        """What ends the interval of a row: stability, the swept range, or nothing that is known."""
        if self._proved:
            if row["high"] == self._range[1]:
                return "range"
            return "stability"
        if np.isnan(row["high_omega"]):
            if row["open_high"] > row["high"]:
                return "unknown"
            return "range"
        return "stability"

    def _least_numbers(self) -> dict[str, Any] | None:
        """The least stable value, if it is not where the swept range begins; `upwards` if none ends within the range."""
        least = self._extreme(self._least)
        value = -self._least.value
        if not least or value <= self._range[0]:
            return None
        if self._proved and value <= BEGINS_NEAR_ZERO * self._largest.value:
            return None  # what is proved begins there, next to 0
        row = self._least.row
        largest = self._largest_numbers()
        least["value"] = value
        least["upwards"] = bool(
            largest and largest["ended_by"] == "range" and not self._ends_within
        )
        least["unknown_below"] = bool(row["open_low"] < row["low"])
        if "low_set_by" in row:
            least["set_by"] = row["low_set_by"]
        refuter = _refuters(row).low
        if refuter:
            least |= {"refuted_below": row["fails_below"], "refuted_by": refuter}
        return least

    def _felt_numbers(self) -> dict[str, Any] | None:
        felt = self._felt
        if not felt.row:
            return None
        facts = {
            "unit": at_port("N/m", self._facts),
            "with": felt.row["value"],
            "from": felt.row["low"],
            "falls": self._falls,
        }
        return self._extreme(felt, **facts)

    def _unit(self, name: str) -> str:
        """The unit of an axis; empty if it has none."""
        key = numbers_of(self._facts).get(name) or find_key(name)
        if key is not None and key.unit != "1":
            return key.unit
        return ""


def _refuters(row: Mapping[str, Any]) -> Refuters:
    """What refutes the values beyond both ends of the interval of a row."""
    said = Refuters.read(str(row.get("counterexample", "")))
    low = "" if np.isnan(row.get("fails_below", np.nan)) else said.low
    high = "" if np.isnan(row.get("fails_from", np.nan)) else said.high
    return Refuters(low, high)


class IntervalSummary:
    """Counts the rows of a table of intervals, for each hand, each guarantee or each spec by itself if it has such a column.

    axes, facts: as for `LoopSummary`; each spec of a comparison has a range, axes and units of its
    own.
    """

    def __init__(self, axes: Axes | None = None, facts: Mapping[str, Any] | None = None) -> None:
        self._axes = axes
        self._facts = facts or {}
        self._summaries: dict[str, Any] = {}  # of loops; of specs as this
        self._whose = ""
        self._unsettled: Counter[str] = Counter()

    def add(self, columns: Columns) -> None:
        """Count a block of rows; of a spec that is compared, all of its rows."""
        self._whose = whose = whose_column(columns)
        if not len(columns["along"]):
            return
        words = list(dict.fromkeys(columns[whose].tolist())) if whose else [""]
        for word in words:
            rows = {name: column for name, column in columns.items() if name != whose}
            if len(words) > 1:
                rows = {name: column[columns[whose] == word] for name, column in rows.items()}
            if whose == "spec":
                axes = {axis: np.unique(rows[axis]).tolist() for axis in axes_of(rows)}
                if set(rows.get("guarantee", ())) <= {"spec"}:  # which only other specs have
                    rows.pop("guarantee", None)
                self._summaries[word] = IntervalSummary(axes, of_spec(self._facts, word))
                self._summaries[word].add(rows)
                continue
            claim = of_rows(self._facts, word)
            if word not in self._summaries:
                self._summaries[word] = LoopSummary(claim, word, self._axes, self._facts)
            self._summaries[word].add(rows)
            if "settled" in rows and claim.status is Status.PROVED:
                self._unsettled[word] += int((~rows["settled"]).sum())

    def numbers(self, facts: Mapping[str, Any]) -> dict[str, Any]:
        """The summary as numbers and words that JSON can hold, of each hand, guarantee or spec if there are several."""
        if self._whose == "spec":
            specs = {word: each.numbers({}) for word, each in self._summaries.items()}
            return {"slices": dict(facts["slices"]), "specs": specs}
        slices = {"slices": dict(facts["slices"])} if facts else {}
        numbers: dict[str, dict[str, Any]] = {
            word: summary.numbers() for word, summary in self._summaries.items()
        }
        for word, rows in self._unsettled.items():
            numbers[word]["rows_not_settled"] = rows
        unsettled = self._unsettled.total()
        match self._whose:
            case "hand":
                return slices | {"hands": numbers, "rows_of_the_box_not_proved": unsettled}
            case "guarantee":
                return slices | {"guarantees": numbers, "rows_not_settled": unsettled}
        return slices | numbers[""]
