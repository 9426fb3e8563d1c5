"""The summary of a table of stable intervals, counted while its rows are written."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.capabilities import where_explained
from wavesweep.engine.doubts import DOUBTS
from wavesweep.engine.search.interval_records import open_places
from wavesweep.engine.stability.certificate import FELT_ALIKE
from wavesweep.program.analyses.required_words import required_in_words, where_nothing_decides
from wavesweep.program.columns import Columns, axes_of, whose_column
from wavesweep.program.reading.keys import readable
from wavesweep.program.spec import find_key
from wavesweep.program.tables.columns import felt_unit, numbers_of, swept_range
from wavesweep.program.tables.kind import Line, Numbers, count
from wavesweep.program.tables.row_kinds import counterexample_in_words, row_kinds

Axes = Mapping[str, Sequence[float]]

STIFFNESS = ("N/m", "N*m/rad")
MOST_SHOWN = 12  # slices whose intervals are shown one by one
NEXT = 2e-3  # of the largest value, up to where what is proved begins next to 0
ENDS = {"stability": "", "range": ", where the swept range ends", "unknown": ", beyond which {} is not known"}


class Extreme:
    """The largest value seen so far, the row that has it, and the number of rows that have it.

    rounding: share of a value by which one has to be larger than another one, to be so by more than rounding.
    """

    def __init__(self, rounding: float = 0.0) -> None:
        self.value, self.ties, self._rounding = -np.inf, 0, rounding
        self.row: dict[str, Any] = {}

    def add(self, values: np.ndarray, columns: Columns) -> None:
        """Take the values of a block of rows; missing ones are passed over."""
        alike = self.value - self._rounding * abs(self.value) if self.row else self.value
        if not (values >= alike).any():
            return
        most = np.nanmax(values)
        if most > self.value + (self._rounding * abs(self.value) if self.row else 0.0):
            row = int(np.argmax(values >= most - self._rounding * abs(most)))
            self.value, self.ties = float(values[row]), 0
            self.row = {
                name: column[row].item() if hasattr(column[row], "item") else column[row] for name, column in columns.items()
            }
        self.ties += int(np.sum(np.abs(values - self.value) <= self._rounding * abs(self.value)))

    def place(self) -> dict[str, float]:
        """The axes' values in that row, without those that the loop does not read."""
        return {name: self.row[name] for name in axes_of(self.row) if not np.isnan(self.row[name])}


