"""A claim: what is known of which loops. All words about it follow from it, and whether it answers
what a spec asks.

A prover makes a claim of the plan that it used, and never of the spec: a claim that is made of a
narrower plan does not cover what the spec asks, and is then no answer.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from fractions import Fraction
from math import lcm
from typing import TYPE_CHECKING, Any, NamedTuple

from wavesweep.engine.drawing import SHARES, name_of, path_of, scalars
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.program.analyses.required_words import required_in_words
from wavesweep.program.number_words import span_in_words
from wavesweep.program.row_kinds import row_kind

if TYPE_CHECKING:
    from wavesweep.engine.drawing import Drawing
    from wavesweep.program.reading.axes import Axis
    from wavesweep.program.reading.tables import TableValue
    from wavesweep.program.spec import Spec

RATIO, DELAY = "rates.ratio", "environment.delay"
OPERATOR, LINEAR = "operator", "linear"
PUSHES = "any wall up to K_VE, B_VE that pushes and never pulls"
PASSIVE_HANDS, NOBODY = "every passive hand", "nobody at the device"
# the same where some of them fails: "not stable with every passive hand" reads as with none
ALL_OF = {
    PUSHES: "all walls up to K_VE, B_VE that push and never pull",
    PASSIVE_HANDS: "all passive hands",
}
LINEAR_LOOP = (
    "All else is as the spec writes it, in a linear loop that is sampled and held at its rates, "
    "without friction and the steps of an encoder"
)
OWN_NUMBERS = "with the spec's own numbers"
WITH_FRAME = "frame"  # as a delay: in place with the next frame
SETTLED_WITHIN = 1e-2  # of an end or a margin, how far proof and refutation may be apart
PLAIN_FRACTION = 100  # the largest denominator of a probability that is written as a fraction
SPELLED = ("two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
WIDEST = 120  # letters of a line
CURVED = "saturation"  # the type of blocks that contact is about beside a wall


class Status(IntEnum):
    """How a claim is known, from the worst answer to the best."""

    REFUTED = 0
    UNKNOWN = 1
    COMPUTED = 2
    CHECKED = 3
    CERTIFIED = 4
    PROVED = 5

    @property
    def answer(self) -> str:
        """What it answers."""
        return {Status.REFUTED: "no", Status.UNKNOWN: "not known"}.get(self, "yes")


IN_DOUBLES = "not certified (double precision)"
SAMPLED = "not certified (sampled bounds)"
HOW_KNOWN = {
    Status.REFUTED: "refuted",
    Status.UNKNOWN: "not known",
    Status.COMPUTED: f"{IN_DOUBLES}, but for what a line says is",
    Status.CHECKED: SAMPLED,
    Status.CERTIFIED: "certified, but for what a line says is not",
    Status.PROVED: "proved, but for what a line says is not",
}


class Form(NamedTuple):
    """How a property is worded, with {words} and {short}: if it holds, is proved, does not hold,
    and is in question.

    of_values: behind or before the name of a number, as "stable" of K_VE. nowhere: of a range.
    """

    holds: str
    proved: str
    fails: str
    question: str
    of_values: str
    nowhere: str


FORMS = {
    "adjective": Form(
        "{words}",
        "proved {words}",
        "not {words}",
        "whether {words}",
        "{short}",
        "nowhere {short}",
    ),
    "requirement": Form(
        "as required, {words}",
        "proved as required, {words}",
        "not as required, {words}",
        "whether {words}",
        "with {words}",
        "nowhere as required",
    ),
    "motions": Form(
        "{words}",
        "proved to come to rest",
        "does not come to rest",
        "whether every motion comes to rest",
        "at which every motion comes to rest",
        "comes to rest nowhere",
    ),
    "figures": Form(
        "{words}", "{words} proved", "no {words}", "about {words}", "with {words}", "no {words}"
    ),
}


class Property(NamedTuple):
    """What a claim says of a loop.

    form: in FORMS; "figures" of what a table has that answers no question, such as responses.
    short: of values, by default the same words.
    """

    words: str
    form: str = "adjective"
    short: str = ""

    def worded(self) -> Form:
        """The words of the form."""
        short = self.short or self.words
        return Form(*(text.format(words=self.words, short=short) for text in FORMS[self.form]))

    @property
    def required(self) -> str:
        """What [sweep] require asks for, in words; empty of another property."""
        if self.form == "requirement":
            return self.words
        return ""

    @property
    def adjective(self) -> str:
        """What a value of a number is, in a word or two."""
        if self.required:
            return "as required"
        return self.worded().of_values

    def value(self, name: str) -> str:
        """A value of a number with which it holds: "stable K_VE"."""
        words = self.worded().of_values
        after = words.startswith(("with ", "at "))
        if after:
            return f"{name} {words}"
        return f"{words} {name}"


STABLE = Property("stable")
MEAN_SQUARE = Property("stable in mean square")
AT_REST = Property("comes to rest", "motions")


def required(spec: Spec) -> Property:
    """The property that [sweep] require asks for; stability without it."""
    return required_by(spec.require, drawn=bool(spec.drawing))


def required_by(require: TableValue | None, *, drawn: bool) -> Property:
    """The property that a table as [sweep] require asks for; drawn: of a drawn loop."""
    if not require:
        return STABLE
    return Property(required_in_words(require.written(), drawn=drawn), "requirement")


def listed_values(values: Iterable[float | str]) -> str:
    """Some values in words: in order, those of long lists by their number and ends."""
    texts = [each for each in values if isinstance(each, str)]
    numbers = sorted(each for each in values if not isinstance(each, str))
    if len(numbers) > 6:
        whole = numbers == list(range(int(numbers[0]), int(numbers[-1]) + 1))
        count = "" if whole else f"{len(numbers)} values from "
        return ", ".join([f"{count}{numbers[0]:g} to {numbers[-1]:g}", *texts])
    return ", ".join([*(f"{each:g}" for each in numbers), *texts])


def weighted(values: Iterable[float | str], chances: Sequence[float]) -> str:
    """Values in ascending order, each but the last with its probability, in words."""
    *first, last = sorted(values, key=lambda value: (isinstance(value, str), value))
    shares = _fractions(chances)
    if len(first) + 1 != len(shares):  # periods of several blocks that follow from one number
        return f"{listed_values([*first, last])} ({', '.join(shares)})"
    said = []
    for value, share in zip(first, shares, strict=False):
        said.append(f"{listed_values([value])} ({share})")
    return f"{', '.join(said)} and {listed_values([last])}"


def _fractions(chances: Sequence[float]) -> list[str]:
    """Probabilities as fractions of one plain number, "9 of 10", or if there is none as numbers."""
    fractions = [Fraction(chance).limit_denominator(PLAIN_FRACTION) for chance in chances]
    whole = lcm(*(each.denominator for each in fractions))
    if whole > PLAIN_FRACTION or [*map(float, fractions)] != [*chances]:
        return [f"{chance:.4g}" for chance in chances]
    return [f"{each.numerator * whole // each.denominator} of {whole}" for each in fractions]


def lost_in_words(most: int | str) -> str:
    """What may be lost so many times in a row at most, in words; a text is an expression of
    numbers that are swept."""
    if isinstance(most, str):
        return f"lost, up to {most} in a row"
    first_not = most + 1
    words = dict(zip(range(2, 11), SPELLED, strict=True))
    return f"lost, never {words.get(first_not, first_not)} in a row"


class Order(IntEnum):
    """How frames, or messages, follow each other."""

    CONSTANT = 0
    ANY = 1
    AT_RANDOM = 2


class Chances(NamedTuple):
    """The probabilities of what frames are at random.

    lengths: those of the lengths in ascending order, a row, or one after each length. results:
    those of the delays in ascending order, and then that a result never comes, a row, or one in
    frames of each length.
    """

    lengths: tuple[tuple[float, ...], ...] = ()
    results: tuple[tuple[float, ...], ...] = ()

    @staticmethod
    def of(table: TableValue) -> Chances:
        """The probabilities of [for_all], which lists values in any order."""
        varied = {axis.path == DELAY: _ascending(_values(axis)) for axis in table.changing}
        lengths = [tuple(row[i] for i in varied.get(False, (0,))) for row in table.lengths]
        results = [(*(row[i] for i in varied.get(True, (0,))), row[-1]) for row in table.results]
        ordered = []
        for rows in (lengths, results):
            places = varied.get(False, (0,)) if len(rows) > 1 else (0,)
            ordered.append(tuple(rows[i] for i in places))
        return Chances(*ordered)


ALWAYS = Chances()


@dataclass(frozen=True, slots=True)
class Frames:
    """Which frames follow each other, and when their results are in place.

    lengths: in ticks. delays: of results, in ticks, or WITH_FRAME. lost: results in a row that may
    be lost; loss: the probability that one is. chances: of all of that at random.
    """

    order: Order = Order.CONSTANT
    lengths: frozenset[float] = frozenset()
    delays: frozenset[float | str] = frozenset()
    lost: int = 0
    loss: float = 0.0
    chances: Chances = ALWAYS

    def covers(self, asked: Frames) -> bool:
        """Whether what holds for these frames holds for others."""
        within = (
            asked.lengths <= self.lengths
            and asked.delays <= self.delays
            and asked.lost <= self.lost
        )
        if Order.AT_RANDOM in (self.order, asked.order):
            return self.order == asked.order and self.chances == asked.chances and within
        return self.order >= asked.order and within

    def in_words(self) -> Iterator[str]:
        """Yield what there is beside frames of one length."""
        order = " in any order" if self.order is Order.ANY else ""
        lengths = listed_values(self.lengths)
        delays = listed_values(self.delays)
        after = in_frames = ""
        if self.order is Order.AT_RANDOM:
            order = " at random"
            lengths, after = self._weighted(self.lengths, self.chances.lengths, "after")
            given = [_shares(row[:-1]) for row in self.chances.results]
            delays, in_frames = self._weighted(self.delays, given, "in frames of")
        if len(self.lengths) > 1:
            yield f"frames of {lengths} ticks{order}{after}"
        if len(self.delays) > 1:
            yield f"results {delays} ticks late{order}{in_frames}"
        if self.lost:
            yield f"results {lost_in_words(self.lost)}"
        if self.loss:
            yield f"results lost with probability {self.loss:g}"

    def _weighted(self, values, rows, where):
        """Values with their probabilities, and if these depend on the lengths which are where."""
        if len(rows) < 2:
            return weighted(values, *rows or ((),)) if len(values) > 1 else "", ""
        each = (
            f"{where} {length:g}: {weighted(values, row)}"
            for length, row in zip(sorted(self.lengths), rows, strict=False)
        )
        return listed_values(values), f" ({'; '.join(each)})"


def _ascending(values: Sequence[float]) -> list[int]:
    """The places of values in ascending order."""
    return sorted(range(len(values)), key=values.__getitem__)


def _shares(row: Sequence[float]) -> list[float]:
    """Probabilities of what is not lost, with a sum of 1."""
    return [each / (sum(row) or 1.0) for each in row]


class Range(NamedTuple):
    """A number that is constant and not known: its path, and its values, or the ends of its
    range; without either it may be any, as no loop reads it."""

    path: str
    low: float | None = None
    high: float | None = None
    values: tuple[float, ...] = ()

    @staticmethod
    def of(axis: Axis) -> Range:
        """The range of an axis; a whole number has values."""
        values = _values(axis) if axis.structural else axis.values
        return Range(axis.path, axis.start, axis.stop, values)

    def covers(self, asked: Range) -> bool:
        """Whether all values of another range are in this one."""
        if self.values:
            return bool(asked.values) and {*asked.values} <= {*self.values}
        if self.low is None or self.high is None:
            return True
        if asked.low is None or asked.high is None:
            return False
        ends = asked.values or (asked.low, asked.high)
        return self.low <= min(ends) and max(ends) <= self.high

    def in_words(self) -> str:
        """The number and its values."""
        if len(self.values) == 1:
            return f"{name_of(self.path)} = {self.values[0]:g}"
        if self.values:
            return f"{name_of(self.path)} of {listed_values(self.values)}"
        if self.low is None:
            return f"any {name_of(self.path)}"
        return f"{name_of(self.path)} from {self.low:g} to {self.high:g}"


def ranges_of(
    paths: Iterable[str], boxes: Sequence[tuple[Mapping[str, Sequence[float]], Mapping[str, Any]]]
) -> tuple[Range, ...]:
    """The numbers of the boxes that a proof has covered.

    boxes: the ends of ranges, and single values, by path. A number that no box has is read by no
    loop.
    """
    found = []
    for path in paths:
        ends = [ranges[path] for ranges, _ in boxes if path in ranges]
        values = {float(fixed[path]) for _, fixed in boxes if path in fixed}
        if ends:
            low = min(low for low, _ in ends)
            found.append(Range(path, low, max(high for _, high in ends)))
        elif values:
            found.append(Range(path, min(values), max(values), tuple(sorted(values))))
        else:
            found.append(Range(path))
    return tuple(found)


class Messages(NamedTuple):
    """What the messages of a channel may do: come late by so many ticks at most, be lost so many
    in a row; or at random with the probabilities of SHARES. A text is an expression of numbers
    that are swept.
    """

    channel: str
    late: int | str = 0
    lost: int | str = 0
    chances: tuple[tuple[str, float | str], ...] = ()

    @property
    def in_time(self) -> bool:
        """Whether none is late or lost."""
        return not (self.late or self.lost or self.chances)

    def covers(self, asked: Messages) -> bool:
        """Whether these messages may do all that others may."""
        late = isinstance(self.late, str) or self.late >= asked.late
        lost = isinstance(self.lost, str) or self.lost >= asked.lost
        return late and lost and self.chances == asked.chances

    def in_words(self) -> str:
        """What the messages may do that are not all in time."""
        said = []
        if self.late:
            said.append(f"late by up to {self.late} tick{'s' * (self.late != 1)}")
        if self.chances:
            said.append(self._losses_in_words())
        elif self.lost:
            said.append(lost_in_words(self.lost))
        return f"messages of {self.channel} {' or '.join(said)}"

    def _losses_in_words(self):
        chances = {
            key: chance if isinstance(chance, str) else f"{chance:g}"
            for key, chance in self.chances
        }
        said = f"lost with probability {chances['loss']}"
        if chances["burst"] == "0":
            return said
        begins = f"begun with {chances['burst']}, ended with {chances['burst_end']}"
        return f"{said}, {chances['burst_loss']} in bursts ({begins})"


class Tick(NamedTuple):
    """The shortest and the longest time of a fast tick (s), each of which may come at any time;
    equal if all are alike."""

    low: float
    high: float

    def covers(self, asked: Tick) -> bool:
        """Whether all times of another interval are in this one."""
        return self.low <= asked.low and asked.high <= self.high

    def in_words(self) -> Iterator[str]:
        """Yield which ticks these are, if they are not all alike."""
        if self.low < self.high:
            yield f"ticks of {span_in_words(1e3 * self.low, 1e3 * self.high)} ms in any order"


@dataclass(frozen=True, slots=True)
class Scope:
    """Which loops a claim is about.

    numbers: those that have ranges; all others have the spec's own values. messages: of channels
    that are not always in time. hands: the spec's own operator, or others in words. walls: LINEAR,
    PUSHES, or those of `curve_of`: each function with slopes from 0 to 1 in place of the linear
    one. tick: None for ticks that are all the spec's own. run: of a single run its frames, ticks
    and messages in words, where they are not the spec's own.
    """

    numbers: tuple[Range, ...] = ()
    frames: Frames = Frames()
    messages: tuple[Messages, ...] = ()
    hands: str = OPERATOR
    walls: str = LINEAR
    tick: Tick | None = None
    run: str = ""

    @staticmethod
    def read(written: Mapping[str, Any]) -> Scope:
        """The scope that `written` has given."""
        frames = dict(written["frames"])
        for name in ("lengths", "delays"):
            frames[name] = frozenset(frames[name])
        frames["order"] = Order[frames["order"].upper()]
        rows = (tuple(map(tuple, each)) for each in frames["chances"])
        frames["chances"] = Chances(*rows)
        numbers = [Range(**{**each, "values": (*each["values"],)}) for each in written["numbers"]]
        messages = tuple(
            Messages(**{**each, "chances": tuple(map(tuple, each["chances"]))})
            for each in written["messages"]
        )
        tick = Tick(**written["tick"]) if written["tick"] else None
        others = {name: written.get(name, "") for name in ("hands", "walls", "run")}
        return Scope(tuple(numbers), Frames(**frames), messages, tick=tick, **others)

    def covers(self, asked: Scope, own: Mapping[str, Any]) -> bool:
        """Whether all loops of another scope are in this one; own: the spec's own values, by
        their paths."""
        if not self._covers_numbers(asked, own) or not self._covers_messages(asked):
            return False
        if self.run:  # a single run says nothing of any other
            return self == asked
        walls = asked.walls in (self.walls, LINEAR)
        # The spec's own tick is one of those of [for_all].
        ticks = asked.tick is None or (self.tick is not None and self.tick.covers(asked.tick))
        return self.frames.covers(asked.frames) and self.hands == asked.hands and walls and ticks

    def _covers_numbers(self, asked, own):
        ranges = {each.path: each for each in self.numbers}
        numbers = {each.path: each for each in asked.numbers}
        for path in {*ranges, *numbers}:
            value = float(own[path])
            at_own = Range(path, value, value, (value,))
            if not ranges.get(path, at_own).covers(numbers.get(path, at_own)):
                return False
        return True

    def _covers_messages(self, asked):
        channels = {each.channel: each for each in self.messages}
        for messages in asked.messages:
            known = channels.pop(messages.channel, Messages(messages.channel))
            if not known.covers(messages):
                return False
        return not any(each.chances for each in channels.values())

    def written(self) -> dict[str, Any]:
        """The scope as JSON has it."""
        scope = {name: getattr(self, name) for name in self.__slots__}
        frames = {name: getattr(self.frames, name) for name in self.frames.__slots__}
        scope["frames"] = frames
        frames["order"] = self.frames.order.name.lower()
        for name in ("lengths", "delays"):
            frames[name] = sorted(frames[name], key=str)
        frames["chances"] = [[[*row] for row in rows] for rows in self.frames.chances]
        scope["numbers"] = [each._asdict() | {"values": [*each.values]} for each in self.numbers]
        scope["messages"] = [each._asdict() for each in self.messages]
        scope["tick"] = self.tick and self.tick._asdict()
        return scope

    def paths(self) -> set[str]:
        """The numbers that it has others for than the spec's own."""
        paths = {each.path for each in self.numbers}
        frames = self.frames
        if len(frames.lengths) > 1 or (self.run and frames.order is Order.ANY):
            paths.add(RATIO)
        if len(frames.delays) > 1:
            paths.add(DELAY)
        return paths

    def loops(self) -> str:
        """The numbers, frames and messages of the scope in words; empty of the spec's own."""
        if self.run:
            return self.run
        said = [each.in_words() for each in self.numbers]
        said += self.frames.in_words()
        said += [each.in_words() for each in self.messages if not each.in_time]
        if in_time := [each.channel for each in self.messages if each.in_time]:
            said.append(f"messages of {' and '.join(in_time)} all in time")
        said += self.tick.in_words() if self.tick else ()
        return ", ".join(said)

    def _loops_of_a_line(self) -> str:
        """The same for a line, whose longest texts name the tables that have them."""
        loops = self.loops()
        # In place of a longer scope the table that has it is named.
        if len(loops) <= 76 or self.run:
            return loops
        late = [each for each in self.messages if not each.in_time]
        tables = []
        if self.numbers or self.tick or [*self.frames.in_words()]:
            at_random = self.frames.order is Order.AT_RANDOM
            tables.append(f"all of [for_all]{', at random by its shares' if at_random else ''}")
        losses = [dict(each.chances)["loss"] for each in late if each.chances]
        if losses:
            tables.append(f"messages lost with probability {listed_values(losses)}, or in bursts")
        elif late:
            tables.append("all patterns of late and lost messages")
        return " and ".join(tables)

    def own(self) -> str:
        """The spec's own numbers, with the length of their frames."""
        lengths = [each for each in self.frames.lengths if not isinstance(each, str)]
        frames = f", frames of {lengths[0]:.6g} ticks" if len(lengths) == 1 else ""
        return f"{OWN_NUMBERS}{frames}"

    def walls_in_words(self) -> str:
        """What takes the place of the linear loop."""
        if self.walls == LINEAR:
            return LINEAR_LOOP
        return f"With {self.walls}: any function of its input with slopes from 0 to 1"

    @property
    def several(self) -> bool:
        """Whether it is of more than one loop, or one that changes in more than one way."""
        frames = self.frames
        changing = frames.order is Order.ANY and (
            len(frames.lengths) > 1 or len(frames.delays) > 1 or frames.lost
        )
        patterns = any(each.late or each.lost for each in self.messages)
        others = self.hands in ALL_OF or self.walls != LINEAR
        numbers = any(len(each.values) != 1 for each in self.numbers)
        return bool(changing or patterns or others or numbers or self.tick)

    def in_words_of_all(self) -> str:
        """The same of what some of them does not have: "not stable for all of these"."""
        if not self.several or self.run:
            return self.in_words()
        said = [loops.removeprefix("all ")] if (loops := self._loops_of_a_line()) else []
        if self.hands != OPERATOR:
            said.append(ALL_OF.get(self.hands, self.hands))
        if self.walls != LINEAR:
            said.append(ALL_OF.get(self.walls, self.walls))
        return f"for all {' and '.join(said).removeprefix('all ')}"

    def in_words(self, *, whole: bool = False) -> str:
        """The loops of the scope, beside the spec's own numbers; empty if there are none. whole:
        however long they are."""
        loops = self.loops() if whole else self._loops_of_a_line()
        words = [f"{'with' if self.run else 'for'} {loops}"] if loops else []
        if self.hands != OPERATOR:
            words.append(f"with {self.hands}")
        if self.walls != LINEAR:
            words.append(f"with {self.walls}")
        return " ".join(words)


