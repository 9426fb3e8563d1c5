"""The summary of a table of stable intervals in sentences."""

from collections.abc import Iterator, Mapping

import numpy as np

from wavesweep.capabilities import where_explained
from wavesweep.program.analyses.mode_in_the_way import mode_in_words
from wavesweep.program.analyses.required_words import where_nothing_decides
from wavesweep.program.doubts import DOUBTS
from wavesweep.program.reading.keys import readable
from wavesweep.program.row_kinds import row_kinds
from wavesweep.program.tables.frame_lengths import lengths_in_words
from wavesweep.program.tables.interval_summary import NEXT
from wavesweep.program.tables.kind import Line, Numbers, count
from wavesweep.program.tables.number_words import rounded_down, rounded_up, span_in_words
from wavesweep.program.tables.refuters import in_a_sentence

STIFFNESS = ("N/m", "N*m/rad")
ENDS = {"stability": "", "range": ", where the swept range ends", "unknown": ", beyond which {} is not known"}
HAND = ", ended by a hand of {mass:.4g} kg, {damping:.4g} N*s/m, {stiffness:.4g} N/m"


def open_in_words(places: Numbers, unit: str = "") -> str:
    """Where nothing is known."""
    ends = dict.fromkeys(f"{places[end]:.6g}" for end in ("from", "to"))
    several = "" if places["places"] == 1 else f"at {places['places']} places "
    return f"not known {several}{'from' if len(ends) > 1 else 'at'} {' to '.join(ends)}{unit}"


