"""The summary of a table of stable intervals, counted while its rows are written."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.spec import find_key
from wavesweep.spec.require import BOUNDED, words_of
from wavesweep.stability.certificate import DOUBTS, FELT_ALIKE, INCOMPLETE
from wavesweep.tables.columns import felt_unit, numbers_of, swept_range
from wavesweep.tables.kind import Line, count

Axes = Mapping[str, Sequence[float]]
# hand -> the title of its line, the adjective of its intervals, and the sentence if it has none
HANDS = {
    "": ("", "stable", "no {such} anywhere in the swept range"),
    "free": ("free device", "stable", "no {such} anywhere in the swept range"),
    "operator": ("with the spec's operator", "stable", "no {such} anywhere in the swept range"),
    "passive": ("stable with every passive hand", "stable", "nowhere stable with every passive hand in the swept range"),
    "box": ("stable with every hand of the box", "stable", "nowhere stable with every hand of the box in the swept range"),
    "port": ("hand's port passive, forces held over a tick", "passive", "nowhere passive in the swept range"),
    "spec": ("the spec's own numbers", "stable", "no {such} anywhere in the swept range"),
    "for_all": (
        "proved for all numbers of [for_all]",
        "proved",
        "nothing proved for all numbers of [for_all] in the swept range",
    ),
}
STIFFNESS = ("N/m", "N*m/rad")
MOST_SHOWN = 12  # slices whose intervals are shown one by one
# Their rows are never proved as a whole: a doubt says nothing about the range outside of their intervals.
SEARCHED = ("passive", "box", "port")
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
        names = list(self.row)[: list(self.row).index("along")]
        return {name: self.row[name] for name in names if name != "spec" and not np.isnan(self.row[name])}


class IntervalTally:
    """Counts the rows of a table of intervals for one loop.

    hand: the word of its rows in the column `hand`, empty if there is none. axes: name -> values of the other axes. facts:
    those of the run, from which the end of the swept range and the units of a drawn loop's numbers follow.
    """

    def __init__(self, hand: str = "", axes: Axes | None = None, facts: Mapping[str, Any] | None = None) -> None:
        self._hand, self._axes, self._facts = hand, axes or {}, facts or {}
        require = self._facts.get("require")
        self._required = words_of(require) if require else ""
        self._rows = self._intervals = self._split = 0
        self._doubts: Counter[str] = Counter()
        self._falls = False  # whether less is felt at the high end of an interval: between its ends it may be more
        self._largest, self._without_gap, self._felt = Extreme(), Extreme(), Extreme(FELT_ALIKE)
        self._least = Extreme()  # of the values with the other sign
        self._ends_within = False  # whether an interval ends before the swept range does
        self._slices: list[tuple[dict[str, float], list[str]]] = []  # values of the axes, and intervals, of the first few

    def add(self, columns: Columns) -> None:
        if not len(columns["along"]):
            return
        stable = columns["intervals"] > 0
        self._along = str(columns["along"][0])
        self._list(columns)
        self._rows += len(stable)
        self._intervals += int(stable.sum())
        # Every slice has exactly one row numbered 0.
        self._split += int(((columns["intervals"] > 1) & (columns["interval"] == 0)).sum())
        self._doubts.update(columns["doubt"][~columns["certified"]].tolist())
        self._largest.add(columns["high"], columns)
        self._least.add(-columns["low"], columns)
        self._ends_within |= bool((columns["high"] < self._range[1]).any())
        begins = columns["low"] == self._range[0]
        self._without_gap.add(np.where(begins, columns["high"], np.nan), columns)
        low, high = columns["felt_low"], columns["felt_high"]
        stiffer = np.isnan(low) | np.isnan(high) | (high > low + FELT_ALIKE * np.abs(low))
        ends = np.where(stiffer, columns["high"], columns["low"])
        self._falls |= bool((~stiffer & (high < low - FELT_ALIKE * np.abs(low))).any())
        self._felt.add(np.where(stiffer, high, low), {**columns, "value": ends})

    def _list(self, columns: Columns) -> None:
        """Keep the intervals of up to one slice more than are shown."""
        names = [name for name in list(columns)[: list(columns).index("along")] if len(self._axes.get(name, ())) > 1]
        for row, first in enumerate((columns["interval"] == 0).tolist()):
            if first and len(self._slices) > MOST_SHOWN:
                return
            if first:
                self._slices.append(({name: columns[name][row] for name in names}, []))
            if columns["intervals"][row]:
                self._slices[-1][1].append(f"{columns['low'][row]:.6g} to {columns['high'][row]:.6g}")

    def slices(self) -> Iterator[str]:
        """Yield texts: the stable intervals of each slice, if these are few and say more than the largest value."""
        if len(self._slices) > MOST_SHOWN or self._intervals <= 1:
            return
        for values, intervals in self._slices:
            at = ", ".join(f"{name} = {value:g}{self._unit(name)}" for name, value in values.items() if not np.isnan(value))
            found = f"{' and '.join(intervals)}{self._unit(self._along)}" if intervals else "none"
            yield f"  {at}{': ' if at else ''}{self._along} {found}"

    def numbers(self) -> dict[str, Any]:
        return {
            "along": self._along,
            "unit": self._unit(self._along).strip(),
            "stable_intervals": self._intervals,
            "slices_with_a_hole": self._split,
            "rows": self._rows,
            "certified_rows": self._rows - self._doubts.total(),
            "doubts": {word: self._doubts[word] for word in DOUBTS if self._doubts[word]},
            "largest": self._largest_numbers(),
            "largest_without_gap": self._without_gap_numbers(),
            "stiffest_felt": self._felt_numbers(),
            "least": self._least_numbers(),
        }

    def _largest_numbers(self) -> dict[str, Any] | None:
        # Of rows with the same value, one without a gap below it is named.
        first = self._without_gap if self._without_gap.value == self._largest.value else self._largest
        row, ended = first.row, "stability"
        if not row:
            return None
        if self._hand in (*SEARCHED, "for_all"):
            ended = "range" if row["high"] == self._range[1] else "stability"
        elif np.isnan(row["high_omega"]):
            ended = "unknown" if row["doubt"] in INCOMPLETE else "range"
        place = self._where(first) | {"equal_rows": self._largest.ties}
        return {"value": row["high"], "from": row["low"], "ended_by": ended, **place}

    def _without_gap_numbers(self) -> dict[str, Any] | None:
        if not self._without_gap.row:
            return None
        return {"value": self._without_gap.value, **self._where(self._without_gap)}

    def _least_numbers(self) -> dict[str, Any] | None:
        """The least stable value, if it is not where the swept range begins."""
        if not self._least.row or -self._least.value <= self._range[0]:
            return None
        return {"value": -self._least.value, **self._where(self._least)}

    def _felt_numbers(self) -> dict[str, Any] | None:
        if not self._felt.row:
            return None
        return {
            "value": self._felt.value,
            "unit": felt_unit(self._facts),
            "with": self._felt.row["value"],
            "over_band": self._over_band(),
            **self._where(self._felt),
        }

    def _over_band(self) -> dict[str, Any] | None:
        """What the hand feels of that wall over frequency; None of walls for other hands than the spec's."""
        if self._hand not in ("", "spec") or not self._felt.value > 0 or "spec" not in self._facts:
            return None
        from wavesweep.spec import load
        from wavesweep.sweep.feel import band_at

        numbers = self._felt.place() | {self._along: self._felt.row["value"]}
        return band_at(load(self._facts["spec"]), numbers, self._felt.value)

    def _where(self, extreme: Extreme) -> dict[str, Any]:
        place = extreme.place()
        edges = [name for name, value in place.items() if _at_an_edge(value, self._axes.get(name, ()))]
        return {"at": place, "at_the_edge_of": edges, "equal_rows": extreme.ties, "certified": bool(extreme.row["certified"])}

    def counts(self, slices: Mapping[str, int]) -> str:
        """Text: the numbers of slices and of intervals."""
        skipped = f" ({slices['skipped']} skipped)" if slices["skipped"] else ""
        holes = f", {count(self._split, 'slice')} with a hole" if self._split else ""
        found = f"{count(self._intervals, 'interval')} with {self._required}" if self._required else ""
        return f"{count(slices['computed'], 'slice')}{skipped}: {found or count(self._intervals, 'stable interval')}{holes}"

    def _such(self) -> str:
        """Text: the axis with what its values in intervals are, stable as a rule."""
        return f"{self._along} with {self._required}" if self._required else f"{HANDS[self._hand][1]} {self._along}"

    def certified(self) -> Line:
        """Text: the number of certified rows, and the reasons of doubt about the others."""
        # Rows and not slices: an uncertified row names the interval that a user should not rely on.
        every = count(self._rows, "row")
        if not self._doubts:
            return "the only row is certified" if self._rows == 1 else f"all {every} certified", False
        reasons = ", ".join(f"{word} {self._doubts[word]}" for word in DOUBTS if self._doubts[word])
        return f"{self._doubts.total()} of {every} not certified ({reasons})", True

    def meanings(self) -> Iterator[Line]:
        """Yield the meaning of each reason of doubt that occurs."""
        yield from ((f"  {word}: {DOUBTS[word]}", True) for word in DOUBTS if self._doubts[word])

    def largest(self) -> str:
        """Text: the largest stable value and its place; empty if only the least one says something."""
        found = self._largest_numbers()
        if self._least_is_asked():
            return ""
        if found is None:
            known = f"no {self._such()} found, but part of the swept range could not be decided"
            known += f"; {BOUNDED}" if numbers_of(self._facts) and not self._required else ""
            return known if self._doubts and self._hand not in SEARCHED else HANDS[self._hand][2].format(such=self._such())
        value = f"largest {self._such()}: {found['value']:.6g}{self._unit(self._along)}"
        ended = f"{ENDS[found['ended_by']].format('it' if self._required else 'stability')}{_ended_by(self._largest.row)}"
        return f"{value}{self._gap(found['from'])}{self._place(found)}{ended}{self._doubtful(found)}"

    def least(self) -> str:
        """Text: the least stable value and its place; empty where the range begins, or if the largest one says it already."""
        found, largest = self._least_numbers(), self._largest_numbers()
        if not found or not largest or (found["value"] == largest["from"] and largest["ended_by"] == "stability"):
            return ""
        value = f"least {self._such()}: {found['value']:.6g}{self._unit(self._along)}"
        goes = "every interval goes" if self._intervals > 1 else "it goes"
        upwards = f"; {goes} on to {self._range[1]:.6g}, where the swept range ends"
        return f"{value}{self._place(found)}{self._doubtful(found)}{upwards if self._least_is_asked() else ''}"

    def _least_is_asked(self) -> bool:
        """Whether stability begins within the swept range and ends nowhere in it."""
        largest = self._largest_numbers()
        return bool(largest and largest["ended_by"] == "range" and not self._ends_within and self._least_numbers())

    def without_gap(self) -> str:
        """Text: the largest value up to which all are stable, and its place; empty if that is the largest stable one."""
        found = self._without_gap_numbers()
        good = f"with {self._required}" if self._required else HANDS[self._hand][1]
        if found is None or found["value"] == self._largest.value:
            return ""
        first = f"every {self._along} from {self._range[0]:.6g} on {good} up to"
        return f"{first} {found['value']:.6g}{self._unit(self._along)}{self._place(found)}{self._doubtful(found)}"

    def stiffest_felt(self) -> str:
        """Text: the largest static stiffness that the hand feels at an end of a stable interval, and its place; may be empty.

        Between the ends of a range of stiffnesses nothing is felt that is stiffer, unless the stiffness felt falls.
        """
        found = self._felt_numbers()
        if found is None:
            return ""
        wall = f" with {self._along} = {found['with']:.6g}{self._unit(self._along)}{self._gap(self._felt.row['low'])}"
        ends = ", at an end of an interval" if self._falls or self._unit(self._along).strip() not in STIFFNESS else ""
        felt = f"stiffest wall as the hand feels it{ends}: {found['value']:.6g} {found['unit']}{self._band(found)}"
        return f"{felt}{wall}{self._place(found)}{self._doubtful(found)}"

    @staticmethod
    def _band(found: Mapping[str, Any]) -> str:
        if not found["over_band"]:
            return ""
        from wavesweep.sweep.feel import in_words

        return in_words(found["over_band"])

    def feels_the_wall(self) -> bool:
        """Whether the stiffest wall and the stiffest felt are the same, as with direct coupling."""
        return bool(self._largest.row and np.isclose(self._felt.value, self._largest.value, rtol=1e-9))

    def _doubtful(self, found: Mapping[str, Any]) -> str:
        return "" if found["certified"] or self._hand in SEARCHED else ", not certified"

    def _gap(self, low: float) -> str:
        """Text: where an interval begins, if that is not at the start of the range, or next to it if it is what is proved."""
        if self._hand == "for_all" and low <= NEXT * self._largest.value:
            return ""
        return f" ({'so' if self._required else HANDS[self._hand][1]} from {low:.6g} on)" if low > self._range[0] else ""

    @property
    def _range(self) -> tuple[float, float]:
        return swept_range(self._facts, self._along)

    def _unit(self, name: str) -> str:
        """The unit of an axis with a space before it; empty if it has none."""
        key = numbers_of(self._facts).get(name) or find_key(name)
        return f" {key.unit}" if key is not None and key.unit not in ("", "1") else ""

    def _place(self, found: Mapping[str, Any]) -> str:
        if not found["at"]:
            return ""
        at = [
            f"{name} = {value:g}{self._unit(name)}{' (the edge of that axis)' if name in found['at_the_edge_of'] else ''}"
            for name, value in found["at"].items()
        ]
        others = found["equal_rows"] - 1
        more = f", and in {count(others, 'other row')}" if others else ""
        return f" at {', '.join(at)}{more}"