@dataclass(frozen=True, slots=True)
class Claim:
    """What is known of the loops of a scope.

    reason: what refutes it, why it is not known, or by what it is proved, in words.
    """

    what: Property
    scope: Scope
    status: Status
    reason: str = ""

    def words(self) -> str:
        """The claim as a sentence without a subject."""
        loops = self.scope.in_words()
        about = f" {loops}" if loops else ""
        because = f": {self.reason}" if self.reason else ""
        words = self.what.worded()
        match self.status:
            case Status.REFUTED:
                return f"{self.failed()}{because}"
            case Status.UNKNOWN:
                return f"not known {words.question}{about}{because}"
            case Status.PROVED:
                return f"{words.proved}{about}{self.reason and f', {self.reason}'}"
            case Status.COMPUTED:
                return f"{words.holds}{about}, {IN_DOUBLES}"
        return f"{words.holds}{about}, {self.vouched}"

    def failed(self) -> str:
        """That some of the loops do not have it."""
        return f"{self.what.worded().fails} {self.scope.in_words_of_all()}".rstrip()

    def brief(self) -> str:
        """The claim in a few words, without its loops, its reason, and what is required."""
        words = self.what.worded()
        if self.status is Status.UNKNOWN:
            required = "," in words.question
            if required:
                return "not known"
            return f"not known {words.question}"
        said = {Status.REFUTED: words.fails, Status.PROVED: words.proved}
        some = " for all of these" if self.status is Status.REFUTED and self.scope.several else ""
        return said.get(self.status, words.holds).partition(",")[0] + some

    def over(self, specs: Sequence[Spec], swept: Collection[str]) -> Claim:
        """The claim of rows over some axes, by whose numbers messages are late or lost.

        specs: those of the table; swept: the paths of its axes.
        """
        drawings = [spec.drawing for spec in specs if spec.drawing]
        channels = {block.name: block for drawing in drawings for block in drawing.channels}
        messages = []
        for each in self.scope.messages:
            keys = dict(channels[each.channel].keys)
            of_swept = {
                name: keys[name].text
                for name in ("late", "lost", *SHARES)
                if any(path_of(number) in swept for number in keys[name].names)
            }
            if each.chances:
                chances = tuple((key, of_swept.get(key, chance)) for key, chance in each.chances)
                messages.append(each._replace(chances=chances))
            else:
                texts = {name: of_swept[name] for name in ("late", "lost") if name in of_swept}
                messages.append(each if each.in_time else each._replace(**texts))
        return replace(self, scope=replace(self.scope, messages=tuple(messages)))

    def said(self) -> str:
        """What is claimed and of which loops, whatever is known of it."""
        return f"{self.what.worded().holds} {self.scope.in_words() or self.scope.own()}"

    def written(self) -> dict[str, Any]:
        """The claim as JSON has it."""
        said = {"what": self.what.worded().holds, "answer": self.status.answer}
        known = {"status": self.status.name.lower(), "reason": self.reason}
        return said | known | {"loops": self.scope.loops(), "scope": self.scope.written()}

    def fact(self) -> dict[str, Any]:
        """The claim as a fact of a table, which `read` reads."""
        return {**self.written(), "said": self.said(), "property": self.what._asdict()}

    @staticmethod
    def read(fact: Mapping[str, Any]) -> Claim:
        """The claim of a fact of a table."""
        what = Property(**fact["property"])
        status = Status[fact["status"].upper()]
        return Claim(what, Scope.read(fact["scope"]), status, fact["reason"])

    @property
    def vouched(self) -> str:
        """What rows are that are known as the claim says."""
        return SAMPLED if self.status is Status.CHECKED else "certified"

    @property
    def in_doubt(self) -> str:
        """What the other rows are."""
        return "not known" if self.status is Status.CHECKED else "not certified"

    def of_row(self, *, certified: bool) -> Claim:
        """The claim of a row: one that is not certified has found what others are proved for."""
        if certified or self.status is not Status.PROVED:
            return self
        return replace(self, status=Status.COMPUTED)

    def value(self, name: str) -> str:
        """A value of a number that the rows have."""
        if self.status is Status.PROVED:
            return f"proved {name}"
        return self.what.value(name)

    def everywhere(self) -> str:
        """What the rows say of all values up to one."""
        if self.status is Status.PROVED:
            return "proved"
        return self.what.worded().of_values

    def none(self, name: str, reason: str, *, undecided: bool) -> str:
        """That no value of a number in the swept range has it; undecided: whether some may."""
        because = f": {reason}" if reason else ""
        if undecided:
            found = f"no {self.value(name)} found"
            more = f"; {reason}" if reason else ""
            return f"{found}, but part of the swept range is not known{more}"
        return f"no {self.what.value(name)} anywhere in the swept range{because}"

    def of_intervals(self) -> str:
        """How intervals are known of which no row is in doubt."""
        if self.status is Status.CERTIFIED and self.what == STABLE:
            return "Certified: of the range every value in an interval is stable, and no other one."
        return f"The intervals are {self.vouched}."

    def extreme(self, what: str, rows: str, *, certified: bool) -> str:
        """What the largest value of a figure is.

        what: "largest", or another word for it. rows: the name of its rows, empty if there are no
        others. certified: whether it has to be said that it is, since others are not.
        """
        if self.status is Status.PROVED:
            return f"{what} {rows}".rstrip()
        comma = "," if " " in what + self.vouched else ""
        known = f"{comma} {self.vouched}" if certified else ""
        return what + known + (f", {rows}" if rows else "")

    def nothing(self, known: bool) -> str:
        """That a line of a figure has no interval; known: whether that is certain."""
        if known:
            return self.what.worded().nowhere
        proved = self.status is Status.PROVED
        if proved:
            return "nothing proved"
        return f"nothing known to be {self.what.adjective}"

    def unless(self, known: bool) -> str:
        """What is added to a bound of a row of which that is not known; nothing to one that is."""
        return "" if known else f", {self.in_doubt}"