class Sentences:
    """The sentences about the rows of one loop, from its numbers; hand: the word of its rows, empty if there is none."""

    def __init__(self, numbers: Numbers, hand: str = "") -> None:
        self._numbers, self._hand, self._along = numbers, hand, numbers["along"]
        self._kind = row_kinds()[hand].worded_for(numbers)
        self._unit = self._unit_of(self._along)
        required = numbers["required"]
        self._good = f"with {required}" if required else self._kind.good
        self._such = f"{self._along} with {required}" if required else f"{self._kind.good} {self._along}"

    def counts(self, slices: Mapping[str, int]) -> str:
        """The numbers of slices and of intervals."""
        numbers, required = self._numbers, self._numbers["required"]
        gaps = [("slices_with_a_hole", "a hole"), ("slices_with_open_places", "open places")]
        holes = [f", {count(numbers[name], 'slice')} with {name_of_gap}" for name, name_of_gap in gaps if numbers[name]]
        skipped = f" ({slices['skipped']} skipped)" if slices["skipped"] else ""
        intervals = count(numbers["stable_intervals"], "interval" if required else "stable interval")
        such = f" with {required}" if required else ""
        return f"{count(slices['computed'], 'slice')}{skipped}: {intervals}{such}{''.join(holes)}"

    def few_slices(self) -> Iterator[str]:
        """Yield the stable intervals of each slice, if these are few and say more than the largest value."""
        for piece in self._numbers["few_slices"]:
            at = ", ".join(f"{name} = {value:g}{self._unit_of(name)}" for name, value in piece["at"].items())
            intervals = " and ".join(span_in_words(*interval) for interval in piece["intervals"])
            open_ = [open_in_words(places, self._unit) for places in piece["open"]]
            said = ", ".join([f"{intervals}{self._unit}" if intervals else "none", *open_])
            yield f"  {at}{': ' if at else ''}{self._along} {said}"

    def certified(self) -> Line:
        """The number of certified or checked rows, and the reasons of doubt about the others."""
        # Rows and not slices: an uncertified row names the interval that a user should not rely on.
        rows, doubts, vouched = (self._numbers[name] for name in ("rows", "doubts", "vouched"))
        if not doubts:
            return f"the only row is {vouched}" if rows == 1 else f"all {count(rows, 'row')} {vouched}", False
        reasons = ", ".join(f"{word} {number}" for word, number in doubts.items())
        return f"{sum(doubts.values())} of {count(rows, 'row')} not {vouched} ({reasons})", True

    def extremes(self) -> list[str]:
        """Sentences on the largest value, the least one, and the largest one without a gap."""
        upwards = bool((self._numbers["least"] or {}).get("upwards"))
        texts = [self._without_gap(), "" if upwards else self._largest(), self._least(upwards)]
        return [text for text in texts if text]

    def _largest(self) -> str:
        """The largest stable value and its place."""
        largest, numbers = self._numbers["largest"], self._numbers
        if largest is None:
            return self._nowhere()
        ended = ENDS[largest["ended_by"]].format("it" if numbers["required"] else "stability")
        if "refuted_from" in largest:
            ended += f", refuted at {rounded_up(largest['refuted_from'])} by {in_a_sentence(largest['refuted_by'])}"
        if "ended_by_hand" in largest:
            ended += HAND.format(**largest["ended_by_hand"])
        number = rounded_down(largest["value"]) if self._kind.proved else f"{largest['value']:.6g}"
        value = f"largest {self._such}: {number}{self._unit}"
        open_ = None if numbers["few_slices"] else largest["open"]
        return f"{value}{self._gap(largest['from'], open_)}{self._place(largest)}{ended}{self._doubtful(largest)}"

    def _nowhere(self) -> str:
        """That there is no interval, or none that could be found."""
        if not self._numbers["doubts"] or self._kind.searched:
            reason = self._in_the_way()
            return f"{self._kind.nowhere.format(such=self._such)} in the swept range{reason and f': {reason}'}"
        decides = where_nothing_decides() if self._numbers.get("conserves") and not self._numbers["required"] else ""
        undecided = f"no {self._such} found, but part of the swept range could not be decided"
        return f"{undecided}; {decides}" if decides else undecided

    def of_one_without(self) -> str:
        """What keeps a slice from what is required, if others have it; empty otherwise."""
        reason = self._in_the_way()
        return f"none {reason}" if reason and self._numbers["largest"] else ""

    def _in_the_way(self) -> str:
        """The slice and the mode that keeps it from being stable or from what is required; empty if none is known."""
        mode = self._numbers.get("in_the_way")
        if not mode:
            return ""
        at = ", ".join(f"{name} = {value:g}{self._unit_of(name)}" for name, value in mode["at"].items())
        return f"{at and f'at {at}: '}{mode_in_words(mode, self._along, self._unit)}"

    def _least(self, upwards: bool) -> str:
        """The least stable value and its place; empty if the largest one says it already."""
        least, largest = self._numbers["least"], self._numbers["largest"]
        if not least or not largest or (least["value"] == largest["from"] and largest["ended_by"] == "stability"):
            return ""
        goes = "every interval goes" if self._numbers["stable_intervals"] > 1 else "it goes"
        further = f"; {goes} on to {self._numbers['range'][1]:.6g}, where the swept range ends" if upwards else ""
        number = rounded_up(least["value"]) if self._kind.proved else f"{least['value']:.6g}"
        value = f"least {self._such}: {number}{self._unit}"
        unknown = ", below which it is not known" if least["unknown_below"] else ""
        if "refuted_below" in least:
            unknown = f", refuted at {rounded_down(least['refuted_below'])} by {in_a_sentence(least['refuted_by'])}"
        return f"{value}{self._place(least)}{unknown}{self._doubtful(least)}{further}"

    def _without_gap(self) -> str:
        """The largest value up to which all are stable, and its place; empty if that is the largest stable one."""
        without, largest = self._numbers["largest_without_gap"], self._numbers["largest"]
        if without is None or without["value"] == largest["value"]:
            return ""
        first = f"{self._good} for every {self._along} from {self._numbers['range'][0]:.6g} up to"
        number = rounded_down(without["value"]) if self._kind.proved else f"{without['value']:.6g}"
        return f"{first} {number}{self._unit}{self._place(without)}{self._doubtful(without)}"

    def stiffest_felt(self) -> str:
        """The largest static stiffness that the hand feels at an end of a stable interval, and its place; may be empty.

        Between the ends of a range of stiffnesses nothing is felt that is stiffer, unless the stiffness felt falls.
        """
        felt = self._numbers["stiffest_felt"]
        if felt is None:
            return ""
        wall = f" with {self._along} = {felt['with']:.6g}{self._unit}{self._gap(felt['from'])}"
        ends = ", at an end of an interval" if felt["falls"] or self._numbers["unit"] not in STIFFNESS else ""
        stiffness = f"{felt['value']:.6g} {felt['unit']}"
        return f"stiffest wall as the hand feels it at rest{ends}: {stiffness}{wall}{self._place(felt)}{self._doubtful(felt)}"

    def one_line(self) -> str:
        """All of it but the slices, in a line; of rows for more than one loop with their title and their word."""
        felt, largest = self._numbers["stiffest_felt"], self._numbers["largest"]
        # With direct coupling the stiffest wall and the stiffest felt are the same.
        same = self._hand and felt and largest and np.isclose(felt["value"], largest["value"], rtol=1e-9)
        # Of rows that are searched none is certified by design: those of a box are proved or not.
        certified = "" if self._kind.searched else self.certified()[0]
        lengths = lengths_in_words(self._numbers["lengths"]) if "lengths" in self._numbers else ""
        line = "; ".join(filter(None, [*self.extremes(), lengths, "" if same else self.stiffest_felt(), certified]))
        return f"{self._kind.title} ({self._hand}): {line}" if self._hand else line

    def _doubtful(self, extreme: Numbers) -> str:
        return "" if extreme["certified"] or self._kind.searched else f", not {self._numbers['vouched']}"

    def _gap(self, low: float, open_: Numbers | None = None) -> str:
        """Where an interval begins, if that is not at the start of the range, or next to it if it is what is proved.

        open_: its open places, which are named too.
        """
        start, begins = self._numbers["range"][0], "met" if self._numbers["required"] else self._kind.good
        next_to_start = self._kind.proved and low <= NEXT * self._numbers["largest"]["value"]
        said = [] if next_to_start or low <= (-np.inf if start is None else start) else [f"{begins} from {low:.6g} on"]
        said += [open_in_words(open_, self._unit)] if open_ else []
        return f" ({', '.join(said)})" if said else ""

    def _unit_of(self, name: str) -> str:
        unit = readable(self._numbers["units"].get(name, ""))
        return f" {unit}" if unit else ""

    def _place(self, extreme: Numbers) -> str:
        if not extreme["at"]:
            return ""
        edges = dict.fromkeys(extreme["at_the_edge_of"], " (the edge of that axis)")
        at = [f"{name} = {value:g}{self._unit_of(name)}{edges.get(name, '')}" for name, value in extreme["at"].items()]
        equal = extreme["equal_rows"] - 1
        equals = f", and in {count(equal, 'other row')}" if equal else ""
        return f" at {', '.join(at)}{equals}"


