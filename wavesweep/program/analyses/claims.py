"""A claim: what is known of which loops. Whether it answers what a spec asks follows from it, and
so do all words about it, which are in `claim_words`.

A prover makes a claim of the plan that it used, and never of the spec: a claim that is made of a
narrower plan does not cover what the spec asks, and is then no answer.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from wavesweep.engine.drawing import SHARES, path_of, scalars
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.program.analyses.required_words import required_in_words

if TYPE_CHECKING:
    from wavesweep.engine.drawing import Drawing
    from wavesweep.program.reading.axes import Axis
    from wavesweep.program.reading.tables import TableValue
    from wavesweep.program.spec import Spec

RATIO, DELAY = "rates.ratio", "environment.delay"
OPERATOR, LINEAR = "operator", "linear"
PUSHES = "any wall up to K_VE, B_VE that pushes and never pulls"
PASSIVE_HANDS, NOBODY = "every passive hand", "nobody at the device"
WITH_FRAME = "frame"  # as a delay: in place with the next frame
SETTLED_WITHIN = 1e-2  # of an end or a margin, how far proof and refutation may be apart
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


class Property(NamedTuple):
    """What a claim says of a loop.

    form: in FORMS; "figures" of what a table has that answers no question, such as responses.
    short: of values, by default the same words.
    """

    words: str
    form: str = "adjective"
    short: str = ""

    @property
    def required(self) -> str:
        """What [sweep] require asks for, in words; empty of another property."""
        if self.form == "requirement":
            return self.words
        return ""


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
        varied = {axis.path == DELAY: _ascending(axis.choices) for axis in table.changing}
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

    def covers(self, subset: Frames) -> bool:
        """Whether what holds for these frames holds for others."""
        within = (
            subset.lengths <= self.lengths
            and subset.delays <= self.delays
            and subset.lost <= self.lost
        )
        if Order.AT_RANDOM in (self.order, subset.order):
            return self.order == subset.order and self.chances == subset.chances and within
        return self.order >= subset.order and within


def _ascending(values: Sequence[float]) -> list[int]:
    """The places of values in ascending order."""
    return sorted(range(len(values)), key=values.__getitem__)


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
        return Range(axis.path, axis.start, axis.stop, tuple(axis.choices))

    def covers(self, subset: Range) -> bool:
        """Whether all values of another range are in this one."""
        if self.values:
            return bool(subset.values) and {*subset.values} <= {*self.values}
        if self.low is None or self.high is None:
            return True
        if subset.low is None or subset.high is None:
            return False
        ends = subset.values or (subset.low, subset.high)
        return self.low <= min(ends) and max(ends) <= self.high


def ranges_of(
    paths: Iterable[str], boxes: Sequence[tuple[Mapping[str, Sequence[float]], Mapping[str, Any]]]
) -> tuple[Range, ...]:
    """The numbers of the boxes that a proof has covered.

    boxes: the ends of ranges, and single values, by path. A number that no box has is read by no
    loop.
    """
    covered = []
    for path in paths:
        ends = [ranges[path] for ranges, _ in boxes if path in ranges]
        values = {float(fixed[path]) for _, fixed in boxes if path in fixed}
        if ends:
            low = min(low for low, _ in ends)
            covered.append(Range(path, low, max(high for _, high in ends)))
        elif values:
            covered.append(Range(path, min(values), max(values), tuple(sorted(values))))
        else:
            covered.append(Range(path))
    return tuple(covered)


class Messages(NamedTuple):
    """What the messages of a channel may do: come late by so many ticks at most, be lost so many
    in a row; or at random with the probabilities of SHARES. A text is an expression of numbers
    that are swept, or that [for_all] has.
    """

    channel: str
    late: int | str = 0
    lost: int | str = 0
    chances: tuple[tuple[str, float | str], ...] = ()

    @property
    def in_time(self) -> bool:
        """Whether none is late or lost."""
        return not (self.late or self.lost or self.chances)

    def covers(self, subset: Messages) -> bool:
        """Whether these messages may do all that others may."""
        late = _at_least(self.late, subset.late)
        lost = _at_least(self.lost, subset.lost)
        if len(self.chances) != len(subset.chances):
            return False
        chances = all(
            isinstance(chance, str) or (key, chance) == wanted_chance
            for (key, chance), wanted_chance in zip(self.chances, subset.chances, strict=True)
        )
        return late and lost and chances


def _at_least(limit: int | str, number: int | str) -> bool:
    """Whether so much covers what is asked; a text is an expression that has any value."""
    if isinstance(limit, str) or isinstance(number, str):
        return isinstance(limit, str)
    return limit >= number


class Tick(NamedTuple):
    """The shortest and the longest time of a fast tick (s), each of which may come at any time;
    equal if all are alike."""

    low: float
    high: float

    def covers(self, subset: Tick) -> bool:
        """Whether all times of another interval are in this one."""
        return self.low <= subset.low and subset.high <= self.high


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
        rows = (tuple(map(tuple, entry)) for entry in frames["chances"])
        frames["chances"] = Chances(*rows)
        numbers = [
            Range(**{**entry, "values": (*entry["values"],)}) for entry in written["numbers"]
        ]
        messages = tuple(
            Messages(**{**entry, "chances": tuple(map(tuple, entry["chances"]))})
            for entry in written["messages"]
        )
        tick = Tick(**written["tick"]) if written["tick"] else None
        remaining = {name: written.get(name, "") for name in ("hands", "walls", "run")}
        return Scope(tuple(numbers), Frames(**frames), messages, tick=tick, **remaining)

    def covers(self, subset: Scope, design: Mapping[str, Any]) -> bool:
        """Whether all loops of another scope are in this one; design: the spec's own values, by
        their paths."""
        if not self._covers_numbers(subset, design) or not self._covers_messages(subset):
            return False
        if self.run:  # a single run says nothing of any other
            return self == subset
        walls = subset.walls in (self.walls, LINEAR)
        # The spec's own tick is one of those of [for_all].
        ticks = subset.tick is None or (self.tick is not None and self.tick.covers(subset.tick))
        return self.frames.covers(subset.frames) and self.hands == subset.hands and walls and ticks

    def _covers_numbers(self, subset, design):
        ranges = {part.path: part for part in self.numbers}
        numbers = {part.path: part for part in subset.numbers}
        for path in {*ranges, *numbers}:
            value = float(design[path])
            at_own = Range(path, value, value, (value,))
            if not ranges.get(path, at_own).covers(numbers.get(path, at_own)):
                return False
        return True

    def _covers_messages(self, subset):
        channels = {part.channel: part for part in self.messages}
        for messages in subset.messages:
            of_channel = channels.pop(messages.channel, Messages(messages.channel))
            if not of_channel.covers(messages):
                return False
        return not any(part.chances for part in channels.values())

    def written(self) -> dict[str, Any]:
        """The scope as JSON has it."""
        scope = {name: getattr(self, name) for name in self.__slots__}
        frames = {name: getattr(self.frames, name) for name in self.frames.__slots__}
        scope["frames"] = frames
        frames["order"] = self.frames.order.name.lower()
        for name in ("lengths", "delays"):
            frames[name] = sorted(frames[name], key=str)
        frames["chances"] = [[[*row] for row in rows] for rows in self.frames.chances]
        scope["numbers"] = [part._asdict() | {"values": [*part.values]} for part in self.numbers]
        scope["messages"] = [part._asdict() for part in self.messages]
        scope["tick"] = self.tick and self.tick._asdict()
        return scope

    def paths(self) -> set[str]:
        """The numbers that it has others for than the spec's own."""
        paths = {part.path for part in self.numbers}
        frames = self.frames
        if len(frames.lengths) > 1 or (self.run and frames.order is Order.ANY):
            paths.add(RATIO)
        if len(frames.delays) > 1:
            paths.add(DELAY)
        return paths

    @property
    def several(self) -> bool:
        """Whether it is of more than one loop, or one that changes in more than one way."""
        frames = self.frames
        changing = frames.order is Order.ANY and (
            len(frames.lengths) > 1 or len(frames.delays) > 1 or frames.lost
        )
        patterns = any(part.late or part.lost for part in self.messages)
        other_hands_or_walls = self.hands == PASSIVE_HANDS or self.walls != LINEAR
        numbers = any(len(part.values) != 1 for part in self.numbers)
        return bool(changing or patterns or other_hands_or_walls or numbers or self.tick)