def known(claims: Iterable[Claim]) -> str:
    """What is claimed, and how that is known, in sentences."""
    sentences = []
    for claim in claims:
        said = f"{claim.said()}: {HOW_KNOWN[claim.status]}."
        sentences.append(f"{said[:1].upper()}{said[1:]}")
    return " ".join(dict.fromkeys(sentences))


def beyond_the_ends(claims: Iterable[Claim]) -> str:
    """What is refuted of values beyond the ends of rows, in a sentence; a requirement is refuted
    by what is not stable."""
    said = []
    for claim in claims:
        failed = replace(claim, what=STABLE if claim.what.required else claim.what).failed()
        own = "" if claim.scope.in_words() else f" {claim.scope.own()}"
        said.append(f"{failed}{own}")
    return f"By what each line names: {'; '.join(dict.fromkeys(said))}."


def of_rows(facts: Mapping[str, Any], word: str, columns: Collection[str] = ()) -> Claim:
    """What the rows of a table with a word say; columns: the names of those that the table has.

    Of a table of an earlier version, which has no claims, only that much is known.
    """
    written = facts.get("claims", {}).get(word or "spec", {})
    if "property" not in written:
        status = Status.CERTIFIED
        if row_kind(word).unsettled and "settled" in columns:
            status = Status.PROVED
        return Claim(STABLE, Scope(), status)
    return Claim.read(written)