class IntervalTally:
    """Counts the rows of a table of intervals for one loop.

    hand: the word of its rows in the column `hand`, empty if there is none. axes: name -> values of the other axes. facts:
    those of the run, from which the end of the swept range and the units of a drawn loop's numbers follow.
    """

    def __init__(self, hand: str = "", axes: Axes | None = None, facts: Mapping[str, Any] | None = None) -> None:
        self.kind, self._hand, self._axes, self._facts = row_kinds()[hand], hand, axes or {}, facts or {}
        self._rows = self._intervals = self._split = self._open = 0
        self._doubts: Counter[str] = Counter()
        self._falls = False  # whether less is felt at the high end of an interval: between its ends it may be more
        self._largest, self._without_gap, self._felt = Extreme(), Extreme(), Extreme(FELT_ALIKE)
        self._least = Extreme()  # of the values with the other sign
        self._ends_within = False  # whether an interval ends before the swept range does
        self._slices: list[dict[str, Any]] = []  # axes' values, intervals and open places of the first few

    def add(self, columns: Columns) -> None:
        """Count a block of rows."""
        if not len(columns["along"]):
            return
        stable = columns["intervals"] > 0
        self._along = str(columns["along"][0])
        self._range = swept_range(self._facts, self._along)
        self._list(columns)
        self._rows += len(stable)
        self._intervals += int(stable.sum())
        # Every slice has exactly one row numbered 0.
        self._split += int(((columns["intervals"] > 1) & (columns["interval"] == 0)).sum())
        new, open_ = np.append(True, columns["interval"][1:] == 0), columns["open_places"] > 0
        self._open += int(np.logical_or.reduceat(open_, np.flatnonzero(new)).sum())
        self._doubts.update(columns["doubt"][~columns["certified"]].tolist())
        self._largest.add(columns["high"], columns)
        self._least.add(-columns["low"], columns)
        self._ends_within |= bool((columns["high"] < self._range[1]).any())
        begins = columns["low"] == self._range[0]
        self._without_gap.add(np.where(begins, np.fmin(columns["high"], columns["open_low"]), np.nan), columns)
        low, high = columns["felt_low"], columns["felt_high"]
        stiffer = np.isnan(low) | np.isnan(high) | (high > low + FELT_ALIKE * np.abs(low))
        ends = np.where(stiffer, columns["high"], columns["low"])
        self._falls |= bool((~stiffer & (high < low - FELT_ALIKE * np.abs(low))).any())
        self._felt.add(np.where(stiffer, high, low), {**columns, "value": ends})

    def _list(self, columns: Columns) -> None:
        """Keep the intervals of up to one slice more than are shown."""
        names = [name for name in axes_of(columns) if len(self._axes.get(name, ())) > 1]
        for row, first in enumerate((columns["interval"] == 0).tolist()):
            if first and len(self._slices) > MOST_SHOWN:
                return
            if first:
                known = {name: float(columns[name][row]) for name in names if not np.isnan(columns[name][row])}
                self._slices.append({"at": known, "intervals": [], "open": []})
            if columns["intervals"][row]:
                self._slices[-1]["intervals"].append([float(columns["low"][row]), float(columns["high"][row])])
            self._slices[-1]["open"] += filter(None, [open_places(columns, row)])

    def numbers(self) -> dict[str, Any]:
        """The summary as numbers and words that JSON can hold."""
        require, few = self._facts.get("require"), len(self._slices) <= MOST_SHOWN and (self._intervals > 1 or self._open)
        names = [self._along, *self._axes, *(self._largest.place() if self._largest.row else ())]
        return {
            "along": self._along,
            "unit": self._unit(self._along),
            "units": {name: self._unit(name) for name in dict.fromkeys(names)},
            "range": [end if np.isfinite(end) else None for end in self._range],
            "required": required_in_words(require) if require else "",
            "drawn": bool(numbers_of(self._facts)),
            "of_messages": not self._facts.get("spec", {}).get("for_all"),
            "stable_intervals": self._intervals,
            "slices_with_a_hole": self._split,
            "slices_with_open_places": self._open,
            "rows": self._rows,
            "certified_rows": self._rows - self._doubts.total(),
            "doubts": {word: self._doubts[word] for word in DOUBTS if self._doubts[word]},
            "largest": self._largest_numbers(),
            "largest_without_gap": self._extreme(self._without_gap),
            "stiffest_felt": self._felt_numbers(),
            "least": self._least_numbers(),
            "few_slices": self._slices if few else [],
        }

    def _extreme(self, extreme: Extreme, **more: Any) -> dict[str, Any] | None:
        """An extreme value and its place; None without one."""
        if not extreme.row:
            return None
        place = extreme.place()
        swept = {name: values for name in place if len(values := self._axes.get(name, ())) > 1}
        edges = [name for name, values in swept.items() if place[name] in (min(values), max(values))]
        about = {"at": place, "at_the_edge_of": edges, "equal_rows": extreme.ties, "certified": bool(extreme.row["certified"])}
        return {"value": extreme.value} | more | about

    def _largest_numbers(self) -> dict[str, Any] | None:
        # Of rows with the same value, one without a gap below it is named.
        first = self._without_gap if self._without_gap.value == self._largest.value else self._largest
        row, ended = first.row, "stability"
        if not row:
            return None
        if self.kind.searched or self.kind.proved:
            ended = "range" if row["high"] == self._range[1] else "stability"
        elif np.isnan(row["high_omega"]):
            ended = "unknown" if row["open_high"] > row["high"] else "range"
        more = {
            "from": row["low"],
            "ended_by": ended,
            "open": open_places({name: np.array([each]) for name, each in row.items()}, 0),
        }
        hand = {part: row.get(f"high_hand_{part}", np.nan) for part in ("mass", "damping", "stiffness")}
        # Where numbers refute both ends, each end is named.
        by = "" if np.isnan(row.get("fails_from", np.nan)) else str(row.get("counterexample", "")).rpartition("from: ")[2]
        if by:
            more |= {"refuted_from": row["fails_from"], "refuted_by": by}
        elif not np.isnan(hand["mass"]):
            more |= {"ended_by_hand": hand}
        return {**(self._extreme(first, **more) or {}), "equal_rows": self._largest.ties}

    def _least_numbers(self) -> dict[str, Any] | None:
        """The least stable value, if it is not where the swept range begins; `upwards` if none ends within the range."""
        found = self._extreme(self._least)
        if not found or -self._least.value <= self._range[0]:
            return None
        if self.kind.proved and -self._least.value <= NEXT * self._largest.value:
            return None  # what is proved begins there, next to 0
        largest = self._largest_numbers()
        upwards = bool(largest and largest["ended_by"] == "range" and not self._ends_within)
        row, more = self._least.row, {}
        if not np.isnan(row.get("fails_below", np.nan)):  # where numbers refute both ends, each end is named
            by = str(row["counterexample"]).partition("below: ")[2].partition("; from: ")[0] or str(row["counterexample"])
            more = {"refuted_below": row["fails_below"], "refuted_by": by}
        unknown = bool(row["open_low"] < row["low"])
        return found | {"value": -self._least.value, "upwards": upwards, "unknown_below": unknown} | more

    def _felt_numbers(self) -> dict[str, Any] | None:
        felt = self._felt
        if not felt.row:
            return None
        more = {"unit": felt_unit(self._facts), "with": felt.row["value"], "from": felt.row["low"], "falls": self._falls}
        return self._extreme(felt, **more)

    def _unit(self, name: str) -> str:
        """The unit of an axis; empty if it has none."""
        key = numbers_of(self._facts).get(name) or find_key(name)
        return key.unit if key is not None and key.unit != "1" else ""


