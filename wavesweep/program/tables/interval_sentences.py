"""The summary of a table of stable intervals in sentences."""

from collections.abc import Iterator, Mapping

import numpy as np

from wavesweep.program.analyses.claim_words import (
    claimed,
    doubted_as,
    everywhere,
    no_value,
    unless,
    value_of_rows,
    value_with,
    vouched_for,
)
from wavesweep.program.analyses.claims import Claim, Status
from wavesweep.program.analyses.free_space import without_wall_in_words
from wavesweep.program.analyses.mode_in_the_way import mode_in_words
from wavesweep.program.analyses.required_words import where_nothing_decides
from wavesweep.program.number_words import (
    WIDEST,
    folded,
    in_all_digits,
    rounded_down,
    rounded_up,
    span_around,
    span_in_words,
)
from wavesweep.program.reading.keys import readable
from wavesweep.program.row_kinds import row_kinds
from wavesweep.program.tables.fields import DOUBTS
from wavesweep.program.tables.frame_lengths import lengths_in_words
from wavesweep.program.tables.interval_summary import BEGINS_NEAR_ZERO
from wavesweep.program.tables.kind import Line, Numbers, count
from wavesweep.program.tables.refuters import in_a_sentence

STIFFNESS = ("N/m", "N*m/rad")
ENDS = {
    "stability": "",
    "range": ", where the swept range ends",
    "unknown": ", beyond which {} is not known",
}
HAND = ", ended by a hand of {mass} kg, {damping} N*s/m, {stiffness} N/m"


def open_in_words(places: Numbers, unit: str = "") -> str:
    """Where nothing is known."""
    several = "" if places["places"] == 1 else f"at {places['places']} places "
    low = f"{places['from']:.6g}"
    if low == f"{places['to']:.6g}":  # so narrow that it is a place
        where = f"at {low}"
    else:
        where = f"from {span_around(places['from'], places['to'])}"
    return f"not known {several}{where}{unit}"