@dataclass(frozen=True, slots=True)
class Claim:
    """What is known of the loops of a scope.

    reason: what refutes it, why it is not known, or by what it is proved, in words.
    """

    what: Property
    scope: Scope
    status: Status
    reason: str = ""

    def over(self, specs: Sequence[Spec], swept: Collection[str]) -> Claim:
        """The claim of rows over some axes, by whose numbers messages are late or lost.

        specs: those of the table; swept: the paths of its axes.
        """
        drawings = [spec.drawing for spec in specs if spec.drawing]
        messages = with_texts(self.scope.messages, drawings, swept)
        return replace(self, scope=replace(self.scope, messages=messages))

    @staticmethod
    def read(fact: Mapping[str, Any]) -> Claim:
        """The claim of a fact of a table."""
        claimed = Property(**fact["property"])
        status = Status[fact["status"].upper()]
        return Claim(claimed, Scope.read(fact["scope"]), status, fact["reason"])

    def of_row(self, *, certified: bool) -> Claim:
        """The claim of a row: one that is not certified has found what others are proved for."""
        if certified or self.status is not Status.PROVED:
            return self
        return replace(self, status=Status.COMPUTED)


def of_rows(facts: Mapping[str, Any], word: str) -> Claim:
    """What the rows of a table with a word say; of a table of an earlier version, which has no claims,
    only that much is known."""
    written = facts.get("claims", {}).get(word or "spec", {})
    if "property" not in written:
        return Claim(STABLE, Scope(), Status.CERTIFIED)
    return Claim.read(written)