def open_in_words(found: Numbers, unit: str = "") -> str:
    """Where nothing is known."""
    ends = dict.fromkeys(f"{found[end]:.6g}" for end in ("from", "to"))
    several = "" if found["places"] == 1 else f"at {found['places']} places "
    return f"not known {several}{'from' if len(ends) > 1 else 'at'} {' to '.join(ends)}{unit}"


class Words:
    """The sentences about the rows of one loop, from its numbers; hand: the word of its rows, empty if there is none."""

    def __init__(self, found: Numbers, hand: str = "") -> None:
        self._found, self._hand, self._kind, self._along = found, hand, row_kinds()[hand], found["along"]
        self._unit = self._unit_of(self._along)
        required = found["required"]
        self._good = f"with {required}" if required else self._kind.good
        self._such = f"{self._along} with {required}" if required else f"{self._kind.good} {self._along}"

    def counts(self, slices: Mapping[str, int]) -> str:
        """The numbers of slices and of intervals."""
        found, required = self._found, self._found["required"]
        skipped = f" ({slices['skipped']} skipped)" if slices["skipped"] else ""
        holes = f", {count(found['slices_with_a_hole'], 'slice')} with a hole" if found["slices_with_a_hole"] else ""
        open_ = found["slices_with_open_places"]
        holes += f", {count(open_, 'slice')} with open places" if open_ else ""
        intervals = count(found["stable_intervals"], "interval" if required else "stable interval")
        return f"{count(slices['computed'], 'slice')}{skipped}: {intervals}{f' with {required}' if required else ''}{holes}"

    def few_slices(self) -> Iterator[str]:
        """Yield the stable intervals of each slice, if these are few and say more than the largest value."""
        for each in self._found["few_slices"]:
            at = ", ".join(f"{name} = {value:g}{self._unit_of(name)}" for name, value in each["at"].items())
            intervals = " and ".join(f"{low:.6g} to {high:.6g}" for low, high in each["intervals"])
            open_ = [open_in_words(some, self._unit) for some in each["open"]]
            said = ", ".join([f"{intervals}{self._unit}" if intervals else "none", *open_])
            yield f"  {at}{': ' if at else ''}{self._along} {said}"

    def certified(self) -> Line:
        """The number of certified rows, and the reasons of doubt about the others."""
        # Rows and not slices: an uncertified row names the interval that a user should not rely on.
        rows, doubts = self._found["rows"], self._found["doubts"]
        if not doubts:
            return "the only row is certified" if rows == 1 else f"all {count(rows, 'row')} certified", False
        reasons = ", ".join(f"{word} {number}" for word, number in doubts.items())
        return f"{sum(doubts.values())} of {count(rows, 'row')} not certified ({reasons})", True

    def extremes(self) -> list[str]:
        """Sentences on the largest value, the least one, and the largest one without a gap."""
        upwards = bool((self._found["least"] or {}).get("upwards"))
        texts = [self._without_gap(), "" if upwards else self._largest(), self._least(upwards)]
        return [text for text in texts if text]

    def _largest(self) -> str:
        """The largest stable value and its place."""
        largest, found = self._found["largest"], self._found
        if largest is None and found["doubts"] and not self._kind.searched:
            hint = where_nothing_decides() if found["drawn"] and not found["required"] else ""
            return "; ".join(filter(None, [f"no {self._such} found, but part of the swept range could not be decided", hint]))
        if largest is None:
            return _for_what(self._kind.nowhere, found).format(such=self._such) + " in the swept range"
        ended = ENDS[largest["ended_by"]].format("it" if found["required"] else "stability")
        if "refuted_from" in largest:
            ended += f", refuted at {largest['refuted_from']:.6g} by {counterexample_in_words(largest['refuted_by'])}"
        if "ended_by_hand" in largest:
            ended += ", ended by a hand of {mass:.4g} kg, {damping:.4g} N*s/m, {stiffness:.4g} N/m".format(
                **largest["ended_by_hand"]
            )
        value = f"largest {self._such}: {largest['value']:.6g}{self._unit}"
        open_ = None if found["few_slices"] else largest["open"]
        return f"{value}{self._gap(largest['from'], open_)}{self._place(largest)}{ended}{self._doubtful(largest)}"

    def _least(self, upwards: bool) -> str:
        """The least stable value and its place; empty if the largest one says it already."""
        least, largest = self._found["least"], self._found["largest"]
        if not least or not largest or (least["value"] == largest["from"] and largest["ended_by"] == "stability"):
            return ""
        goes = "every interval goes" if self._found["stable_intervals"] > 1 else "it goes"
        further = f"; {goes} on to {self._found['range'][1]:.6g}, where the swept range ends" if upwards else ""
        value = f"least {self._such}: {least['value']:.6g}{self._unit}"
        unknown = ", below which it is not known" if least["unknown_below"] else ""
        if "refuted_below" in least:
            unknown = f", refuted at {least['refuted_below']:.6g} by {counterexample_in_words(least['refuted_by'])}"
        return f"{value}{self._place(least)}{unknown}{self._doubtful(least)}{further}"

    def _without_gap(self) -> str:
        """The largest value up to which all are stable, and its place; empty if that is the largest stable one."""
        whole, largest = self._found["largest_without_gap"], self._found["largest"]
        if whole is None or whole["value"] == largest["value"]:
            return ""
        first = f"{self._good} for every {self._along} from {self._found['range'][0]:.6g} up to"
        return f"{first} {whole['value']:.6g}{self._unit}{self._place(whole)}{self._doubtful(whole)}"

    def stiffest_felt(self) -> str:
        """The largest static stiffness that the hand feels at an end of a stable interval, and its place; may be empty.

        Between the ends of a range of stiffnesses nothing is felt that is stiffer, unless the stiffness felt falls.
        """
        felt = self._found["stiffest_felt"]
        if felt is None:
            return ""
        wall = f" with {self._along} = {felt['with']:.6g}{self._unit}{self._gap(felt['from'])}"
        ends = ", at an end of an interval" if felt["falls"] or self._found["unit"] not in STIFFNESS else ""
        stiffness = f"{felt['value']:.6g} {felt['unit']}"
        return f"stiffest wall as the hand feels it at rest{ends}: {stiffness}{wall}{self._place(felt)}{self._doubtful(felt)}"

    def one_line(self) -> str:
        """All of it but the slices, in a line."""
        felt, largest = self._found["stiffest_felt"], self._found["largest"]
        # With direct coupling the stiffest wall and the stiffest felt are the same.
        same = self._hand and felt and largest and np.isclose(felt["value"], largest["value"], rtol=1e-9)
        # Of rows that are searched none is certified by design: those of a box are proved or not.
        known = "" if self._kind.searched else self.certified()[0]
        parts = [*self.extremes(), "" if same else self.stiffest_felt(), known]
        return "; ".join(part for part in parts if part)

    def _doubtful(self, each: Numbers) -> str:
        return "" if each["certified"] or self._kind.searched else ", not certified"

    def _gap(self, low: float, open_: Numbers | None = None) -> str:
        """Where an interval begins, if that is not at the start of the range, or next to it if it is what is proved.

        open_: its open places, which are named too.
        """
        start, begins = self._found["range"][0], "met" if self._found["required"] else self._kind.good
        beside = self._kind.proved and low <= NEXT * self._found["largest"]["value"]
        said = [] if beside or low <= (-np.inf if start is None else start) else [f"{begins} from {low:.6g} on"]
        said += [open_in_words(open_, self._unit)] if open_ else []
        return f" ({', '.join(said)})" if said else ""

    def _unit_of(self, name: str) -> str:
        unit = readable(self._found["units"].get(name, ""))
        return f" {unit}" if unit else ""

    def _place(self, each: Numbers) -> str:
        if not each["at"]:
            return ""
        edge = " (the edge of that axis)"
        at = [
            f"{name} = {value:g}{self._unit_of(name)}{edge if name in each['at_the_edge_of'] else ''}"
            for name, value in each["at"].items()
        ]
        others = each["equal_rows"] - 1
        more = f", and in {count(others, 'other row')}" if others else ""
        return f" at {', '.join(at)}{more}"


