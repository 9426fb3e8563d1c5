"""Intervals of loops whose frames vary in any order, by what [for_all] says of their lengths,
delays and lost results, or whose messages may be late or lost, by what their channels say."""

import logging
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np

from wavesweep.engine.drawing import Drawing, name_of, without_rule
from wavesweep.engine.errors import SpecError
from wavesweep.engine.intervals import Resolution
from wavesweep.engine.intervals import Side as Expressed
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Side, Sides
from wavesweep.engine.switched import (
    FROM_ZERO,
    OPERATIONS_OF_PROOFS,
    Bracket,
    Chances,
    Family,
    Growth,
    LoopFrames,
    LoopsOver,
    OnAverage,
    Refuted,
    Symbol,
    Verdict,
    Word,
    bracket,
    bracket_over,
    corners_of,
    decays,
    decide,
    decide_over,
    growing_of,
    is_refuted,
    joined,
    short_words,
)
from wavesweep.for_all import message_patterns
from wavesweep.for_all.asked_ranges import ForAllRanges
from wavesweep.for_all.channel_families import (
    Sent,
    members_with_messages,
    messages_over,
)
from wavesweep.for_all.frame_families import (
    DELAY,
    IN_PHASE,
    RATIO,
    RULED,
    FramesInAnyOrder,
    SlowFrames,
    drawing_of_controller,
    plan_of,
    refuse,
)
from wavesweep.for_all.mean_square import (
    Losses,
    chain_of,
    chances,
    frames_at_random,
    losses_at_random,
)
from wavesweep.for_all.message_rings import RingFrames, frames_of_messages, gain_over
from wavesweep.for_all.plan import ANY_NUMBER, FRAME, LOST, Plan
from wavesweep.for_all.ring_search import BY_GAIN, bracket_ring, decide_ring
from wavesweep.for_all.unknown import SO_FAR
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.program.reading.tables import TableValue
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.tables.refuters import Refuter

STARTS = (0.05, 0.01, 0.2, 0.002, 0.5)  # of an interval of the nominal loop, where a proof is begun
KIND = "controller.kind"
# what a proof has reached, which a command shows
PROOF_LOGGER = logging.getLogger("wavesweep.proof")
ON_THE_WAY = "%s proved from %.4g to %.4g so far (%.0f %% of the way)"
GROW = "second moments that grow"  # of what happens at random, in place of a pattern