class Question(NamedTuple):
    """What a spec asks: a property of the loops of a scope."""

    what: Property
    scope: Scope


def curve_of(block: str) -> str:
    """What stands for a block that saturates: each function with slopes from 0 to 1."""
    return f"{block} at its limits, or any curve of slopes from 0 to 1"


def own_scope(spec: Spec) -> Scope:
    """The scope of the spec's own numbers, with frames of one length and all messages in time."""
    channels = spec.drawing.channels if spec.drawing else ()
    in_time = tuple(Messages(block.name) for block in channels)
    return Scope(frames=_frames(spec, Order.CONSTANT, {}), messages=in_time)


def own_figures(specs: Sequence[Spec], what: str) -> dict[str, Claim]:
    """The claims of a table that has some figures of each spec's own numbers."""
    claims = {}
    for spec in specs:
        word = spec.name if len(specs) > 1 else "spec"
        claims[word] = Claim(Property(what, "figures"), own_scope(spec), Status.COMPUTED)
    return claims


def uncovered(spec: Spec, scopes: Sequence[Scope]) -> Iterator[Scope]:
    """Yield what a spec asks about and none of these scopes covers, but for properties of rows."""
    for scope in dict.fromkeys(question.scope for question in questions(spec)):
        if not any(each.covers(scope, spec.values) for each in scopes):
            yield scope