class Tallies:
    """Counts the rows of a table of intervals, for each hand, each guarantee or each spec by itself if it has such a column.

    axes, facts: as for `IntervalTally`; each spec of a comparison has a range, axes and units of its own.
    """

    def __init__(self, axes: Axes | None = None, facts: Mapping[str, Any] | None = None) -> None:
        self._axes, self._facts = axes, facts or {}
        self._tallies: dict[str, IntervalTally] = {}
        self._whose, self._unsettled = "", 0

    def add(self, columns: Columns) -> None:
        """Count a block of rows; of a spec that is compared, all of its rows."""
        self._whose = whose = whose_column(columns)
        words = list(dict.fromkeys(columns[whose].tolist())) if whose else [""]
        for word in words if len(columns["along"]) else ():
            rows = {name: column for name, column in columns.items() if name != whose}
            if len(words) > 1:
                rows = {name: column[columns[whose] == word] for name, column in rows.items()}
            if whose == "spec":
                axes = {name: np.unique(rows[name]).tolist() for name in axes_of(rows)}
                specs = self._facts.get("specs") or {self._facts["spec_name"]: self._facts["spec"]}
                self._tallies[word] = IntervalTally(axes=axes, facts={"spec": specs[word]})
            elif word not in self._tallies:
                self._tallies[word] = IntervalTally(word, self._axes, self._facts)
            tally = self._tallies[word]
            tally.add(rows)
            if "settled" in rows and (tally.kind.searched or tally.kind.proved):
                self._unsettled += int((~rows["settled"]).sum())

    def numbers(self, facts: Mapping[str, Any]) -> dict[str, Any]:
        """The summary as numbers and words that JSON can hold, of each hand, guarantee or spec if there are several."""
        slices = {"slices": dict(facts["slices"])}
        found = {word: tally.numbers() for word, tally in self._tallies.items()}
        match self._whose:
            case "hand":
                return slices | {"hands": found, "rows_of_the_box_not_proved": self._unsettled}
            case "guarantee":
                return slices | {"guarantees": found, "rows_not_settled": self._unsettled}
            case "spec":
                return slices | {"specs": found}
        return slices | found[""]