def _at_an_edge(value: float, values: Sequence[float]) -> bool:
    return len(values) > 1 and value in (min(values), max(values))


def _ended_by(row: Mapping[str, Any]) -> str:
    """Text: the hand that ends the interval, if one is known."""
    if row.get("fails_from", np.nan) == row.get("fails_from", np.nan):
        by = str(row.get("counterexample", "")).rpartition("from: ")[2]  # where both ends have one, each is named
        return f", refuted from {row['fails_from']:.6g} on by {by}" if by else ""
    hand = [row.get(f"high_hand_{part}", np.nan) for part in ("mass", "damping", "stiffness")]
    return "" if np.isnan(hand[0]) else ", ended by a hand of {:.4g} kg, {:.4g} N*s/m, {:.4g} N/m".format(*hand)


def whose_column(columns: Columns) -> str:
    """The column that says for whom a row is, if the table has one."""
    return next((name for name in ("hand", "guarantee") if name in columns), "")


class HandTally:
    """Counts the rows of a table of intervals, separately for each hand if it has several.

    axes, facts: as for `IntervalTally`.
    """

    def __init__(self, axes: Axes | None = None, facts: Mapping[str, Any] | None = None) -> None:
        self._axes, self._facts = axes, facts or {}
        self._plain = IntervalTally(axes=axes, facts=facts)
        self._tallies: dict[str, IntervalTally] = {}
        self._unsettled = 0

    def add(self, columns: Columns) -> None:
        """Count a block of rows, all of one hand."""
        whose = whose_column(columns)
        if not whose:
            self._plain.add(columns)
            return
        if not len(columns[whose]):
            return
        hand = str(columns[whose][0])
        rows = {name: column for name, column in columns.items() if name != whose}
        if hand not in self._tallies:
            self._tallies[hand] = IntervalTally(hand, self._axes, self._facts)
        self._tallies[hand].add(rows)
        if "settled" in columns and hand in ("box", "for_all"):
            self._unsettled += int((~columns["settled"]).sum())

    def numbers(self, facts: Mapping[str, Any]) -> dict[str, Any]:
        slices = {"slices": dict(facts["slices"])}
        if not self._tallies:
            return slices | self._plain.numbers()
        hands = {hand: tally.numbers() for hand, tally in self._tallies.items()}
        if "for_all" in hands:
            return slices | {"guarantees": hands, "rows_not_settled": self._unsettled}
        return slices | {"hands": hands, "rows_of_the_box_not_proved": self._unsettled}

    def lines(self, facts: Mapping[str, Any]) -> Iterator[Line]:
        if not self._tallies:
            yield self._plain.counts(facts["slices"]), False
            yield from ((text, False) for text in self._plain.slices())
            texts = self._plain.largest(), self._plain.least(), self._plain.without_gap(), self._plain.stiffest_felt()
            yield from ((text, False) for text in texts if text)
            yield self._plain.certified()
            yield from self._plain.meanings()
        for hand, tally in self._tallies.items():
            felt = "" if tally.feels_the_wall() else tally.stiffest_felt()
            # Of rows that are searched none is certified by design: those of a box are proved or not.
            known = "" if hand in SEARCHED else tally.certified()[0]
            parts = [tally.largest() or tally.least(), tally.without_gap(), felt, known]
            yield f"{HANDS[hand][0]} ({hand}): {'; '.join(part for part in parts if part)}", False
        if "box" in self._tallies and not self._unsettled:
            yield "every row of the box is proved (settled 1)", False
        if self._unsettled and "for_all" in self._tallies:
            rows = count(self._unsettled, "row")
            yield f"{rows} of for_all not settled: between what is proved and what is refuted more than 1 % is not known", True
        elif self._unsettled:
            rows = count(self._unsettled, "row")
            yield f"{rows} of the box not proved (settled 0): a hand that the search missed may be unstable", True