def asked_scope(spec: Spec, *, at_random: bool = False) -> Scope:
    """All that [for_all] and the channels of a spec name; at_random: what is at random there, in
    place of any order."""
    table = spec.for_all
    varied = {axis.path: _values(axis) for axis in table.changing}
    changes = varied or table.lost or table.loss
    order = Order.CONSTANT
    chances = ALWAYS
    if at_random and table.at_random:
        order = Order.AT_RANDOM
        chances = Chances.of(table)
    elif changes:
        order = Order.ANY
    frames = _frames(spec, order, varied)
    frames = replace(frames, lost=table.lost, loss=table.loss, chances=chances)
    numbers = tuple(Range.of(axis) for axis in table.unknown)
    messages = messages_of(spec.drawing, spec.values) if spec.drawing else ()
    return Scope(numbers, frames, messages)


def messages_of(drawing: Drawing, values: Mapping[str, Any]) -> tuple[Messages, ...]:
    """What the messages of the channels of a drawing may do with these numbers."""
    numbers = scalars(values)
    found = []
    for block in drawing.channels:
        keys = dict(block.keys)
        late = int(keys["late"].value(numbers))
        if block.loses_at_random:
            chances = tuple((key, float(keys[key].value(numbers))) for key in SHARES)
            found.append(Messages(block.name, late, 0, chances))
        else:
            found.append(Messages(block.name, late, int(keys["lost"].value(numbers))))
    return tuple(found)