def _for_what(text: str, found: Numbers) -> str:
    """What rows for all of [for_all] are called, also of a spec that has only channels."""
    return text.replace("numbers of [for_all]", "that messages may do") if found["of_messages"] else text


def interval_lines(found: Numbers) -> Iterator[Line]:
    """Yield the summary of a table of intervals as lines, each with a flag that is true for a warning."""
    if "along" in found:
        words = Words(found)
        texts = (words.counts(found["slices"]), *words.few_slices(), *words.extremes(), words.stiffest_felt())
        yield from ((text, False) for text in texts if text)
        yield words.certified()
        for number, word in enumerate(found["doubts"]):
            hint = "" if number else where_explained(word)
            yield f"  {word}: {DOUBTS[word].meaning}{f' ({hint})' if hint else ''}", True
        return
    for spec, numbers in found.get("specs", {}).items():
        yield f"{spec}: {Words(numbers).one_line()}", bool(numbers["doubts"])
    hands = found.get("guarantees") or found.get("hands", {})
    for hand, numbers in hands.items():
        yield f"{_for_what(row_kinds()[hand].title, numbers)} ({hand}): {Words(numbers, hand).one_line()}", False
    if unsettled := found.get("rows_not_settled"):
        between = "between what is proved and what is refuted more than 1 % is not known"
        proved = " and ".join(word for word in hands if row_kinds()[word].proved)
        yield f"{count(unsettled, 'row')} of {proved} not settled: {between}", True
    if unproved := found.get("rows_of_the_box_not_proved"):
        missed = "a hand that the search missed may be unstable"
        yield f"{count(unproved, 'row')} of the box not proved (settled 0): {missed}", True
    elif any(row_kinds()[word].searched for word in hands):
        yield "every row of the box is proved (settled 1)", False
