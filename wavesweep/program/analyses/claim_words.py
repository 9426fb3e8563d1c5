"""The words of claims: of which loops one is, how it is known, and what it says of rows and
figures.

What covers what, and whether claims answer what a spec asks, is in `claims`, which knows no words.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from math import lcm
from typing import Any, NamedTuple

from wavesweep.engine.drawing import name_of
from wavesweep.program.analyses.claims import (
    LINEAR,
    OPERATOR,
    PASSIVE_HANDS,
    PUSHES,
    STABLE,
    Claim,
    Frames,
    Messages,
    Order,
    Property,
    Range,
    Scope,
    Status,
    Tick,
    Verdict,
    curve_of,
)
from wavesweep.program.number_words import WIDEST, in_all_digits, span_in_words

# the same where some of them fails: "not stable with every passive hand" reads as with none
ALL_OF = {
    PUSHES: "all walls up to K_VE, B_VE that push and never pull",
    PASSIVE_HANDS: "all passive hands",
}
CURVED_BLOCK = curve_of("")  # behind the name of a block
LINEAR_LOOP = (
    "All else is as the spec writes it, in a linear loop that is sampled and held at its rates, "
    "without friction and the steps of an encoder"
)
OWN_NUMBERS = "with the spec's own numbers"
PLAIN_FRACTION = 100  # the largest denominator of a probability that is written as a fraction
SPELLED = ("two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
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


def form_of(what: Property) -> Form:
    """The words of the form of a property."""
    short = what.short or what.words
    return Form(*(text.format(words=what.words, short=short) for text in FORMS[what.form]))


def value_with(what: Property, name: str) -> str:
    """A value of a number with which a property holds: "stable K_VE"."""
    words = form_of(what).of_values
    after = words.startswith(("with ", "at "))
    if after:
        return f"{name} {words}"
    return f"{words} {name}"


# What a scope is about.


def listed_values(values: Iterable[float | str]) -> str:
    """Some values in words: in order, those of long lists by their number and ends."""
    texts = [value for value in values if isinstance(value, str)]
    numbers = sorted(value for value in values if not isinstance(value, str))
    if len(numbers) > 6:
        whole = numbers == list(range(int(numbers[0]), int(numbers[-1]) + 1))
        count = "" if whole else f"{len(numbers)} values from "
        ends = f"{in_all_digits(numbers[0])} to {in_all_digits(numbers[-1])}"
        return ", ".join([f"{count}{ends}", *texts])
    return ", ".join([*map(in_all_digits, numbers), *texts])


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


def lost_in_words(longest: int | str) -> str:
    """What may be lost so many times in a row at most, in words; a text is an expression of
    numbers that are swept."""
    if isinstance(longest, str):
        return f"lost, up to {longest} in a row"
    first_not = longest + 1
    words = dict(zip(range(2, 11), SPELLED, strict=True))
    return f"lost, never {words.get(first_not, first_not)} in a row"


def frames_in_words(frames: Frames) -> Iterator[str]:
    """Yield what there is beside frames of one length."""
    order = " in any order" if frames.order is Order.ANY else ""
    lengths = listed_values(frames.lengths)
    delays = listed_values(frames.delays)
    after = in_frames = ""
    if frames.order is Order.AT_RANDOM:
        order = " at random"
        lengths, after = _weighted_by_length(
            frames, frames.lengths, frames.chances.lengths, "after"
        )
        chances_of_lengths = [_shares(row[:-1]) for row in frames.chances.results]
        delays, in_frames = _weighted_by_length(
            frames, frames.delays, chances_of_lengths, "in frames of"
        )
    if len(frames.lengths) > 1:
        yield f"frames of {lengths} ticks{order}{after}"
    if len(frames.delays) > 1:
        yield f"results {delays} ticks late{order}{in_frames}"
    if frames.lost:
        yield f"results {lost_in_words(frames.lost)}"
    if frames.loss:
        yield f"results lost with probability {in_all_digits(frames.loss)}"


def _weighted_by_length(
    frames: Frames,
    values: Iterable[float | str],
    rows: Sequence[Sequence[float]],
    where: str,
) -> tuple[str, str]:
    """Values with their probabilities, and if these depend on the lengths which are where."""
    values = list(values)
    if len(values) < 2 and len(rows) < 2:
        return "", ""
    if len(rows) < 2:
        return weighted(values, *rows or ((),)), ""
    texts_of_lengths = (
        f"{where} {length:g}: {weighted(values, row)}"
        for length, row in zip(sorted(frames.lengths), rows, strict=False)
    )
    return listed_values(values), f" ({'; '.join(texts_of_lengths)})"


def _shares(row: Sequence[float]) -> list[float]:
    """Probabilities of what is not lost, with a sum of 1."""
    return [chance / (sum(row) or 1.0) for chance in row]


def range_in_words(number: Range) -> str:
    """A number that is constant, and its values: a list may be read as one of values in turn."""
    name = name_of(number.path)
    if len(number.values) == 1:
        return f"{name} = {in_all_digits(number.values[0])}"
    if number.values:
        return f"{name} of {listed_values(number.values)} (each for ever)"
    if number.low is None or number.high is None:
        return f"any {name}"
    return f"{name} from {span_in_words(number.low, number.high)}"


def messages_in_words(messages: Messages) -> str:
    """What the messages of a channel may do that are not all in time."""
    said = []
    if messages.late:
        said.append(f"late by up to {messages.late} tick{'s' * (messages.late != 1)}")
    if messages.chances:
        said.append(_losses_in_words(messages))
    elif messages.lost:
        said.append(lost_in_words(messages.lost))
    return f"messages of {messages.channel} {' or '.join(said)}"


def _losses_in_words(messages: Messages) -> str:
    chances = {
        key: chance if isinstance(chance, str) else in_all_digits(chance)
        for key, chance in messages.chances
    }
    said = f"lost with probability {chances['loss']}"
    if chances["burst"] == "0":
        return said
    begins = f"begun with {chances['burst']}, ended with {chances['burst_end']}"
    return f"{said}, {chances['burst_loss']} in bursts ({begins})"


def ticks_in_words(tick: Tick | None) -> Iterator[str]:
    """Yield which ticks these are, if they are not all alike."""
    if tick and tick.low < tick.high:
        yield f"ticks of {span_in_words(1e3 * tick.low, 1e3 * tick.high)} ms in any order"


def loops_in_words(scope: Scope) -> str:
    """The numbers, frames and messages of a scope; empty of the spec's own."""
    if scope.run:
        return scope.run
    said = [range_in_words(part) for part in scope.numbers]
    said += frames_in_words(scope.frames)
    said += [messages_in_words(part) for part in scope.messages if not part.in_time]
    if in_time := [part.channel for part in scope.messages if part.in_time]:
        said.append(f"messages of {' and '.join(in_time)} all in time")
    said += ticks_in_words(scope.tick)
    return ", ".join(said)