def _values(axis: Axis) -> tuple[float, ...]:
    """The values of a number that varies, those of a whole one one by one."""
    return axis.values or tuple(range(int(axis.start), int(axis.stop) + 1))


def _frames(spec: Spec, order: Order, varied: Mapping[str, Sequence[float]]) -> Frames:
    """The frames of a spec; varied: path -> values of the numbers that change from frame to
    frame."""
    values = spec.values
    if not spec.drawing:
        lengths = varied.get(RATIO, (values[RATIO],) if RATIO in keys_of_page(values) else ())
        own = WITH_FRAME if spec.delay_of_frame else values[DELAY]
        delays = varied.get(DELAY, (own,))
        return Frames(order, frozenset(lengths), frozenset(delays))
    lengths = set()
    for block in spec.drawing.blocks:
        for path in {path_of(name) for name in block.every.names} & _timing(spec):
            for value in varied.get(path, (values[path],)):
                numbers = scalars({**values, path: value})
                lengths.add(float(block.every.value(numbers)))
    return Frames(order, frozenset(lengths))


def _timing(spec: Spec) -> set[str]:
    """The numbers of a drawing that change from frame to frame."""
    return {axis.path for axis in spec.changing}


def questions(spec: Spec) -> list[Question]:
    """What a spec asks of its loops: of those of [for_all], what [sweep] requires or stability,
    and the rest through contact."""
    what = required(spec)
    asked = []
    table = spec.for_all
    if spec.tick:
        tick = Tick(*spec.tick.interval(spec.tick_hz))
        asked.append(Question(what, replace(own_scope(spec), tick=tick)))
    elif not table:
        asked.append(Question(what, own_scope(spec)))
    else:
        alone = table.loss or (spec.drawing and spec.drawing.at_random)
        at_random = table.at_random or alone
        if not alone:
            asked.append(Question(what, asked_scope(spec)))
        if at_random:
            scope = asked_scope(spec, at_random=True)
            asked.append(Question(MEAN_SQUARE, scope))
            if alone and spec.require:
                asked.append(Question(what, scope))
    if spec.contact:
        scope = asked[0].scope
        asked += [Question(AT_REST, replace(scope, walls=curve)) for curve in _curves(spec)]
    return asked


