"""What [for_all] and channels mean, from the documents alone: the members of a set, and each marched over a pattern.

A pattern is what happens in turn, again and again: lengths of frames with what becomes of their results, what becomes of the
messages of each channel, or the times of ticks. The march of a pattern is the matrix of all memory over it, once the pattern
has been there for ever.
"""

import math
import re
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

import numpy as np
from meaning import doubles
from meaning.machine import Machine
from meaning.reading import with_numbers
from meaning.specs import PATHS
from scipy.linalg import expm

from wavesweep.checker.reader.controllers import Controller
from wavesweep.checker.reader.drawings import Drawing
from wavesweep.checker.reader.loops import Instant, Schedule

LOST = None  # what becomes of a message or a result that never comes; otherwise ticks
RATIO, DELAY = "rates.ratio", "environment.delay"


@dataclass
class Asked:
    """The table [for_all]: numbers that are not known, as values or as ends, and those that vary, as values."""

    listed: dict[str, list] = field(default_factory=dict)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    varying: dict[str, list] = field(default_factory=dict)
    shares: dict[str, list] = field(default_factory=dict)  # weights of the values of what varies, or rows of them
    next: list | None = None  # weights of lengths after each
    lost: int = 0
    loss: float = 0.0
    tick: tuple[float, float] | None = None
    contact: bool = False


def asked_of(tables: dict) -> Asked:
    found = Asked()
    for name, given in tables.get("for_all", {}).items():
        if name in ("lost", "loss", "contact"):
            setattr(found, name, given)
            continue
        if name == "tick":
            own = 1 / tables.get("rates", {}).get("fast_hz", tables["rates"].get("tick_hz", 1000.0))
            found.tick = (own, own + given["late"]) if "late" in given else (given["start"], given["stop"])
            continue
        path = PATHS.get(name, name)
        values = given.get("values")
        whole = path in (RATIO, DELAY) or (path in tables.get("numbers", {}) and isinstance(tables["numbers"][path], int))
        if values is None and whole:
            values = list(range(given["start"], given["stop"] + 1))
        if given.get("varying"):
            found.varying[path] = values
            if "shares" in given:
                found.shares[path] = given["shares"]
            found.next = given.get("next", found.next)
        elif values is not None:
            found.listed[path] = values
        else:
            found.ranges[path] = (given["start"], given["stop"])
    return found


@dataclass(frozen=True)
class Frame:
    """A frame of so many ticks; its result comes so many ticks after its sample, "frame" with the next one, or is LOST."""

    ticks: int
    delay: object = "frame"


class Walk:
    """Ticks of several kinds, each with what happens between it and the next one."""

    def __init__(self, T: Fraction, kinds: dict, extra: list, motion: Instant):
        """extra: (time after a tick, kind) of what happens between ticks."""
        self.T = T
        self.extra = sorted(extra, key=lambda pair: pair[0])
        self.machine = Machine(Schedule(T, kinds, [], motion))
        self.made: dict[object, np.ndarray] = {}

    def after(self, kind, time: float | None = None) -> np.ndarray:
        """Memory after a tick of a kind and what follows it, up to the next one; time: of the tick, if it is another (s)."""
        if (kind, time) not in self.made:
            matrix = self.machine.solved[kind][0]
            at = Fraction(0)
            for later, between in self.extra:
                matrix = self.machine.solved[between][0] @ self._flow(later - at) @ matrix
                at = later
            flow = self._flow(self.T - at) if time is None else expm(self.machine.generator * (time - float(at)))
            self.made[kind, time] = flow @ matrix
        return self.made[kind, time]

    def _flow(self, duration: Fraction):
        return self.machine._flow(duration)

    @property
    def size(self) -> int:
        return len(self.machine.memory)


