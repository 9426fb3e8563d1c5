"""When a loop samples and computes, and when its results are in place: a lane for each rate, in the
frames that may occur.

What is shown of a rate is the oldest of the numbers whose way from the measurement to a force goes
through a block of this rate and through none that is slower. Where frames, delays and messages
vary, the shortest and the longest of them are shown: no order of them makes a number older than the
longest frames one after the other, each with the latest message.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.picture.ages import Ages, DataFlow, Life
from wavesweep.program.analyses.claims import DELAY
from wavesweep.program.number_words import in_time, rounded_up
from wavesweep.program.spec import Spec

# ages of all numbers in all signals, in all ticks of a frame; more would take some 0.2 GB
MOST = 20_000_000
SHORTEST = "shortest frames", "longest frames"
EARLIEST = "earliest results", "latest results"
IN_TIME = "all results in time", "results late or lost"
FRESHEST = "freshest number", "oldest number"
WHERE = MappingProxyType(
    {
        SHORTEST[0]: "in the shortest frames",
        EARLIEST[0]: "with the earliest results",
        IN_TIME[0]: "with all results in time",
        FRESHEST[0]: "at best",
    }
)


@dataclass(frozen=True, slots=True)
class Lane:
    """What passes blocks of one rate.

    every: ticks from one run to the next, on average. signal, block: the oldest number that passes
    them, and the block that gives it. port: of the plant that it acts on. lives: its numbers in one
    frame of the loop, as they follow each other; none if none acts on a plant. runs: the ticks of
    that frame in which they run.
    """

    every: float
    signal: str
    block: str
    port: str
    lives: tuple[Life, ...]
    runs: tuple[int, ...]

    def rate(self, tick_ms: float) -> str:
        """Its rate in words; tick_ms: period (ms) of a tick."""
        hz = 1e3 / (self.every * tick_ms)
        if hz < 1000:
            return f"{hz:.4g} Hz"
        return f"{hz:.6g} Hz"


@dataclass(frozen=True, slots=True)
class Moments:
    """The lanes of a loop, the fastest one first, in one kind of its frames.

    which: of the frames, in words; empty if there are no others. ticks: of the frame after which
    all blocks are in step again. tick_s: period (s) of a tick. loses: whether results may be lost
    at random, so that nothing bounds their age. main: the lane with the oldest number, and shown:
    that number, or the freshest one of this lane; None if none acts on a plant. lost: how many
    ticks longer it stays since those after it are lost.
    """

    which: str
    ticks: int
    tick_s: float
    lanes: tuple[Lane, ...]
    loses: bool
    main: Lane | None = None
    shown: Life | None = None
    lost: float = 0.0

    @property
    def tick_ms(self) -> float:
        """The period (ms) of a tick."""
        return 1e3 * self.tick_s

    @property
    def age(self) -> float | None:
        """The age (ticks) of the number shown when the next one takes its place."""
        if self.shown is None:
            return None
        return self.shown.oldest + self.lost


@lru_cache(maxsize=8)  # lines, facts and the picture are of one spec
def moments(spec: Spec) -> tuple[Moments, ...]:
    """The frames of a spec: that with the oldest number last, in ticks that are as late as they may
    be, and before it that with the freshest one if the two differ."""
    low = {axis.path: min(axis.values or (axis.start, axis.stop)) for axis in spec.changing}
    high = {axis.path: max(axis.values or (axis.start, axis.stop)) for axis in spec.changing}
    sends = spec.drawing is not None and bool(spec.drawing.channels)
    lost = spec.for_all.lost if spec.for_all and not spec.drawing else 0
    varies = bool(low or sends or lost)
    first = last = _in_frames(spec.with_values(low))
    if varies:
        last = _in_frames(spec.with_values(high), late=True, lost=lost)
    if spec.tick:
        shortest, longest = spec.tick.interval(spec.tick_hz)
        first = replace(first, tick_s=shortest)
        last = replace(last, tick_s=longest)
    if first.main is None or last.main is None:
        return (last,)
    freshest = min(first.main.lives, key=lambda life: life.oldest)
    first = replace(first, shown=freshest)
    # Up to this relative difference of two ages one of the frames stands for the other.
    if first.age > (1 - 0.05) * last.age:
        return (last,)
    varying = {
        SHORTEST: bool(low.keys() - {DELAY}),
        EARLIEST: DELAY in low,
        IN_TIME: bool(sends or lost),
    }
    alone = [names for names, vary in varying.items() if vary]
    names = alone[0] if len(alone) == 1 else FRESHEST
    return replace(first, which=names[0]), replace(last, which=names[1])


def _in_frames(spec: Spec, late: bool = False, lost: int = 0) -> Moments:
    """The frames of a spec's own numbers with their oldest number.

    late: whether messages come as late as they may. lost: slow results of a controller in a row
    that never come. Of a drawn loop with late messages the age is that with as many lost in a row as
    may be; the number is shown as it is without losses, and `lost` of `Moments` is the difference.
    """
    drawing = spec.drawing or loop_drawing(spec.values)
    flow = DataFlow.of(drawing, spec.values, late)
    lanes = _lanes(flow)
    at_random = drawing.at_random or bool(spec.for_all and spec.for_all.loss)
    without_force = Moments("", flow.ticks, flow.tick_s, lanes, at_random)
    acting = [lane for lane in lanes if lane.lives]
    if not acting:
        return without_force

    def oldest(lane: Lane) -> float:
        stays = lost * lane.every if lane.every > 1 else 0.0
        return _oldest(lane.lives).oldest + stays

    main = max(acting, key=oldest)
    age = oldest(main)
    if late and spec.drawing:
        with_losses = _lanes(DataFlow.of(drawing, spec.values, late, lost=True))
        worst = max((lane for lane in with_losses if lane.lives), key=oldest)
        age = oldest(worst)
        # The same number as it is without losses.
        main = replace(worst, lives=tuple(Ages(flow).lives(worst.signal, worst.port)))
        lanes = tuple(main if lane.every == main.every else lane for lane in lanes)
    shown = _oldest(main.lives)
    return replace(without_force, lanes=lanes, main=main, shown=shown, lost=age - shown.oldest)


def _oldest(lives: Iterable[Life]) -> Life:
    return max(lives, key=lambda life: life.oldest)


def _lanes(flow: DataFlow) -> tuple[Lane, ...]:
    """The lanes of a loop, a number in that of the slowest block on its way."""
    rates = sorted({carrier.every for carrier in flow.carriers.values()})
    lanes = {}
    for name, carrier in flow.carriers.items():
        empty = Lane(carrier.every, name, carrier.block, "", (), carrier.runs)
        lanes.setdefault(carrier.every, empty)
    if flow.ticks * len(flow.carriers) ** 2 > MOST:
        return tuple(lanes[every] for every in rates)
    up_to = {every: Ages(flow.up_to(every)) for every in rates}
    for name, carrier in flow.carriers.items():
        for port in flow.forces:
            lives = up_to[rates[-1]].lives(name, port)
            if not lives:
                continue
            # The slowest block on its way: blocks up to its rate make the same lives as all.
            slower = (rate for rate in rates if rate >= carrier.every)
            every = next(rate for rate in slower if up_to[rate].lives(name, port) == lives)
            lane = Lane(every, name, carrier.block, port, tuple(lives), carrier.runs)
            before = lanes[every]
            if _rank(lane, carrier.every) > _rank(before, flow.carriers[before.signal].every):
                lanes[every] = lane
    return tuple(lanes[every] for every in rates)


def _rank(lane: Lane, every: float) -> tuple[float, bool, float]:
    """By the oldest number; of those of one age, by whether it is of a block of the lane, and how
    soon it was computed.

    every: ticks from one run of its block to the next.
    """
    if not lane.lives:
        return 0.0, False, 0.0
    oldest = _oldest(lane.lives)
    return round(oldest.oldest, 9), every == lane.every, oldest.measured - oldest.run


def in_ms(time: float) -> str:
    """A time (ms) in words, without its unit."""
    return f"{time:.4g}"


def time_of(time: float) -> str:
    """A time (ms) in words, with its unit."""
    return in_time(time / 1e3, 4)


def title_of(frames: Moments) -> str:
    """Which frames these are, in words."""
    if frames.main is None:
        return f"a frame of {time_of(frames.ticks * frames.tick_ms)}"
    parts = [frames.which] if frames.which else []
    parts.append(f"a result every {time_of(frames.main.every * frames.tick_ms)}")
    if frames.lost:
        parts.append(f"{round(frames.lost / frames.main.every)} lost in a row")
    return ", ".join(parts)


def in_words(frames: Sequence[Moments], force: str = "") -> str:
    """The age of the oldest number that acts on a plant, and when it is in place; empty if none
    acts on one.

    force: what it is called, by default the port of the plant.
    """
    last = frames[-1]
    if last.main is None or last.shown is None or last.age is None:
        return ""
    waits = (last.shown.start - last.shown.measured) * last.tick_ms
    stays = last.age * last.tick_ms - waits
    if waits:
        place = f"in place {time_of(waits)} after it reads"
    else:
        place = "in place at once"
    first = frames[0]
    beside = ""
    if first is not last and first.age is not None:
        beside = f", {time_of(first.age * first.tick_ms)} {WHERE[first.which]}"
    unless = " if none is lost" if last.loses else ""
    old = in_time((waits + stays) / 1e3, 4, rounded_up)
    return (
        f"{force or f'what acts on {last.main.port}'} is computed from samples up to {old} old{unless}{beside} "
        f"({last.main.block}: {place}, held {time_of(stays)})"
    )