def _curves(spec: Spec) -> list[str]:
    """The curves through which [sweep] contact asks: of the wall, and of blocks that saturate."""
    curves = [PUSHES] if spec.wall else []
    if spec.drawing:
        curves += [curve_of(each.name) for each in spec.drawing.blocks if each.type == CURVED]
    return curves


def asks_more(spec: Spec) -> bool:
    """Whether a spec asks for more than that its own loop is stable."""
    return questions(spec) != [Question(STABLE, own_scope(spec))]


def answer(question: Question, claims: Iterable[Claim], own: Mapping[str, Any]) -> Claim:
    """What is known of all that a question is about; own: the spec's own values.

    One loop of the scope that is refuted refutes it. What only covers a part of it is no answer.
    """
    scope = question.scope
    refuting = []
    proving = []
    others = []
    for claim in claims:
        about = claim.what == question.what
        instead = claim.what == STABLE and question.what != MEAN_SQUARE
        if claim.status is Status.REFUTED and (about or instead):
            if scope.covers(claim.scope, own):
                refuting.append(claim)
        elif about and claim.scope.covers(scope, own):
            proving.append(claim)
        elif about:
            others.append(claim)
    if refuting:
        reason = next((claim.reason for claim in refuting if claim.reason), "")
        return Claim(question.what, scope, Status.REFUTED, reason)
    if proving:
        best = max(proving, key=lambda claim: claim.status)
        return Claim(question.what, scope, best.status, best.reason)
    shown = max(others, key=lambda claim: claim.status, default=None)
    reason = "nothing proves that yet"
    if shown and shown.status > Status.UNKNOWN:
        reason = "shown for the spec's own numbers alone"
    return Claim(question.what, scope, Status.UNKNOWN, reason)