class ControllerFrames:
    """Frames of a controller: the slow environment samples at the first tick of each."""

    def __init__(self, tables: dict, asked: Asked, seen=lambda instant: instant):
        """seen: each instant of a tick as it is taken."""
        own = Controller(tables, doubles)
        nominal = int(own.ratio)
        self.elapsed = tables.get("environment", {}).get("step", "elapsed") == "elapsed"
        self.lengths = asked.varying.get(RATIO, [nominal])
        self.delays = asked.varying.get(DELAY, [own.delay])
        self.lost = asked.lost
        self.nominal = nominal
        kinds: dict[object, Instant] = {}
        for step in {nominal, *self.lengths}:
            for at_once in (True, False):
                slow = Controller(tables, doubles)
                slow.Ts = step * own.T
                slow.delay = 0 if at_once else 1
                for pending in (True, False):
                    kinds["sample", step, at_once, pending] = seen(slow.tick((0,) if pending else (), 0))
        kinds["come"] = seen(slow.tick((0,), None))
        kinds["plain"] = seen(slow.tick((), None))
        extra = []
        if own.late_rest:
            kinds["motor"] = Instant({}, {"@f": {f"@m{own.late_ticks}": 1}})
            extra = [(own.late_rest, "motor")]
        self.walk = Walk(own.T, kinds, extra, own.schedule().motion)
        self.made: dict[object, np.ndarray] = {}

    def symbols(self) -> list[Frame]:
        found = [Frame(ticks, delay) for ticks in self.lengths for delay in self.delays]
        return found + [Frame(ticks, LOST) for ticks in self.lengths] * bool(self.lost)

    def allowed(self, word) -> bool:
        """Whether no more results in a row are lost than may be, also where the word begins again."""
        return most_in_a_row([frame.delay is LOST for frame in word]) <= self.lost

    def sample(self, frame: Frame, before: Frame):
        """The kind of a frame's first tick."""
        step = before.ticks if self.elapsed else self.nominal
        return "sample", step, frame.delay == 0, before.delay in ("frame", before.ticks)

    def frame(self, frame: Frame, before: Frame) -> np.ndarray:
        key = frame, self.sample(frame, before)
        if key not in self.made:
            matrix = self.walk.after(key[1])
            for tick in range(1, frame.ticks):
                matrix = self.walk.after("come" if tick == frame.delay else "plain") @ matrix
            self.made[key] = matrix
        return self.made[key]

    def march(self, word) -> np.ndarray:
        whole = np.eye(self.walk.size)
        for before, frame in zip((word[-1], *word[:-1]), word, strict=True):
            whole = self.frame(frame, before) @ whole
        return whole

    def ticks(self, word) -> int:
        return sum(frame.ticks for frame in word)


class DrawnFrames:
    """Frames of a drawn loop: what `every` reads has another value in each, and blocks count the time since their last run."""

    lost = 0
    delays = ("frame",)

    def __init__(self, tables: dict, asked: Asked):
        ((self.name, values),) = asked.varying.items()
        kinds: dict[object, Instant] = {}
        self.rows: dict[object, list] = {}  # of a frame of some ticks after one with a value, kinds of ticks
        self.lengths = []
        extra: dict = {}
        drawn = {value: Drawing(with_numbers(tables, {self.name: value}), doubles) for value in values}
        for own in drawn.values():
            running = [name for name in own.blocks if name not in own.plants and name not in own.late]
            slow = [name for name in running if own.every(name) > 1 or self.name in str(own.blocks[name].get("every"))]
            self.lengths.append(own.every(slow[0]))
            for before, other in drawn.items():
                row = []
                for tick in range(own.every(slow[0])):
                    active = tuple(name for name in running if name not in slow or own.phase(name) == tick)
                    kinds[before, active], between = other.tick(running, active, {})
                    for later, kind, instant in between:
                        kinds[kind] = instant
                        extra[kind] = later
                    row.append((before, active))
                self.rows[own.every(slow[0]), other.every(slow[0])] = row
        self.walk = Walk(own.T, kinds, [(later, kind) for kind, later in extra.items()], own.motion())

    def symbols(self):
        return [Frame(ticks) for ticks in self.lengths]

    def allowed(self, word) -> bool:
        del word
        return True

    def march(self, word) -> np.ndarray:
        whole = np.eye(self.walk.size)
        for before, frame in zip((word[-1], *word[:-1]), word, strict=True):
            for kind in self.rows[frame.ticks, before.ticks]:
                whole = self.walk.after(kind) @ whole
        return whole

    ticks = ControllerFrames.ticks