def _loops_of_a_line(scope: Scope) -> str:
    """The same for a line: in place of a longer text the tables that have it are named."""
    loops = loops_in_words(scope)
    # Letters of the loops of a line, beyond which it names their tables.
    if len(loops) <= 76 or scope.run:
        return loops
    late = [messages for messages in scope.messages if not messages.in_time]
    tables = []
    if scope.numbers or scope.tick or [*frames_in_words(scope.frames)]:
        at_random = scope.frames.order is Order.AT_RANDOM
        tables.append(f"all of [for_all]{', at random by its shares' if at_random else ''}")
    # Nothing else names the channels and their chances.
    tables += [messages_in_words(messages) for messages in late if messages.chances]
    if patterns := [messages.channel for messages in late if not messages.chances]:
        tables.append(f"all patterns of late and lost messages of {', '.join(patterns)}")
    return " and ".join(tables)


def scope_in_words(scope: Scope, *, whole: bool = False) -> str:
    """The loops of a scope, beside the spec's own numbers; empty if there are none. whole:
    however long they are."""
    loops = loops_in_words(scope) if whole else _loops_of_a_line(scope)
    words = [f"{'with' if scope.run else 'for'} {loops}"] if loops else []
    if scope.hands != OPERATOR:
        words.append(f"with {scope.hands}")
    if scope.walls != LINEAR:
        words.append(f"with {scope.walls}")
    return " ".join(words)