class Verdict(NamedTuple):
    """The answers to all that a spec asks."""

    answers: tuple[Claim, ...]

    @staticmethod
    def of(spec: Spec, claims: Sequence[Claim]) -> Verdict:
        """The verdict on a spec by what is claimed of its loops."""
        return Verdict(tuple(answer(each, claims, spec.values) for each in questions(spec)))

    @property
    def worst(self) -> Claim:
        """The answer that decides: one that is no, then one that is not known."""
        return min(self.answers, key=lambda claim: claim.status)

    @property
    def status(self) -> Status:
        """How all of it is known."""
        return self.worst.status

    def lines(self, subject: str) -> Iterator[str]:
        """Yield the verdict in a line that begins with its subject, and the answers of several
        that this does not say in full."""
        said = self.answers
        if self.status <= Status.UNKNOWN:
            said = (self.worst,)
        whole = f"{subject}: {'; '.join(claim.words() for claim in said)}"
        first = whole
        if len(first) > WIDEST and len(self.answers) > 1:
            without_reasons = "; ".join(replace(claim, reason="").words() for claim in said)
            first = f"{subject}: {without_reasons}"
        if len(first) > WIDEST and len(self.answers) > 1:
            first = f"{subject}: {'; '.join(claim.brief() for claim in said)}"
        yield first
        for claim in self.answers:
            if first != whole or claim not in said:
                yield f"  {claim.words()}"