class Sentences:
    """The sentences about the rows of one loop, from its numbers; hand: the word of its rows, empty if there is none."""

    def __init__(self, numbers: Numbers, hand: str = "") -> None:
        self._numbers = numbers
        self._hand = hand
        self._along = numbers["along"]
        self._claim = Claim.read(numbers["claim"])
        self._unit = self._unit_of(self._along)

    def counts(self, slices: Mapping[str, int]) -> str:
        """The numbers of slices and of intervals."""
        numbers = self._numbers
        said = count(slices["computed"], "slice")
        if slices["skipped"]:
            said += f" ({slices['skipped']} skipped)"
        number = numbers["stable_intervals"]
        intervals = "interval" if number == 1 else "intervals"
        said += f": {number} {value_with(self._claim.what, intervals)}"
        for name, gap in (
            ("slices_with_a_hole", "a hole"),
            ("slices_with_open_places", "open places"),
        ):
            if numbers[name]:
                said += f", {count(numbers[name], 'slice')} with {gap}"
        return said

    def few_slices(self) -> Iterator[str]:
        """Yield the stable intervals of each slice, if these are few and say more than the largest value."""
        for piece in self._numbers["few_slices"]:
            place = self._numbers_in_words(piece["at"])
            intervals = " and ".join(span_in_words(*interval) for interval in piece["intervals"])
            parts = [f"{intervals}{self._unit}" if intervals else "none"]
            parts += [open_in_words(places, self._unit) for places in piece["open"]]
            yield f"  {place}{': ' if place else ''}{self._along} {', '.join(parts)}"

    def certified(self) -> Line:
        """How many rows are known as the claim says, and the reasons of doubt about the others."""
        # Rows and not slices: an uncertified row names the interval that a user should not rely on.
        rows = self._numbers["rows"]
        doubts = self._numbers["doubts"]
        vouched = vouched_for(self._claim)
        if not doubts:
            said = "the only row is" if rows == 1 else f"all {count(rows, 'row')}"
            return f"{said} {vouched}", False
        reasons = ", ".join(f"{word} {number}" for word, number in doubts.items())
        doubted = sum(doubts.values())
        said = f"{doubted} of {count(rows, 'row')} {doubted_as(self._claim)} ({reasons})"
        if doubted < rows and vouched != "certified":
            said += f", the others {vouched}"
        return said, True

    def reasons(self) -> Iterator[Line]:
        """Yield what each word of doubt means, and what helps."""
        for word in self._numbers["doubts"]:
            yield _folded(f"  {word}: {DOUBTS[word].meaning}"), True
            yield _folded(f"    {DOUBTS[word].advice}"), True

    def extremes(self) -> list[str]:
        """Sentences on the largest value, the least one, and the largest one without a gap."""
        least = self._numbers["least"]
        upwards = bool(least and least["upwards"])
        texts = [self._without_gap()]
        if not upwards:
            texts.append(self._largest())
        texts.append(self._least(upwards))
        texts.append(self._in_common())
        texts.append(self._without_wall())
        return [_folded(text) for text in texts if text]

    def _largest(self) -> str:
        """The largest stable value and its place."""
        largest = self._numbers["largest"]
        if largest is None:
            return self._none()
        ended = ENDS[largest["ended_by"]].format("it" if self._numbers["required"] else "stability")
        ended += _set_by(largest)
        if "refuted_from" in largest:
            ended += f", refuted at {rounded_up(largest['refuted_from'])} by {in_a_sentence(largest['refuted_by'])}"
        if "ended_by_hand" in largest:
            numbers = {name: in_all_digits(x) for name, x in largest["ended_by_hand"].items()}
            ended += HAND.format(**numbers)
        claim = self._claim.of_row(certified=largest["certified"])
        # An end that is exact may itself be refuted.
        below = "just below " * (largest.get("refuted_from", np.inf) <= largest["value"])
        value = f"largest {value_of_rows(claim, self._along)}: {below}{rounded_down(largest['value'])}{self._unit}"
        open_places = None if self._numbers["few_slices"] else largest["open"]
        gap = self._gap(claim, largest["from"], open_places)
        return f"{value}{gap}{self._place(largest)}{ended}{unless(claim, certain=largest['certified'])}"

    def _none(self) -> str:
        """That there is no interval, or none that could be found."""
        undecided = bool(self._numbers["doubts"])
        reason = self._numbers.get("ruled_out") or self._in_the_way()
        if undecided:
            of_loop = self._numbers.get("conserves") and not self._numbers["required"]
            reason = where_nothing_decides() if of_loop else ""
        return no_value(self._claim, self._along, reason, undecided=undecided)

    def of_one_without(self) -> str:
        """What keeps a slice from what is required, if others have it; empty otherwise."""
        reason = self._in_the_way()
        if reason and self._numbers["largest"]:
            return f"none {reason}"
        return ""

    def _in_the_way(self) -> str:
        """The slice and the mode that keeps it from being stable or from what is required; empty if none is known."""
        mode = self._numbers.get("in_the_way")
        if not mode:
            return ""
        place = self._numbers_in_words(mode["at"])
        said = mode_in_words(mode, self._along, self._unit)
        return f"at {place}: {said}" if place else said

    def _without_wall(self) -> str:
        """A loop that is unstable where its wall is not touched, though with it it is stable."""
        unstable = self._numbers.get("without_wall")
        if not (unstable and self._numbers["largest"]):
            return ""
        place = self._numbers_in_words(unstable["at"])
        return f"{place}{': ' if place else ''}{without_wall_in_words(unstable['radius'])}"

    def _least(self, upwards: bool) -> str:
        """The least stable value and its place; empty if the largest one says it already."""
        least = self._numbers["least"]
        largest = self._numbers["largest"]
        if not least or not largest:
            return ""
        if least["value"] == largest["from"] and largest["ended_by"] == "stability":
            return ""
        claim = self._claim.of_row(certified=least["certified"])
        said = f"smallest {value_of_rows(claim, self._along)}: {rounded_up(least['value'])}{self._unit}{self._place(least)}"
        if "refuted_below" in least:
            said += f", refuted at {rounded_down(least['refuted_below'])} by {in_a_sentence(least['refuted_by'])}"
        elif least["unknown_below"]:
            said += ", below which it is not known"
        said += f"{_set_by(least)}{unless(claim, certain=least['certified'])}"
        if upwards:
            if self._numbers["stable_intervals"] > 1:
                goes = "every interval goes"
            else:
                goes = "it goes"
            said += f"; {goes} on to {rounded_down(self._numbers['range'][1])}, where the swept range ends"
        return said

    def _without_gap(self) -> str:
        """The largest value up to which all are stable, and its place; empty if that is the largest stable one."""
        without = self._numbers["largest_without_gap"]
        if without is None or without["value"] == self._numbers["largest"]["value"]:
            return ""
        claim = self._claim.of_row(certified=without["certified"])
        first = f"{everywhere(claim)} for every {self._along} from {rounded_up(self._numbers['range'][0])} up to"
        number = rounded_down(without["value"])
        return f"{first} {number}{self._unit}{self._place(without)}{unless(claim, certain=without['certified'])}"

    def _in_common(self) -> str:
        """The values that all slices have in common, or what rules them out; empty for one slice."""
        common = self._numbers["in_common"]
        if common is None:
            return ""
        known = not self._numbers["doubts"]
        spans = []
        for interval in common["intervals"]:
            low = f"{rounded_up(interval['low'])}{self._at(interval['low_at'])}"
            high = f"{rounded_down(interval['high'])}{self._unit}{self._at(interval['high_at'])}"
            spans.append(f"{low} to {high}")
        values = f"{value_of_rows(self._claim, self._along)} for all of them"
        if spans:
            return f"{values}: {' and '.join(spans)}{unless(self._claim, certain=known)}"
        why = ""
        if "without" in common:
            why = f": none{self._at(common['without'])}"
        elif "low" in common:
            high = f"{rounded_up(common['high'])}{self._unit}{self._at(common['high_at'])}"
            low = f"{rounded_down(common['low'])}{self._unit}{self._at(common['low_at'])}"
            why = f": up to {high}, and from {low} on"
        return f"no {values}{'' if known else ' is known'}{why}"

    def _at(self, place: Mapping[str, float]) -> str:
        """The place that sets an end, behind it."""
        return f" (at {self._numbers_in_words(place)})" if place else ""

    def stiffest_felt(self) -> str:
        """The largest static stiffness that the hand feels at an end of a stable interval, and its place; may be empty.

        Between the ends of a range of stiffnesses nothing is felt that is stiffer, unless the
        stiffness felt falls.
        """
        felt = self._numbers["stiffest_felt"]
        if felt is None:
            return ""
        said = "stiffest wall as the hand feels it at rest"
        if felt["falls"] or self._numbers["unit"] not in STIFFNESS:
            said += ", at an end of an interval"
        said += f": {rounded_down(felt['value'])} {felt['unit']}"
        said += f" with {self._along} = {self._inside(felt)}{self._unit}{self._gap(self._claim, felt['from'])}"
        return f"{said}{self._place(felt)}{unless(self._claim.of_row(certified=felt['certified']), certain=felt['certified'])}"

    def _inside(self, felt: Numbers) -> str:
        """An end of an interval, rounded into it."""
        at_low = felt["with"] == felt["from"]
        if at_low:
            return rounded_up(felt["with"])
        return rounded_down(felt["with"])

    def title(self) -> str:
        """What the rows of a kind say of which loops, with the word of the kind."""
        return f"{claimed(self._claim)} ({self._hand}):"

    def parts(self) -> Iterator[Line]:
        """Yield all of it but the slices, a line each."""
        felt = self._numbers["stiffest_felt"]
        largest = self._numbers["largest"]
        texts = self.extremes()
        if "lengths" in self._numbers:
            texts.append(lengths_in_words(self._numbers["lengths"]))
        # With direct coupling the stiffest wall and the stiffest felt are the same.
        same = (
            self._hand
            and felt
            and largest
            and np.isclose(felt["value"], largest["value"], rtol=1e-9)
        )
        if not same:
            texts.append(self.stiffest_felt())
        yield from ((f"  {text}", False) for text in texts if text)
        for said, in_doubt in (self.certified(), *self.reasons()):
            yield f"  {said}", in_doubt

    def _gap(self, claim: Claim, low: float, open_places: Numbers | None = None) -> str:
        """Where an interval begins, if that is not at the start of the range, or next to it if it is what is proved.

        claim: of the row. open_places: of the interval, which are named too.
        """
        start = self._numbers["range"][0]
        at_start = start is not None and low <= start
        if claim.status is Status.PROVED:
            at_start |= low <= BEGINS_NEAR_ZERO * self._numbers["largest"]["value"]
        said = []
        if not at_start:
            begins = "met" if self._numbers["required"] else everywhere(claim)
            said.append(f"{begins} from {rounded_up(low)} on")
        if open_places:
            said.append(open_in_words(open_places, self._unit))
        return f" ({', '.join(said)})" if said else ""

    def _unit_of(self, name: str) -> str:
        unit = readable(self._numbers["units"].get(name, ""))
        return f" {unit}" if unit else ""

    def _numbers_in_words(self, numbers: Mapping[str, float]) -> str:
        return ", ".join(
            f"{name} = {value:g}{self._unit_of(name)}" for name, value in numbers.items()
        )

    def _place(self, extreme: Numbers) -> str:
        if not extreme["at"]:
            return ""
        places = []
        for name, value in extreme["at"].items():
            edge = " (the edge of that axis)" if name in extreme["at_the_edge_of"] else ""
            places.append(f"{name} = {value:g}{self._unit_of(name)}{edge}")
        said = f" at {', '.join(places)}"
        equal_rows = extreme["equal_rows"] - 1
        if equal_rows:
            return f"{said}, and in {count(equal_rows, 'other row')}"
        return said