class SpecTally:
    """Counts the rows of a comparison, separately for each spec, which has a range and units of its own.

    facts: those of the run, with all specs.
    """

    def __init__(self, facts: Mapping[str, Any]) -> None:
        self._specs = facts.get("specs") or {facts["spec_name"]: facts["spec"]}
        self._tallies: dict[str, IntervalTally] = {}

    def add(self, columns: Columns) -> None:
        """Count a block with all rows of its specs."""
        names = list(columns)
        for spec in dict.fromkeys(columns["spec"].tolist()):
            rows = {name: column[columns["spec"] == spec] for name, column in columns.items()}
            axes = {name: np.unique(rows[name]).tolist() for name in names[1 : names.index("along")]}
            self._tallies[spec] = IntervalTally(axes=axes, facts={"spec": self._specs[spec]})
            self._tallies[spec].add(rows)

    def numbers(self, facts: Mapping[str, Any]) -> dict[str, Any]:
        return {"slices": dict(facts["slices"]), "specs": {spec: tally.numbers() for spec, tally in self._tallies.items()}}

    def lines(self, _: Mapping[str, Any]) -> Iterator[Line]:
        for spec, tally in self._tallies.items():
            certified, warning = tally.certified()
            parts = [tally.largest() or tally.least(), tally.without_gap(), tally.stiffest_felt(), certified]
            yield f"{spec}: {'; '.join(part for part in parts if part)}", warning