def word_among(spec: str, word: str) -> str:
    """The word of a claim among those of several specs: the name of its spec, of what is
    guaranteed with its own word behind that."""
    return spec if word == "spec" else f"{spec}/{word}"


def of_spec(facts: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The facts of one of the specs of a table: its tables, and its claims by their words."""
    claims = {}
    for word, claim in facts.get("claims", {}).items():
        spec, _, own_word = word.partition("/")
        if spec == name:
            claims[own_word or "spec"] = claim
    return {"spec": facts.get("specs", {}).get(name, {}), "claims": claims}


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


def own_figures(specs: Sequence[Spec], words: str) -> dict[str, Claim]:
    """The claims of a table that has some figures of each spec's own numbers."""
    claims = {}
    for spec in specs:
        word = spec.name if len(specs) > 1 else "spec"
        claims[word] = Claim(Property(words, "figures"), own_scope(spec), Status.COMPUTED)
    return claims


def uncovered(spec: Spec, scopes: Sequence[Scope]) -> Iterator[Scope]:
    """Yield what a spec asks about and none of these scopes covers, but for properties of rows."""
    for scope in dict.fromkeys(question.scope for question in questions(spec)):
        if not any(covering.covers(scope, spec.values) for covering in scopes):
            yield scope


def asked_scope(spec: Spec, *, at_random: bool = False) -> Scope:
    """All that [for_all] and the channels of a spec name; at_random: what is at random there, in
    place of any order."""
    table = spec.for_all
    varied = {axis.path: axis.choices for axis in table.changing}
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
    messages: tuple[Messages, ...] = ()
    if spec.drawing:
        of_design = messages_of(spec.drawing, spec.values)
        messages = with_texts(of_design, [spec.drawing], {axis.path for axis in table.unknown})
    return Scope(numbers, frames, messages)


def with_texts(
    messages: Iterable[Messages], drawings: Sequence[Drawing], paths: Collection[str]
) -> tuple[Messages, ...]:
    """Messages of channels of some drawings, with the expression of what they may do where it reads
    one of some numbers."""
    channels = {block.name: block for drawing in drawings for block in drawing.channels}
    expanded = []
    for part in messages:
        keys = dict(channels[part.channel].keys)
        texts = {
            name: keys[name].text
            for name in ("late", "lost", *SHARES)
            if any(path_of(number) in paths for number in keys[name].names)
        }
        if part.chances:
            chances = tuple((key, texts.get(key, chance)) for key, chance in part.chances)
            expanded.append(part._replace(chances=chances))
        else:
            texts_of_keys = {name: texts[name] for name in ("late", "lost") if name in texts}
            expanded.append(part if part.in_time else part._replace(**texts_of_keys))
    return tuple(expanded)


def messages_of(drawing: Drawing, values: Mapping[str, Any]) -> tuple[Messages, ...]:
    """What the messages of the channels of a drawing may do with these numbers."""
    numbers = scalars(values)
    messages = []
    for block in drawing.channels:
        keys = dict(block.keys)
        late = int(keys["late"].value(numbers))
        if block.loses_at_random:
            chances = tuple((key, float(keys[key].value(numbers))) for key in SHARES)
            messages.append(Messages(block.name, late, 0, chances))
        else:
            messages.append(Messages(block.name, late, int(keys["lost"].value(numbers))))
    return tuple(messages)


def _frames(spec: Spec, order: Order, varied: Mapping[str, Sequence[float]]) -> Frames:
    """The frames of a spec; varied: path -> values of the numbers that change from frame to
    frame."""
    values = spec.values
    if not spec.drawing:
        lengths = varied.get(RATIO, (values[RATIO],) if RATIO in keys_of_page(values) else ())
        own_delay = WITH_FRAME if spec.delay_of_frame else values[DELAY]
        delays = varied.get(DELAY, (own_delay,))
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
    claimed = required(spec)
    listed = []
    table = spec.for_all
    if spec.tick:
        tick = Tick(*spec.tick.interval(spec.tick_hz))
        listed.append(Question(claimed, replace(own_scope(spec), tick=tick)))
    elif not table:
        listed.append(Question(claimed, own_scope(spec)))
    else:
        alone = table.loss or (spec.drawing and spec.drawing.at_random)
        at_random = table.at_random or alone
        if not alone:  # of chances alone more than stability is asked
            listed.append(Question(STABLE if at_random else claimed, asked_scope(spec)))
        if at_random:
            scope = asked_scope(spec, at_random=True)
            listed.append(Question(MEAN_SQUARE, scope))
            if spec.require:
                listed.append(Question(claimed, scope))
    if spec.contact:
        scope = listed[0].scope
        listed += [Question(AT_REST, replace(scope, walls=curve)) for curve in _curves(spec)]
    return listed


def _curves(spec: Spec) -> list[str]:
    """The curves through which [sweep] contact asks: of the wall, and of blocks that saturate."""
    curves = [PUSHES] if spec.wall else []
    if spec.drawing:
        curves += [curve_of(block.name) for block in spec.drawing.blocks if block.type == CURVED]
    return curves


def asks_more(spec: Spec) -> bool:
    """Whether a spec asks for more than that its own loop is stable."""
    return questions(spec) != [Question(STABLE, own_scope(spec))]


def answer(question: Question, claims: Iterable[Claim], design: Mapping[str, Any]) -> Claim:
    """What is known of all that a question is about; design: the spec's own values.

    One loop of the scope that is refuted refutes it. What only covers a part of it is no answer.
    """
    scope = question.scope
    refuting = []
    proving = []
    partial = []
    for claim in claims:
        about = claim.what == question.what
        instead = claim.what == STABLE and question.what != MEAN_SQUARE
        if claim.status is Status.REFUTED and (about or instead):
            if scope.covers(claim.scope, design):
                refuting.append(claim)
        elif about and claim.scope.covers(scope, design):
            proving.append(claim)
        elif about:
            partial.append(claim)
    if refuting:
        reason = next((claim.reason for claim in refuting if claim.reason), "")
        return Claim(question.what, scope, Status.REFUTED, reason)
    if proving:
        best = max(proving, key=lambda claim: claim.status)
        return Claim(question.what, scope, best.status, best.reason)
    shown = max(partial, key=lambda claim: claim.status, default=None)
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
        return Verdict(tuple(answer(question, claims, spec.values) for question in questions(spec)))

    @property
    def worst(self) -> Claim:
        """The answer that decides: one that is no, then one that is not known."""
        return min(self.answers, key=lambda claim: claim.status)

    @property
    def status(self) -> Status:
        """How all of it is known."""
        return self.worst.status