@dataclass(frozen=True, slots=True)
class Rules:
    """How a spec says that its frames vary.

    drawing: that of a spec that draws its loop, None for a built-in controller. with_frame: whether
    results are in place with the next frame. elapsed: whether the slow environment integrates over
    the time since its last frame. messages: whether the loop has channels; at_random: whether these
    lose messages at random, or frames and results are taken to be at random. require: margins that all
    loops have to have, see `at_cut`. work: operations of a
    proof over ranges beside what varies; begins: share of the number that it reaches, down to which
    it goes. said: words before what a proof has reached. words: that refuted earlier loops of a
    search for designs, for each rule of which frames may follow which; None where each loop is looked
    at for itself.
    """

    for_all: ForAllRanges
    drawing: Drawing | None = field(default=None, repr=False)
    with_frame: bool = False
    elapsed: bool = True
    messages: bool = False
    at_random: bool = False
    require: TableValue | None = field(default=None, repr=False)
    work: float = OPERATIONS_OF_PROOFS
    begins: float = 0.0
    said: str = ""
    words: defaultdict[bytes, list[Word]] | None = field(default=None, repr=False, compare=False)

    @staticmethod
    def of(spec: Spec) -> "Rules":
        """The rules of a spec with [for_all]."""
        drawing = spec.drawing
        for_all = spec.for_all
        own_delays = any(axis.path == DELAY for axis in for_all.axes)
        return Rules(
            for_all,
            drawing,
            with_frame=spec.delay_of_frame and not own_delays,
            elapsed=spec.step == "elapsed",
            messages=bool(drawing and drawing.channels),
            at_random=bool(for_all.loss or (drawing and drawing.at_random)),
        )

    def drawing_of(self, values: Mapping[str, object], gains: Sequence[str]) -> Drawing:
        """The drawing of the spec, or that of its built-in controller with these values; gains:
        see `loop_drawing`."""
        return self.drawing or loop_drawing(values, gains)

    def on_average(self) -> "Rules | None":
        """The rules of frames at random, beside those in any order; None if a spec does not say
        how often what occurs."""
        if self.at_random or not self.for_all.at_random:
            return None
        return replace(self, at_random=True)

    @property
    def ranges(self) -> bool:
        """Whether some numbers have ranges beside what varies."""
        return any(not axis.choices for axis in self.for_all.unknown)

    @property
    def vary(self) -> bool:
        """Whether anything varies."""
        for_all = self.for_all
        return bool(for_all.changing or for_all.lost or for_all.loss or self.messages)

    def family(self, values: Mapping[str, object], along: str) -> LoopFrames | RingFrames | Chances:
        """The frames of a loop along a number, empty for the loop at its own values.

        values: all of a spec, by their paths. Errors: UsageError for numbers that cannot vary, or
        another one along.
        """
        for_all = self.for_all
        if self.messages and not (self.at_random and for_all.shares):
            if for_all.changing:
                text_found = ", ".join(without_rule(self.drawing.channels))
                expected = f"blocks {RULED} beside channels, or both frames (shares) and messages (loss, burst) at random"
                refuse(self._key(for_all.changing[0]), expected, text_found)
            if self.at_random:
                return chances(self.drawing, values, along)
            return frames_of_messages(self.drawing, values, along)
        frames = self.plan(values, (along,)).along(along)
        if not self.at_random:
            return frames
        shares, results = self.chances
        return frames_at_random(frames, shares, results, along, self.losses(values))

    def families(
        self,
        values: Mapping[str, object],
        along: str,
        columns: Mapping[str, np.ndarray],
        size: int,
    ) -> list[LoopFrames]:
        """The `family` of each of several loops, of frames that are not at random; columns: see
        `Plan.along_each`."""
        if self.messages:
            alone = [
                {path: column[index] for path, column in columns.items()} for index in range(size)
            ]
            return [self.family({**values, **of_loop}, along) for of_loop in alone]
        return self.plan(values, (along,)).along_each(along, columns, size)

    @property
    def chances(self) -> tuple[tuple[tuple[float, ...], ...], ...]:
        """The probabilities of lengths of frames and of results that a proof takes, see
        `chain_of`."""
        return self.for_all.lengths, self.for_all.results

    def losses(self, values: Mapping[str, object]) -> dict[str, Losses]:
        """The probabilities of the channels that a proof takes; none of a loop without these."""
        if self.messages and self.drawing:
            return losses_at_random(self.drawing, values)
        return {}

    def plan(self, values: Mapping[str, object], gains: Sequence[str] = ()) -> Plan:
        """What the frames of a loop without channels consist of; gains: numbers that count as other
        than 0.

        values: all of a spec, by their paths. Errors: SpecError, whose mistakes have no places; see
        `placed`.
        """
        if self.drawing:
            return self._plan_of_drawing(values)
        return self._plan_of_page(values, gains)

    def _plan_of_page(self, values: Mapping[str, object], gains: Sequence[str]) -> Plan:
        """The plan of the page of a built-in controller."""
        drawing = drawing_of_controller(values, gains)
        varying = {axis.path: axis for axis in self.for_all.changing}
        if values[RATIO] % 1:
            slow_hz = values["rates.fast_hz"] / values[RATIO]
            below = math.floor(values[RATIO])
            expected = "a rate that divides rates.fast_hz beside frames, delays or losses that vary: rates.ratio, the ticks in "
            expected += f"a frame, such as {below} or {below + 1}"
            refuse("rates.slow_hz", expected, f"{slow_hz:g} Hz, {values[RATIO]:.6g} ticks")
        if RATIO in varying:
            lengths = varying[RATIO].choices
        else:
            lengths = (values[RATIO],)
        slow = SlowFrames.of(drawing, values, RATIO, lengths)
        if self.vary and not slow.names:
            expected = "a controller with a slow environment, whose frames may vary"
            refuse(KIND, expected, values[KIND])
        delays = (FRAME if self.with_frame else values[DELAY],)
        if DELAY in varying:
            delays = tuple(varying[DELAY].choices)
        lost = ANY_NUMBER if self.for_all.loss else self.for_all.lost
        frames = FramesInAnyOrder(slow.lengths, delays, lost, self.elapsed)
        return plan_of(drawing, values, frames, slow)

    def _plan_of_drawing(self, values: Mapping[str, object]) -> Plan:
        """The plan of a drawn loop, in which one number at most varies, that `every` of blocks
        reads."""
        varying = self.for_all.changing
        slow = SlowFrames.of(self.drawing, values)
        if varying:
            axis = varying[0]
            slow = SlowFrames.of(self.drawing, values, axis.path, axis.choices)
        channels = self.drawing.channels
        for block in channels:
            if block.name not in slow.names or dict(block.keys)["missing"] == "zero":
                expected = 'channels that run once a frame and hold the last message (missing = "held") beside frames at random'
                refuse(f"block.{block.name}", expected, "another")
        frames = FramesInAnyOrder(slow.lengths, IN_PHASE, 0, self.elapsed)
        names = frozenset(block.name for block in channels)
        return plan_of(self.drawing, values, frames, slow, names)

    @staticmethod
    def _key(axis: Axis) -> str:
        """The key of a number of [for_all]."""
        return f"for_all.{axis.name}"