def interval_lines(numbers: Numbers) -> Iterator[Line]:
    """Yield the summary of a table of intervals as lines, each with a flag that is true for a warning."""
    if "along" in numbers:
        yield from _lines_of_loop(numbers)
        return
    for spec, of_spec in numbers.get("specs", {}).items():
        yield f"{spec}:", False
        if "along" in of_spec:
            yield from Sentences(of_spec).parts()
        else:
            yield from interval_lines(of_spec)
    of_kinds = numbers.get("guarantees") or numbers.get("hands", {})
    for word, of_kind in of_kinds.items():
        sentences = Sentences(of_kind, word)
        yield _folded(sentences.title()), False
        yield from sentences.parts()
    words = [word for word, of_kind in of_kinds.items() if of_kind.get("rows_not_settled")]
    if words:
        unsettled = numbers.get("rows_not_settled") or numbers.get("rows_of_the_box_not_proved", 0)
        kind = row_kinds()[words[0]]
        yield (
            kind.unsettled.format(rows=count(unsettled, "row"), words=" and ".join(words)),
            True,
        )


def _set_by(extreme: Numbers) -> str:
    """Which of several requirements sets an end, if the table has that."""
    word = extreme.get("set_by")
    if not word:
        return ""
    return f", set by {'a mode' if word == 'mode' else word}"


def _folded(text: str) -> str:
    """A text in lines of at most WIDEST letters, with two spaces before those about one of several
    kinds of rows."""
    return "\n".join(folded(text, WIDEST - 2))


def _lines_of_loop(numbers: Numbers) -> Iterator[Line]:
    """Yield the lines of a table whose rows are all of the spec's own loop."""
    sentences = Sentences(numbers)
    texts = [sentences.counts(numbers["slices"]), *sentences.few_slices(), *sentences.extremes()]
    texts += [sentences.of_one_without(), sentences.stiffest_felt()]
    yield from ((text, False) for text in texts if text)
    yield sentences.certified()
    yield from sentences.reasons()