def all_of_scope(scope: Scope) -> str:
    """The same of what some of the loops do not have: "not stable for all of these"."""
    if not scope.several or scope.run:
        return scope_in_words(scope)
    said = [loops.removeprefix("all ")] if (loops := _loops_of_a_line(scope)) else []
    if scope.hands != OPERATOR:
        said.append(ALL_OF.get(scope.hands, scope.hands))
    if scope.walls.endswith(CURVED_BLOCK):
        block = scope.walls.removesuffix(CURVED_BLOCK)
        said.append(f"all curves of slopes from 0 to 1 in the place of {block}")
    elif scope.walls != LINEAR:
        said.append(ALL_OF.get(scope.walls, scope.walls))
    return f"for all {' and '.join(said).removeprefix('all ')}"


def own_in_words(scope: Scope) -> str:
    """The spec's own numbers, with the length of their frames."""
    lengths = [length for length in scope.frames.lengths if not isinstance(length, str)]
    frames = f", frames of {lengths[0]:.6g} ticks" if len(lengths) == 1 else ""
    return f"{OWN_NUMBERS}{frames}"


def walls_in_words(scope: Scope) -> str:
    """What takes the place of the linear loop."""
    if scope.walls == LINEAR:
        return LINEAR_LOOP
    return f"With {scope.walls}: any function of its input with slopes from 0 to 1"


# A claim as a sentence.


def in_words(claim: Claim) -> str:
    """A claim as a sentence without a subject."""
    loops = scope_in_words(claim.scope)
    about = f" {loops}" if loops else ""
    because = f": {claim.reason}" if claim.reason else ""
    words = form_of(claim.what)
    match claim.status:
        case Status.REFUTED:
            return f"{failed(claim)}{because}"
        case Status.UNKNOWN:
            return f"not known {words.question}{about}{because}"
        case Status.PROVED:
            return f"{words.proved}{about}{claim.reason and f', {claim.reason}'}"
        case Status.COMPUTED:
            return f"{words.holds}{about}, {IN_DOUBLES}"
    return f"{words.holds}{about}, {vouched_for(claim)}"


def failed(claim: Claim) -> str:
    """That some of the loops do not have it."""
    return f"{form_of(claim.what).fails} {all_of_scope(claim.scope)}".rstrip()


def brief(claim: Claim) -> str:
    """A claim in a few words, without its loops, its reason, and what is required."""
    words = form_of(claim.what)
    if claim.status is Status.UNKNOWN:
        required = "," in words.question
        if required:
            return "not known"
        return f"not known {words.question}"
    said = {Status.REFUTED: words.fails, Status.PROVED: words.proved}
    some = " for all of these" if claim.status is Status.REFUTED and claim.scope.several else ""
    return said.get(claim.status, words.holds).partition(",")[0] + some


def claimed(claim: Claim) -> str:
    """What is claimed and of which loops, whatever is known of it."""
    return f"{form_of(claim.what).holds} {scope_in_words(claim.scope) or own_in_words(claim.scope)}"


def as_json(claim: Claim) -> dict[str, Any]:
    """A claim as JSON has it."""
    words = {"what": form_of(claim.what).holds, "answer": claim.status.answer}
    how_known = {"status": claim.status.name.lower(), "reason": claim.reason}
    loops = {"loops": loops_in_words(claim.scope), "scope": claim.scope.written()}
    return words | how_known | loops


def fact_of(claim: Claim) -> dict[str, Any]:
    """A claim as a fact of a table, which `Claim.read` reads."""
    return {**as_json(claim), "said": claimed(claim), "property": claim.what._asdict()}


def verdict_lines(verdict: Verdict, subject: str) -> Iterator[str]:
    """Yield a verdict in a line that begins with its subject, and the answers of several that this
    does not say in full."""
    told = verdict.answers
    if verdict.status <= Status.UNKNOWN:
        told = (verdict.worst,)
    whole = f"{subject}: {'; '.join(map(in_words, told))}"
    first = whole
    if len(first) > WIDEST and len(verdict.answers) > 1:
        without_reasons = "; ".join(in_words(replace(claim, reason="")) for claim in told)
        first = f"{subject}: {without_reasons}"
    if len(first) > WIDEST and len(verdict.answers) > 1:
        first = f"{subject}: {'; '.join(map(brief, told))}"
    yield first
    for claim in verdict.answers:
        if first != whole or claim not in told:
            yield f"  {in_words(claim)}"