@contextmanager
def placed(spec: Spec) -> Iterator[None]:
    """Let mistakes of a plan have their places in the spec that they are of."""
    places = {f"for_all.{axis.name}": axis.place for axis in spec.for_all.axes}
    try:
        yield
    except SpecError as error:
        facts = [(mistake.key, mistake.expected, mistake.found) for mistake in error.mistakes]
        raise SpecError(
            places.get(place_and_texts[0], spec).mistake(*place_and_texts)
            for place_and_texts in facts
        ) from None


def _shown(text: str, number: str) -> Callable[[float, float, float], None]:
    """Return what tells how far a number is proved: a range that never shrinks, and a share."""
    ends: list[float] = []

    def report(low: float, high: float, share: float) -> None:
        ends.extend((low, high))
        PROOF_LOGGER.info(text, number, min(ends), max(ends), share)

    return report


def bracketed(
    family: LoopFrames,
    along: str,
    span: tuple[float, float],
    about: tuple[float, float],
    value: float,
) -> Bracket | None:
    """What is proved and refuted about an interval of the nominal loop along a number; None if no
    start of a proof is found. value: see `bracket_ring`."""
    low, high = about
    report = _shown(ON_THE_WAY, name_of(along))
    if isinstance(family, RingFrames):
        return bracket_ring(family, about, report=report, value=value)
    for share in STARTS:
        bracket_found = bracket(family, low + share * (high - low), span, report=report)
        if np.isfinite(bracket_found.low):
            return bracket_found
    return None


def told(found: Bracket, family: Callable[[tuple[float, ...]], Family]) -> Bracket:
    """A bracket with the texts of its patterns. family: of the loops at a point of their box."""
    ends = []
    for end in (found.below, found.above):
        text = text_of_pattern(family(end.point), end.word) if end.word else ""
        ends.append(replace(end, text=text))
    return replace(found, below=ends[0], above=ends[1])


def bracketed_over(
    rules: Rules,
    values: Mapping[str, object],
    along: str,
    ranges: Sequence[Axis],
    span: tuple[float, float],
    about: tuple[float, float],
    value: float = np.nan,
) -> Bracket | None:
    """What is proved and refuted about an interval for all numbers of some ranges, if there are
    any; None if no start of a proof is found. value: see `bracket_ring`."""
    family = None if ranges else rules.family(values, along)
    if family is not None and not rules.at_random and family.drift is None:
        bracket = bracketed(family, along, span, about, value)
        return bracket and told(bracket, lambda _: family)
    # Numbers in a box, or a drift that depends on the number along which the interval is.
    loops = _over(rules, values, along, ranges, span)
    low, high = about
    report = _shown(SO_FAR, rules.said + name_of(along))
    for share in STARTS:
        start = low + share * (high - low)
        bracket_found = bracket_over(loops, start, span, rules.work, rules.begins, report)
        if np.isfinite(bracket_found.low):
            return told(bracket_found, loops.family)
    return None


def _chain(rules, values, symbols):
    """The chain of the frames at random, and of what is lost in them."""
    lost = losses_at_random(rules.drawing, values) if rules.messages else {}
    return chain_of(rules.for_all.lengths, rules.for_all.results, symbols, lost=lost)


def _over(rules, values, along, ranges, span=(0.0, 0.0)) -> LoopsOver:
    """The loops of a box of ranges, along a number or at their own values."""
    paths = [axis.path for axis in ranges]
    box = np.array([[axis.start for axis in ranges], [axis.stop for axis in ranges]], float)
    # Of channels beside frames of one length, steps of messages are what differs, otherwise frames.
    steps = rules.messages and not rules.for_all.changing
    plan = None if steps else rules.plan(values, (along, *paths))
    loop_of_plan = (plan.drawing, plan.values) if plan else (rules.drawing, values)
    sides = Sides.of(Loops(*loop_of_plan), paths, box)
    whole = box
    if along:
        zero = min(0.0, span[0])
        low = max(span[0], zero + FROM_ZERO * (span[1] - zero))
        sides = Sides([Side(along, zero), *sides])
        whole = np.column_stack([[low, span[1]], box])
    whole = sides.places(whole)
    numbers = [side.path for side in sides]
    bounds = sides.numbers(whole)

    @cache
    def family(point):
        return rules.family({**values, **dict(zip(paths, point, strict=True))}, along)

    gain = None
    if plan:
        frames = plan.over(sides, whole)
        members = plan.members(numbers, bounds)
    elif isinstance(family(tuple(box.mean(0).tolist())), RingFrames):
        gain = gain_over(*loop_of_plan, sides, whole)
        frames = gain.over(sides)
    else:
        frames = messages_over(*loop_of_plan, sides, whole)
        members = members_with_messages(*loop_of_plan, numbers, bounds)

    @cache
    def extremes():
        return Resolution(*loop_of_plan, list(map(Expressed, paths))).extremes(box)

    spec_numbers = [[float(values[path]) for path in paths]]
    starts = np.concatenate([np.clip(spec_numbers, *box), corners_of(box)])
    loops = partial(LoopsOver, family, box=box, sides=sides, starts=starts, extremes=extremes)
    if gain is not None:
        return loops(
            frames,
            growth=Growth.of_loops(Loops(*loop_of_plan), numbers),
            gain=gain,
            patterns=message_patterns,
        )
    refuters = [] if rules.words is None else rules.words[members.follows.tobytes()]
    loops = partial(loops, known=refuters)
    if not rules.at_random:
        words = joined(members.follows)
        growth = Growth.in_words(members.at, members.states, members.follows)
        return loops(frames.of_words(words), words=words, growth=growth)
    if steps:
        middle = family(tuple(box.mean(0).tolist()))
        on_average = OnAverage(middle.graph, middle.weights(0.0, 0.0)[0])
    else:
        on_average = OnAverage(*_chain(rules, values, frames.symbols))
    growth = Growth.on_average(members.at, members.states, on_average.graph, on_average.weight)
    return loops(frames, growth=growth, on_average=on_average)