def interval_lines(numbers: Numbers) -> Iterator[Line]:
    """Yield the summary of a table of intervals as lines, each with a flag that is true for a warning."""
    if "along" in numbers:
        yield from _lines_of_loop(numbers)
        return
    for spec, of_spec in numbers.get("specs", {}).items():
        yield f"{spec}: {Sentences(of_spec).one_line()}", bool(of_spec["doubts"])
    of_kinds = numbers.get("guarantees") or numbers.get("hands", {})
    for word, of_kind in of_kinds.items():
        in_doubt = bool(of_kind["doubts"]) and not row_kinds()[word].searched
        yield Sentences(of_kind, word).one_line(), in_doubt
    if words := [word for word in of_kinds if row_kinds()[word].unsettled]:
        kind, unsettled = row_kinds()[words[0]], numbers.get("rows_not_settled") or numbers.get("rows_of_the_box_not_proved")
        if unsettled:
            yield kind.unsettled.format(rows=count(unsettled, "row"), words=" and ".join(words)), True
        elif kind.settled:
            yield kind.settled, False


def _lines_of_loop(numbers: Numbers) -> Iterator[Line]:
    """Yield the lines of a table whose rows are all of the spec's own loop."""
    sentences = Sentences(numbers)
    texts = [sentences.counts(numbers["slices"]), *sentences.few_slices(), *sentences.extremes()]
    texts += [sentences.of_one_without(), sentences.stiffest_felt()]
    yield from ((text, False) for text in texts if text)
    yield sentences.certified()
    for number, word in enumerate(numbers["doubts"]):
        hint = "" if number else where_explained(word)
        yield f"  {word}: {DOUBTS[word].meaning}{f' ({hint})' if hint else ''}", True