def known_in_words(claims: Iterable[Claim]) -> str:
    """What is claimed, and how that is known, in sentences."""
    sentences = []
    for claim in claims:
        sentence = f"{claimed(claim)}: {HOW_KNOWN[claim.status]}."
        sentences.append(f"{sentence[:1].upper()}{sentence[1:]}")
    return " ".join(dict.fromkeys(sentences))


def beyond_the_ends(claims: Iterable[Claim]) -> str:
    """What is refuted of values beyond the ends of rows, in a sentence; a requirement of the spec's own
    loop is refuted by what is not stable."""
    refuted = []
    for claim in claims:
        own_requirement = claim.what.required and claim.status is not Status.PROVED
        what = STABLE if own_requirement else claim.what
        of_design = "" if scope_in_words(claim.scope) else f" {own_in_words(claim.scope)}"
        refuted.append(f"{failed(replace(claim, what=what))}{of_design}")
    return f"By what each line names: {'; '.join(dict.fromkeys(refuted))}."


# What rows say by a claim.


def vouched_for(claim: Claim) -> str:
    """What rows are that are known as a claim says."""
    return SAMPLED if claim.status is Status.CHECKED else "certified"


def doubted_as(claim: Claim) -> str:
    """What the other rows are."""
    return "not known" if claim.status is Status.CHECKED else "not certified"


def value_of_rows(claim: Claim, name: str) -> str:
    """A value of a number that the rows have."""
    if claim.status is Status.PROVED:
        return f"proved {name}"
    return value_with(claim.what, name)


def everywhere(claim: Claim) -> str:
    """What the rows say of all values up to one."""
    if claim.status is Status.PROVED:
        return "proved"
    return form_of(claim.what).of_values


def no_value(claim: Claim, name: str, reason: str, *, undecided: bool) -> str:
    """That no value of a number in the swept range has it; undecided: whether some may."""
    because = f": {reason}" if reason else ""
    if undecided:
        sentence = f"no {value_of_rows(claim, name)} found"
        more = f"; {reason}" if reason else ""
        return f"{sentence}, but part of the swept range is not known{more}"
    return f"no {value_with(claim.what, name)} anywhere in the swept range{because}"


def of_intervals(claim: Claim, *, some: bool) -> str:
    """How intervals are known of which no row is in doubt; some: whether there are any."""
    if not some:
        return f"Certified: {form_of(claim.what).nowhere} in the range."
    if claim.status is Status.CERTIFIED and claim.what == STABLE:
        return "Certified: of the range every value in an interval is stable, and no other one."
    return f"The intervals are {vouched_for(claim)}."


def extreme(claim: Claim, figure: str, rows: str, *, certified: bool) -> str:
    """What the largest value of a figure is.

    figure: "largest", or another word for it. rows: the name of its rows, empty if there are no
    others. certified: whether it has to be said that it is, since others are not.
    """
    if claim.status is Status.PROVED:
        return f"{figure} {rows}".rstrip()
    comma = "," if " " in figure + vouched_for(claim) else ""
    how_known = f"{comma} {vouched_for(claim)}" if certified else ""
    return figure + how_known + (f", {rows}" if rows else "")


def nothing(claim: Claim, *, certain: bool) -> str:
    """That a line of a figure has no interval; certain: whether that is certain."""
    if certain:
        return form_of(claim.what).nowhere
    if claim.status is Status.PROVED:
        return "nothing proved"
    adjective = "as required" if claim.what.required else form_of(claim.what).of_values
    return f"nothing known to be {adjective}"


def unless(claim: Claim, *, certain: bool) -> str:
    """What is added to a bound of a row of which that is not known; nothing to one that is."""
    return "" if certain else f", {doubted_as(claim)}"