class Link:
    """A channel as its documents have it: each run sends a message, which comes `late` ticks later or never.

    One that is older than the newest one that has come is dropped. Without a message the channel keeps its value, or with
    `missing = "zero"` shows zero from a run on.
    """

    def __init__(self, drawing: Drawing, name: str):
        self.name = name
        self.every = drawing.every(name)
        self.phase = drawing.phase(name)
        self.late = drawing.whole(name, "late", 0)
        self.lost = drawing.whole(name, "lost", 0)
        self.zero = drawing.word(name, "missing", "held") == "zero"
        self.registers = self.late // self.every + 1

    def sources(self, fates: list, ticks: int) -> list:
        """What it shows anew in each tick, for these fates in turn: "now", "zero", a message so many sends ago, or None."""
        period = len(fates)
        comes: dict[int, int] = {}  # tick -> the newest message that comes in it
        first = -(self.late // self.every + 2) - period * 2
        for message in range(first, ticks // self.every + 1):
            late = fates[message % period]
            if late is not LOST:
                comes[self.phase + message * self.every + late] = message
        newest = first - 1
        found = []
        for tick in range(self.phase + first * self.every, ticks):
            sends = (tick - self.phase) % self.every == 0
            message = comes.get(tick, newest)
            sent_before = -((self.phase - tick) // self.every) - 1  # the last message that was sent before this tick
            source = None
            if message > newest:
                newest = message
                source = "now" if message > sent_before else sent_before - message
            elif sends and self.zero:
                source = "zero"
            found.append(source)
        return found[-ticks:]


class Messages:
    """A drawn loop with channels: a word has what becomes of the messages of each, in turn."""

    def __init__(self, tables: dict):
        self.drawing = own = Drawing(tables, doubles)
        self.running = [name for name in own.blocks if name not in own.plants and name not in own.late]
        names = [name for name in self.running if own.blocks[name]["type"] == "channel"]
        self.links = [Link(own, name) for name in names]
        self.period = math.lcm(*(own.every(name) for name in self.running))
        kinds: dict[object, Instant] = {}
        extra: dict = {}
        self.active = []
        for tick in range(self.period):
            active = tuple(name for name in self.running if (tick - own.phase(name)) % own.every(name) == 0)
            self.active.append(active)
            choices = []
            for link in self.links:
                shown = [None, *range(link.registers)]
                if link.name in active:
                    shown += ["now"] + ["zero"] * link.zero
                choices.append(shown)
            for sources in product(*choices):
                if (active, sources) not in kinds:
                    kinds[active, sources], between = self._tick(active, sources)
                    for later, kind, instant in between:
                        kinds[kind] = instant
                        extra[kind] = later
        self.walk = Walk(own.T, kinds, [(later, kind) for kind, later in extra.items()], own.motion())

    def _tick(self, active, sources):
        instant, between = self.drawing.tick(self.running, active, {})
        for link, source in zip(self.links, sources, strict=True):
            out = f"{link.name}.y"
            if link.name in active:
                sent = instant.equations[out]
                for at in range(link.registers):
                    instant.writes[f"@{link.name} sent {at}"] = {f"@{link.name} sent {at - 1}": 1} if at else dict(sent)
            if source is None:
                instant.equations[out] = {f"@held {out}": 1}
            elif source == "zero":
                instant.equations[out] = {}
            elif source != "now":
                instant.equations[out] = {f"@{link.name} sent {source}": 1}
        return instant, between

    def ticks(self, word) -> int:
        return math.lcm(self.period, *(link.every * len(word[link.name]) for link in self.links))

    def march(self, word) -> np.ndarray:
        ticks = self.ticks(word)
        shown = [link.sources(list(word[link.name]), ticks) for link in self.links]
        whole = np.eye(self.walk.size)
        for tick in range(ticks):
            sources = tuple(each[tick] for each in shown)
            whole = self.walk.after((self.active[tick % self.period], sources)) @ whole
        return whole

    def allowed(self, word) -> bool:
        return all(most_in_a_row([late is LOST for late in word[link.name]]) <= link.lost for link in self.links)

    def in_time(self) -> dict:
        return {link.name: (0,) for link in self.links}


class LateTicks:
    """A loop whose ticks take other times (s), a word of them from the first tick of a frame on."""

    def __init__(self, tables: dict):
        schedule = (Controller if "controller" in tables else Drawing)(tables, doubles).schedule()
        self.kinds = [kind for _, kind in schedule.times]
        self.walk = Walk(schedule.period / len(self.kinds), schedule.kinds, [], schedule.motion)

    def march(self, word) -> np.ndarray:
        ticks = math.lcm(len(word), len(self.kinds))
        whole = np.eye(self.walk.size)
        for tick in range(ticks):
            whole = self.walk.after(self.kinds[tick % len(self.kinds)], word[tick % len(word)]) @ whole
        return whole

    def ticks(self, word) -> int:
        return math.lcm(len(word), len(self.kinds))

    def allowed(self, word) -> bool:
        del word
        return True


def most_in_a_row(flags) -> int:
    """The most that are true in a row, of what repeats; infinite if all are."""
    if all(flags):
        return len(flags) * 1000
    return max(len(run) for run in "".join("x" if flag else " " for flag in (*flags, *flags)).split(" "))


def family_of(tables: dict, asked: Asked):
    """What marches the patterns of a spec with these numbers; None if nothing varies."""
    if asked.tick:
        return LateTicks(tables)
    if any(block["type"] == "channel" for block in tables.get("block", {}).values()):
        return Messages(tables)
    if not (asked.varying or asked.lost or asked.loss):
        return None
    return (ControllerFrames if "controller" in tables else DrawnFrames)(tables, asked)


def read_refuter(text: str) -> tuple[dict, object]:
    """The numbers and the pattern of a printed counterexample; the pattern None if it has none."""
    numbers = {name: float(value) for name, value in re.findall(r"([\w.]+) = ([-+\d.e]+)", text)}
    if ticks := re.search(r"ticks of (.*) ms", text):
        return numbers, tuple(_times(ticks[1]))
    if frames := re.search(r"\bframes (.*)$", text):
        word = []
        for ticks, said in re.findall(r"(\d+)(?: \(([^)]*)\))?", frames[1]):
            delay = said.removeprefix("delay ") or "own"
            word.append(Frame(int(ticks), LOST if said == "lost" else int(delay) if delay.isdigit() else delay))
        return numbers, tuple(word)
    if messages := re.search(r"\bmessages (.*)$", text):
        word = {}
        for told in messages[1].split("; "):
            name, _, fates = told.partition(": ")
            word[name] = tuple(_fates(fates))
        return numbers, word
    return numbers, None


def _fates(text: str):
    for each in text.split(", "):
        if "lost" in each:
            yield from [LOST] * int(each.partition(" ")[0] if each[0].isdigit() else 1)
        else:
            yield int(each)


def _times(text: str) -> list[float]:
    """Times in ms, of which `a x 3` repeats the last one, or what is in brackets, or all that is there: in s."""
    parts = re.findall(r"[\d.]+(?:e[-+]?\d+)?|[(),x]", text)
    stack: list[list[float]] = [[]]
    last: list[float] = []
    at = 0
    while at < len(parts):
        part = parts[at]
        if part == "(":
            stack.append([])
        elif part == ")":
            last = stack.pop()
            stack[-1] += last
        elif part == "x":
            at += 1
            stack[-1] += last * (int(parts[at]) - 1)
        elif part != ",":
            last = [float(part) / 1000]
            stack[-1] += last
        at += 1
    return stack[0]