def decided_over(
    rules: Rules,
    values: Mapping[str, object],
    ranges: Sequence[Axis],
    work: float | None = None,
) -> tuple[str, dict[str, float | None]]:
    """Whether a loop is stable for all numbers of some ranges, if there are any, and every order of
    frames, and what it is not stable with, or by what it is proved if not by norms.

    work: operations after which no more is tried.
    """
    if not ranges:
        family = rules.family(values, "")
        if isinstance(family, Chances):
            verdict = decays(family)
            return verdict, {GROW if verdict == Verdict.REFUTED else "": None}
        decide_one = decide_ring if isinstance(family, RingFrames) else decide
        decision = decide_one(family, **({"work": work} if work else {}))
        return decision.verdict, {decision.by or text_of_pattern(family, decision.word): None}
    loops = _over(rules, values, "", ranges)
    point, word, proved = decide_over(loops, work or OPERATIONS_OF_PROOFS)
    if word:
        by = dict(zip((axis.path for axis in ranges), point, strict=False))
        return Verdict.REFUTED, {**by, text_of_pattern(loops.family(point), word): None}
    said = ""
    if loops.gain:
        said = BY_GAIN if proved else "no small gain proves it, and no pattern that was met grows"
    return Verdict.PROVED if proved else Verdict.UNKNOWN, {said: None} if said else {}


def decided_along(
    rules: Rules,
    values: Mapping[str, object],
    along: str,
    ranges: Sequence[Axis],
    value: float,
    found: Bracket | None,
) -> tuple[str, dict[str, float | None]]:
    """`decided_over` at a value of a number, by what is found about an interval along it: its proof
    and the patterns of its ends; or by a short pattern: a long one may grow next to its end alone."""
    if found is not None and found.low <= value <= found.high:
        return Verdict.PROVED, {}
    ends = [end for end in (found.below, found.above) if end.word] if found else []
    family = None if ranges else rules.family(values, along)
    # Short words of messages may be such as nothing that is held can follow.
    if isinstance(family, LoopFrames) and family.drift is None:
        for word in growing_of(family.at(value), short_words(family.follows)):
            ends.append(Refuted(value, word, text=text_of_pattern(family, word)))
    for end in ends:
        by = dict(zip((axis.path for axis in ranges), end.point, strict=True))
        if is_refuted(rules.family({**values, **by}, along), end.word, value):
            return Verdict.REFUTED, {**by, end.text: None}
    return Verdict.UNKNOWN, {}


def text_of_pattern(family: LoopFrames | Chances, word: tuple[int, ...]) -> str:
    """A pattern of frames, or of messages, or that second moments grow as a text; empty without
    a word."""
    if isinstance(family, Chances):
        return GROW if word else ""
    if not word:
        return ""
    symbols = [family.symbols[index] for index in word]
    ring = isinstance(family, RingFrames)
    if ring or isinstance(symbols[0], Sent):
        by_channel = (
            message_patterns.messages_of(family, word) if ring else Sent.by_channel(symbols)
        )
        return str(Refuter(messages=by_channel))
    results = {(symbol.delay, symbol.lost) for symbol in family.symbols}
    several = len(results) > 1
    return str(
        Refuter(frames=[(symbol.ticks, _result(symbol, several=several)) for symbol in symbols])
    )


def _result(symbol: Symbol, *, several: bool) -> str:
    """What becomes of the result of a frame, in words; several: whether results may come after several delays."""
    if symbol.delay == LOST:
        return "lost"
    return f"delay {symbol.delay}" if several else ""
