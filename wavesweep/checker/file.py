"""The proof file, and what is checked of it.

`NAME.proof` is a gzip of JSON lines. Numbers are decimal strings ("798.52"), counts whole numbers. A file with a field
that is not named here is not checked (exit code 2), and nothing is taken from the file that follows from the spec. First a line

    {"format": "wavesweep proof 2", "sha256": of the bytes of the spec, "of": "sweep", "question": [...], "claims": 3}

whose question `coverage.py` has, and then each claim, a line, followed by the lines of its cells:

    claim     "modes": of the spec's own loop; "for all": of all that [for_all] and channels say; "refuted": a member of this is
              unstable; "mean square": of [for_all] with chances; "contact": of any wall that pushes and never pulls;
              "goes on": at such a wall a motion goes on for ever, which has no cells; "gain": see `gain.py`; "port": see `port.py`
    numbers   {name: value} that the claim sets, by their names in [sweep]; all others are those of the spec
    sides     {name: [low, high]}: for all values of these; with [for_all] the swept number, and then its ranges; of contact
              the stiffness and the damping of the wall
    outside   of modes and refuted: how many modes are outside the unit circle, all over the sides
    radius    of modes: the circle in place of the unit circle, if it is another one
    cut       of modes: a signal that is multiplied, or turned, by a side `factor.py` names
open      true in place of it: a map, whose cells have any counts or none
    drifts    [[name, ...]]: what takes part in a drift, which every equation keeps; first a memory that no other drift has
    states    names of the memory that is left, sorted: rows and columns of all forms. It is what some kind of frame reads
    gain      of gain: {"from", "to", "at_most"} or {"cut", "less", "at_most"}, that of the wave channel from "waves sent"
              to "waves received"; forms of gain and port have no signs
    rest      of contact: what drifts besides while the wall is not touched, as a drift; none if nothing does
    forces    of what goes on: those of the wall, frame by frame, which are repeated for ever
    word      of refuted: frames that are repeated for ever, by their letters; of [for_all] tick the times of ticks (s) from the first
              of a period on, or "start" and "stop" for the shortest and the longest; of what goes on while frames vary: its frames,
              which are all of one kind, and of which the loop is then that of a spec without [for_all]
    ticks     of [for_all] tick: times at which these are divided, rising; the letters of the parts are "0", "1", ...

Cells divide the whole of the sides, in this order:

    {"split": "K_VE", "at": "12.5"}    first all lines of the lower part, then all of the upper part
    {"L": rows, "signs": "++-", "Q": [[exponents, rows], ...], "turn": -1}     a form (`form.py`); Q and turn may be left out
    {"nodes": [{"L": rows, "Q": ...}, ...], "edges": [[node, letter, node], ...], "start": 0}   forms of frames in any order
    {"L": rows, "e": [...], "h": [...], "P": [rows, rows]}      of contact: a form of the loop without its wall, and what
                                       `contact.py` asks for, with P at both ends of the side
    {"nodes": [{"L": [rows, rows]}, ...], "edges": [[node, letter, node, g, a], ...], "start": 0, "h": ...}    of contact beside
                                       frames that vary: forms at both ends, over the states and the last force, see `contact.py`
    {"open": true}                     nothing is known

Where [for_all] lists values of numbers, cells follow for each combination, the last key fastest, after a line of its own:

    {"member": {"filters.lp1.order": "1"}, "drifts": [...], "states": [...]}

Letters of frames name what varies, "rates.ratio=16" or "rates.ratio=16;environment.delay=2;lost"; those of messages the tick and
what the receiver then has, "0: command gets 0" of one that is new to it, "0: command has 2" of one it had, counted back from the newest, 0.
From "start" on a graph has at each node that is reached an edge for every letter that the spec allows there.

p = centre + half s in each side, -1 <= s <= 1, and P(s) = L' (diag(signs) + sum of Q_m s^m) L, m in the order of the sides, of
degree 1 to 3. A claim of modes is proved if P - A' P A > 0 in all cells, and "for all" without frames that vary likewise, with all signs +.
In a graph P_i - A' P_j A > 0 for each edge from i to j: no matter in which order frames come, a norm of what is left decreases with
each. Of [for_all] tick the frames are single ticks, A depends on their time as on one more side, and P does not: it decreases for
all times if it does so at control points of A. Of chances there is a node for each state of the spec's chain, no edges, and
P_q - sum of chance A' P_r A > 0 over the states r that follow q.
"""

import gzip
import hashlib
import json
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import IO, Any

from . import balls, channel, contact, form, port
from .balls import Cell, Refused, decimal
from .channel import between_ends
from .coverage import Ask
from .drifts import Form, drifts_of, reduced
from .factor import FACTOR, PHASE, with_factor
from .frame import Frames, states_of, steps_of
from .gain import Gain, opened, stays_below
from .reader import for_all, loop_of, unknown_key, wall_of
from .reader.loops import INPUT, OUTPUT, Schedule, Unreadable
from .reader.names import one_key_each, quantity, with_numbers

FORMAT = "wavesweep proof 2"
RUNS = "sweep", "map", "design"
LONGEST_SPEC = 1 << 20  # bytes
LONGEST_LINE = 1 << 22
LONGEST_FILE = 1 << 30  # once it is unpacked
CELLS = 1 << 20  # lines of a claim, and claims
SIDES = 6
NODES = 256
KINDS = ("modes", "for all", "refuted", "mean square", "contact", "goes on", "gain", "port")
OF_WALLS = "contact", "goes on"
ALIKE = {None: {"": ("", None, None)}}  # the moves of frames of one kind
FIELDS = {
    "claim",
    "numbers",
    "sides",
    "outside",
    "open",
    "word",
    "radius",
    "forces",
    "ticks",
    "gain",
    "cut",
}
COORDINATES = {"drifts", "states", "rest"}


@dataclass
class Claim:
    """What a proof file says of a spec; see the top of this file."""

    claim: str
    numbers: dict[str, Fraction] = field(default_factory=dict)
    sides: dict[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    outside: int | None = None
    drifts: list[list[str]] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    word: list[str] = field(default_factory=list)
    radius: Fraction = Fraction(1)
    rest: list[str] = field(default_factory=list)
    forces: list[Fraction] = field(default_factory=list)
    ticks: list[Fraction] = field(default_factory=list)
    gain: Gain | None = None
    cut: str = ""
    times: dict[str, tuple[Fraction, Fraction]] = field(default_factory=dict)  # of a tick
    shares: dict[Any, Fraction] = field(default_factory=dict)  # of a map, from its cells
    in_touch: bool = False  # whether [for_all] asks for walls that let go, which is not claimed


@dataclass
class Family:
    """Kinds of frames of one loop in coordinates without drifts.

    moves: {state of what may follow: {letter: (kind of frame, next state, chance)}}; start: the state in which a run begins.
    word: kinds of frames in their order, whose product is the only frame. radius: that matrices are divided by. rest, held:
    see `contact.opened_at`.
    """

    frames: Frames
    drifts: list[Form]
    states: list[str]
    moves: dict[Any, dict[str, tuple[str, Any, Any]]]
    start: Any
    word: list[str]
    radius: Fraction
    rest: Form | None = None
    held: bool = False

    def rows(self, kind: str, cell: Cell) -> dict:
        """Those of a frame, without its drifts."""
        return reduced(cell, self.frames.matrix(kind, cell), self.drifts)

    def matrix(self, kind: str, cell: Cell) -> form.Matrix:
        if self.word and not kind:
            frames = {letter: self.matrix(letter, cell) for letter in self.word}
            return form.product_of([frames[letter] for letter in self.word])
        A = form.matrix_of(cell, self.rows(kind, cell), self.states)
        return A if self.radius == 1 else form.divided(A, self.radius)


def spec_of(text: bytes) -> dict:
    """The tables of a spec, its numbers as the decimals that they are."""
    if len(text) > LONGEST_SPEC:
        raise Unreadable(f"a spec of {len(text)} bytes; at most {LONGEST_SPEC}")
    return deepcopy(_read(text))


@lru_cache(4)
def _read(text: bytes) -> dict:
    try:
        tables = tomllib.loads(text.decode(), parse_float=decimal)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise Unreadable(f"the spec is no TOML: {error}") from None
    with told():
        for ends in ({}, *one_key_each(tables, balls)):
            with suppress(Refused):  # what a function has no value for
                loop_of(with_numbers(tables, ends), balls)
        for_all.read(tables, balls.exact)
    return tables


@contextmanager
def told() -> Iterator[None]:
    """What goes wrong where a value of a spec is not of the kind that its key has, a text for a table, say, as Unreadable."""
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise Unreadable(f"the spec cannot be read: {error!r}") from None


def family_of(tables: dict, claim: Claim, member: dict | None = None) -> Family:
    """The frames that a claim is about, from the spec; member: values of the listed numbers of [for_all]."""
    with told():
        schedules, moves, start = schedules_of(tables, claim, member or {})
    free = {}
    if claim.claim in OF_WALLS:
        schedules, free = cut_at_wall(tables, schedules)
    words = steps_of(schedules)
    word = []
    if claim.claim == "refuted" and claim.word and "" in words:
        raise Refused("frames of a word, and the spec has no frames that differ")
    if claim.claim == "refuted" and "" not in words:
        word = _repeated(moves, claim.word)
        words = {kind: words[kind] for kind in word}
    frames = Frames(words)
    middle = Cell({name: ((low + high) / 2,) * 2 for name, (low, high) in claim.sides.items()})
    drifts = drifts_of([*schedules.values()], claim.drifts, frames.live, middle)
    rest = None
    drifts_named = [names for names in claim.drifts if names[0] != contact.FORCE]
    has_force = len(drifts_named) < len(claim.drifts)
    drifts = [drift for drift in drifts if next(iter(drift)) != contact.FORCE]
    if claim.rest:
        *_, rest = drifts_of([*free.values()], [*drifts_named, claim.rest], frames.live, middle)
    if any(contact.FORCE in drift for drift in (*drifts, rest or ())):
        raise Refused("a drift that takes a force of the wall")
    states = states_of(frames, [*drifts, rest] if rest else drifts)
    outside = INPUT, OUTPUT, contact.FORCE, port.PUSH
    states = [name for name in states if not name.startswith(outside)]
    return Family(frames, drifts, states, moves, start, word, claim.radius, rest, has_force)


def cut_at_wall(tables: dict, schedules: Mapping[str, Schedule]):
    """Schedules cut at the wall, and the same without its stiffness; see `contact.opened`."""
    vary = "" not in schedules
    cuts = {
        kind: contact.opened(schedule, wall_of(tables)[0], remembers=vary)
        for kind, schedule in schedules.items()
    }
    return ({kind: pair[at] for kind, pair in cuts.items()} for at in (0, 1))


def schedules_of(tables: dict, claim: Claim, member: Mapping[str, Any]):
    """Schedules of all kinds of frames, what may follow what, and the state in which a run begins."""
    values = {
        **claim.numbers,
        **member,
        **{name: balls.side(name, ends) for name, ends in claim.sides.items()},
    }
    cut = claim.gain.cut if claim.gain else claim.cut
    factors = {name: values.pop(name) for name in (FACTOR, PHASE) if claim.cut and name in values}

    def loop_with(more: dict):
        return loop_of(with_numbers(tables, values | more), balls, cut)

    loop = loop_with({})
    schedule = loop.schedule()
    for name, value in factors.items():
        schedule = with_factor(schedule, name, value)
    if claim.gain and (claim.gain.source, claim.gain.signal) == (channel.SENT, channel.RECEIVED):
        schedule = between_ends(loop, schedule)
    elif claim.gain:
        schedule = opened(tables, schedule, claim.gain)
    if claim.claim == "port":
        schedule = port.opened(tables, schedule)
    unknown = unknown_key(tables, loop)
    if unknown:
        raise Unreadable(f"the key {unknown} is not known to this checker, or nothing reads it")
    allowed = for_all.read(tables, balls.exact)
    times = for_all.time_of_tick(loop, allowed.tick) if allowed.tick else ()
    alike = {"": schedule}, ALIKE, None
    if claim.claim in ("modes", "gain", "port"):
        return alike
    if times and claim.claim in ("for all", "refuted"):
        claim.times = times_of(claim, *times)
        return *for_all.ticks_of(loop, claim.times), 0
    return _schedules_of_set(allowed, claim, loop, loop_with) or alike


def _schedules_of_set(allowed: for_all.ForAll, claim: Claim, loop, loop_with: Callable):
    """The same if frames or messages vary by the spec, or None where all frames are alike."""
    vary = bool(allowed.varying or allowed.lost or allowed.loss)
    messages = for_all.has_messages(loop)
    random = claim.claim == "mean square"
    if claim.claim in OF_WALLS and (messages or allowed.ranges or allowed.tick):
        raise Refused("a wall that lets go beside ranges, or ticks and messages that vary")
    if claim.claim == "goes on" and vary != bool(claim.word):
        raise Refused("a motion that goes on has a word where frames vary, and nowhere else")
    if vary and messages:
        raise Unreadable(
            "frames that vary beside messages that are late or lost have no proof here"
        )
    if messages and not allowed.tick:
        return for_all.messages_at_random(loop) if random else for_all.messages_of(loop)
    if vary:
        schedules, moves, start = for_all.frames_of(allowed, loop_with, random)
        if claim.claim != "goes on":
            return schedules, moves, start
        kind, *others = set(_repeated(moves, claim.word))
        if others:
            raise Refused("a motion that goes on in frames of several kinds")
        return {"": schedules[kind]}, ALIKE, None
    if random:
        raise Unreadable("the spec has no chances")
    return None


def times_of(claim: Claim, low: Fraction, high: Fraction) -> dict[str, tuple[Fraction, Fraction]]:
    """The times of a tick that each letter of a claim stands for, of those that the spec allows."""
    if for_all.TICK in claim.sides:
        raise Unreadable(f"a number with the name {for_all.TICK}")
    if claim.claim != "refuted":
        parts = list(pairwise([low, *claim.ticks, high]))
        if any(begin >= end for begin, end in parts):
            raise Refused("the times of ticks do not rise from the shortest to the longest one")
        return {str(index): part for index, part in enumerate(parts)}
    times = {}
    for letter in claim.word:
        time = {"start": low, "stop": high}.get(letter) or decimal(letter)
        if not low <= time <= high:
            raise Refused(f"no tick of {letter} s may come")
        times[letter] = time, time
    if not times:
        raise Refused("no tick is said to refute it")
    return times


def _repeated(moves, word: list[str]) -> list[str]:
    """The kinds of frames of a word, so often that it can be repeated for ever from there on."""
    for start in moves:
        seen = [start]
        kinds: list[str] = []
        while word:
            now = seen[-1]
            for letter in word:
                if letter not in moves[now]:
                    now = None
                    break
                kind, now, _ = moves[now][letter]
                kinds.append(kind)
            if now is None:
                break
            if now in seen:
                return kinds[seen.index(now) * len(word) :]
            seen.append(now)
    raise Refused(f"the spec does not allow the frames {', '.join(word) or 'of no word'} for ever")


@dataclass
class Proof:
    """A file about a spec: what is asked, and each claim with why it is refused, "" if it is proved."""

    tables: dict
    ran: str
    question: list[Ask]
    claims: Iterator[tuple[Claim, str]]


def read(text: bytes, file: IO[bytes]) -> Proof:
    """A file of proofs about a spec, whose claims are checked one after the other.

    Raises Unreadable, also later, if the file is not about this spec, or no such file, or too large.
    """
    tables = spec_of(text)
    lines = _lines(file)
    header = next(lines, {})
    if header.get("format") != FORMAT:
        raise Unreadable(f"no proof file: its first line has no format {FORMAT!r}")
    if set(header) != {"format", "sha256", "of", "question", "claims"}:
        raise Unreadable(
            "the first line has other fields than format, sha256, of, question and claims"
        )
    if header["sha256"] != hashlib.sha256(text).hexdigest():
        raise Unreadable("the proof is about another spec: its SHA-256 differs")
    if header["of"] not in RUNS:
        raise Unreadable(f"a file is of one of {', '.join(RUNS)}")
    question = [ask_of(line) for line in _expect(header["question"], list, "the question")]
    return Proof(tables, header["of"], question, _checked(tables, lines, header["claims"]))


def _checked(tables: dict, lines: Iterator[dict], claims: int) -> Iterator[tuple[Claim, str]]:
    line = next(lines, None)
    count = 0
    while line is not None:
        if "claim" not in line:
            raise Unreadable("a cell without a claim")
        claim = claim_of(line)
        count += 1
        rest = _Cells(lines)
        why = ""
        try:
            _holds(tables, claim, rest)
        except Refused as refused:
            why = str(refused)
        except RecursionError:
            raise Unreadable("expressions of the spec that are too long") from None
        line = rest.following()
        if count > CELLS:
            raise Unreadable(f"more than {CELLS} claims")
        yield claim, why
    if not count or count != claims:
        raise Unreadable(f"{count} claims in place of {claims}: the file is not whole")


class _Cells:
    """The lines before the next claim."""

    def __init__(self, lines):
        self.lines = lines
        self.next = None

    def __iter__(self):
        return self

    def __next__(self):
        if self.next is None:
            line = next(self.lines, {"claim": None})
            if "claim" not in line:
                return line
            self.next = line
        raise StopIteration

    def following(self):
        """The line of the next claim, None at the end."""
        for count, _ in enumerate(self):
            if count > CELLS:
                raise Unreadable(f"a claim of more than {CELLS} lines")
        return None if self.next["claim"] is None else self.next


def _lines(file: IO[bytes]) -> Iterator[dict]:
    try:
        with gzip.open(file) as unpacked:
            while line := unpacked.readline(LONGEST_LINE + 1):
                if len(line) > LONGEST_LINE:
                    raise Unreadable(f"a line of more than {LONGEST_LINE} bytes")
                if unpacked.tell() > LONGEST_FILE:
                    raise Unreadable(f"a file of more than {LONGEST_FILE} bytes")
                found = json.loads(
                    line, object_pairs_hook=_once, parse_float=_no_number, parse_constant=_no_number
                )
                if not isinstance(found, dict):
                    raise Unreadable("a line that is no JSON object")
                yield found
    except (OSError, EOFError, ValueError, RecursionError) as error:
        raise Unreadable(f"no proof file: {error}") from None


def _once(pairs):
    table = dict(pairs)
    if len(table) != len(pairs):
        raise Unreadable("a field that is there twice")
    return table


def _no_number(text):
    raise Unreadable(f"{text} stands there as a number and not as a decimal string")


def _expect(value, kind, name, length=None):
    wrong = not isinstance(value, kind) or isinstance(value, bool)
    if wrong or (length is not None and len(value) != length):
        raise Unreadable(f"{name} is not what it has to be")
    return value


def _fraction(text) -> Fraction:
    return decimal(_expect(text, str, "a number"))


def ask_of(line) -> Ask:
    """A part of the question."""
    _expect(line, dict, "a part of the question")
    if line.keys() - {"claim", "numbers", "sides", "radius", "open", "gain", "cut"}:
        raise Unreadable(
            "a part of the question has claim, numbers, sides, radius, gain, cut and open alone"
        )
    openings = [_ends("an opening", ends) for ends in _expect(line.get("open", []), list, "open")]
    kind = _expect(line.get("claim"), str, "a claim")
    radius = _fraction(line.get("radius", "1"))
    gain = _gain(_expect(line["gain"], dict, "a gain")) if "gain" in line else None
    return Ask(kind, *_numbers_and_sides(line), radius, openings, gain, _cut(line))


def _ends(name: str, pair) -> tuple[Fraction, Fraction]:
    low, high = map(_fraction, _expect(pair, list, name, 2))
    if low > high:
        raise Unreadable(f"{name} ends before it begins")
    return low, high


def _numbers_and_sides(line) -> tuple[dict[str, Fraction], dict[str, tuple[Fraction, Fraction]]]:
    table = _expect(line.get("sides", {}), dict, "sides")
    sides = {name: _ends(f"the side {name}", ends) for name, ends in table.items()}
    table = _expect(line.get("numbers", {}), dict, "numbers")
    numbers = {name: _fraction(value) for name, value in table.items()}
    if len(sides) > SIDES or sides.keys() & numbers.keys():
        raise Unreadable(f"more than {SIDES} sides, or a side that is a number too")
    return numbers, sides


def _cut(line) -> str:
    cut = _expect(line.get("cut", ""), str, "a cut")
    factors = line.get("sides", {}).keys() & {FACTOR, PHASE}
    if cut and (len(factors) != 1 or line["claim"] != "modes" or "radius" in line):
        raise Unreadable(f"a cut is one of modes, and one side is {FACTOR} or {PHASE}")
    return cut


def claim_of(line) -> Claim:
    """A claim, from its line."""
    unknown = line.keys() - FIELDS - COORDINATES
    if unknown:
        raise Unreadable(f"the field {min(unknown)} of a claim is not known")
    kind = line["claim"]
    if kind not in KINDS:
        raise Unreadable(f"no claim {kind!r} is known")
    numbers, sides = _numbers_and_sides(line)
    wanted = kind in ("modes", "refuted") and not line.get("open")
    if wanted:
        _expect(line.get("outside"), int, "outside")
    if (
        line.get("open", True) is not True
        or ("open" in line and (kind != "modes" or "radius" in line))
        or (not wanted and "outside" in line)
    ):
        asks = "how many modes are outside, or of a map, without a radius, that it is open"
        raise Unreadable(f"a claim says {asks}")
    letters = _expect(line.get("word", []), list, "word")
    word = [_expect(letter, str, "a letter") for letter in letters]
    if word and kind not in ("refuted", "goes on"):
        raise Unreadable("what is refuted and what goes on alone have a word")
    radius = _fraction(line.get("radius", "1"))
    if radius <= 0 or ("radius" in line and kind != "modes"):
        raise Unreadable("modes alone are within a circle of another radius, above 0")
    forces = [_fraction(x) for x in _expect(line.get("forces", []), list, "forces")]
    if bool(forces) != (kind == "goes on") or len(forces) > contact.LAGS:
        raise Unreadable("forces that go on are some, and those of a motion that goes on")
    ticks = [_fraction(time) for time in _expect(line.get("ticks", []), list, "ticks")]
    if ticks and kind != "for all":
        raise Unreadable("what holds for all has ticks alone")
    if ("gain" in line) != (kind == "gain"):
        raise Unreadable("a claim of a gain, and no other, has a gain")
    gain = _gain(_expect(line["gain"], dict, "a gain")) if "gain" in line else None
    claim = Claim(kind, numbers, sides, line.get("outside"), word=word, radius=radius, gain=gain)
    claim = replace(claim, forces=forces, ticks=ticks, cut=_cut(line))
    return claim if "states" not in line else _with_coordinates(claim, line)


def _gain(table: dict) -> Gain:
    if table.keys() not in ({"from", "to", "at_most"}, {"cut", "less", "at_most"}):
        raise Unreadable("a gain has from, to and at_most, or cut, less and at_most")
    names = [_expect(table.get(key, ""), str, key) for key in ("from", "to", "cut")]
    less, at_most = (_fraction(table.get(key, "0")) for key in ("less", "at_most"))
    if at_most <= 0 or not 0 <= less <= 1:
        raise Unreadable(
            "the level of a gain is above 0, and the share that is taken off from 0 to 1"
        )
    return Gain(*names, less, at_most)


def _holds(tables, claim: Claim, lines: Iterator[dict]):
    """Refused, unless a form, or a graph, is right in each cell of the sides, for each member of listed numbers."""
    if claim.claim == "refuted" and not claim.outside:
        raise Refused("no mode is said to be outside, so nothing is refuted")
    members: list[dict] = [{}]
    with told():
        allowed = for_all.read(tables, balls.exact)
        wall = wall_of(tables)
        factors = {FACTOR, PHASE} if claim.cut else {}
        numbers = [name for name in (*claim.sides, *claim.numbers) if name not in factors]
        names = {quantity(tables, name): name for name in numbers}
    claim.in_touch = allowed.contact
    if claim.claim in OF_WALLS and (not wall or [*claim.sides] != wall):
        raise Refused("the sides are not the stiffness and the damping of the wall")
    if claim.claim in ("for all", "mean square", "contact"):
        members = allowed.members
        sides = {name: claim.sides.get(names.get(name, "")) for name in allowed.ranges}
        if sides != allowed.ranges or names.keys() & (
            allowed.listed.keys() | allowed.varying.keys()
        ):
            raise Refused(
                "the sides are not the ranges of [for_all], or a number is set that [for_all] leaves open"
            )
    elif claim.claim in ("refuted", "goes on"):
        numbers = claim.numbers
        _is_member(allowed, {key: numbers[name] for key, name in names.items() if name in numbers})
    for member in members:
        if member:
            claim = _next_member(claim, member, lines)
        family = family_of(tables, claim, member)
        if family.states != claim.states:
            raise Refused(f"the states are {', '.join(family.states)}, and others in the file")
        if claim.claim == "goes on":
            _goes_on(family, claim)
        else:
            check_cells(family, claim, lines)
    if next(lines, None) is not None:
        raise Refused("cells beyond the sides")


def _goes_on(family: Family, claim: Claim):
    """Refused, unless a wall that pushes and never pulls has the forces of a motion that never ends."""
    if any(low < high for low, high in claim.sides.values()):
        raise Refused("a motion goes on at one wall, and not at a range")
    loop = opened_at(family, {name: low for name, (low, _) in claim.sides.items()})
    if not contact.goes_on(loop, claim.forces):
        raise Refused("no wall that pushes and never pulls has these forces")


def _next_member(claim: Claim, member: Mapping[str, Fraction], lines: Iterator[dict]) -> Claim:
    """The claim in the coordinates of the next line, which has to name the member of the listed numbers."""
    line = next(lines, {})
    values = _expect(line.get("member", {}), dict, "a member")
    if {name: _fraction(value) for name, value in values.items()} != member:
        raise Refused(f"no proof of {for_all.letter_of(member)}")
    if line.keys() - {"member"} - COORDINATES:
        raise Unreadable("a member has drifts, states and a rest alone")
    return _with_coordinates(claim, line)


def _is_member(allowed, numbers: dict):
    """Refused, unless every number of [for_all] that is set has a value that it may have, and none is set that varies."""
    if set_too := allowed.varying.keys() & numbers.keys():
        raise Refused(f"{min(set_too)} is set, and varies from frame to frame")
    missing = (allowed.ranges.keys() | allowed.listed.keys()) - numbers.keys()
    if missing:
        raise Refused(f"a member of [for_all] has a value of {min(missing)}")
    for name, (low, high) in allowed.ranges.items():
        if not low <= numbers[name] <= high:
            raise Refused(f"{name} = {float(numbers[name])!r} is not in its range")
    for name, values in allowed.listed.items():
        if numbers[name] not in values:
            raise Refused(f"{name} = {float(numbers[name])!r} is none of its values")


def check_cells(family: Family, claim: Claim, lines: Iterator[dict]):
    """The tree of cells that divides the sides: a line cuts a cell in two, or has its proof."""
    boxes = [claim.sides]
    count = 0
    while boxes:
        box = boxes.pop()
        line = next(lines, None)
        count += 1
        if line is None or count > CELLS:
            raise Refused(
                f"no cell {_in_words(box)}" if line is None else f"more than {CELLS} cells"
            )
        if not family.states and "nodes" in line:
            raise Refused("a loop without states has no form; it ends in one frame")
        if "split" in line:
            name = _expect(line["split"], str, "split")
            cut = _fraction(line.get("at"))
            low, high = box.get(name, (cut, cut))
            if set(line) != {"split", "at"} or not low < cut < high:
                raise Refused(f"a cut at {float(cut)!r} of {name} that divides nothing")
            boxes += [{**box, name: (cut, high)}, {**box, name: (low, cut)}]
        else:
            _check_cell(family, claim, line, box)


def _check_cell(family: Family, claim: Claim, line: dict, box):
    """Refused, unless the forms of a line prove the claim in a cell."""
    if claim.claim == "contact" and "nodes" in line:
        _rests_in_any_order(family, line, box)
    elif claim.claim == "contact":
        _rests(family, line, box)
    elif claim.claim in ("gain", "port"):
        _keeps_energy(family, claim.gain, Cell(box), line, box)
    elif "nodes" in line:
        if claim.claim not in ("for all", "mean square"):
            raise Refused("a graph is for frames in any order, or at random")
        if claim.claim == "for all":
            _graph(family, claim.times, Cell(box), line, box)
        else:
            _chain(family, Cell(box), line, box)
    elif not family.word and ("" not in family.frames.words or claim.claim == "mean square"):
        raise Refused(f"no graph {_in_words(box)}")
    else:
        outside = _outside(family, claim, Cell(box), line, box)
        if claim.outside is None and claim.claim == "modes":
            share = _size(box, claim.sides) / _size(claim.sides, claim.sides)
            claim.shares[outside] = claim.shares.get(outside, Fraction(0)) + share
        elif outside != (claim.outside or 0):
            raise Refused(
                f"{outside} modes are outside {_in_words(box)}, and {claim.outside or 0} in the claim"
            )


def _rests(family: Family, line: dict, box):
    """Refused, unless every motion comes to rest at both ends of a side, and so between them; see `contact.py`."""
    if set(line) != {"L", "e", "h", "P"}:
        raise Unreadable("what comes to rest has L, e, h and P")
    if "" not in family.frames.words:
        raise Refused(f"no graph {_in_words(box)}")
    e, h = ([_fraction(x) for x in _expect(line[name], list, name)] for name in "eh")
    if len(e) != len(h) or len(e) > contact.LAGS or min(e + h, default=0) < 0 or sum(e + h) >= 1:
        raise Refused("e and h are not the weights of a multiplier")
    points = _ends_of(box)
    for point, rows in zip(points, _expect(line["P"], list, "P", len(points)), strict=True):
        loop = opened_at(family, point)
        if not contact.stable(
            loop, form_from({"L": line["L"]}, balls.POINT, [1] * len(family.states))
        ):
            raise Refused("the form of the loop without its wall does not decrease")
        if not form.positive(
            contact.left_over(loop, e, h, rows_of(rows, len(family.states) + len(e)))
        ):
            raise Refused(f"there may be a motion that does not come to rest {_in_words(box)}")


def _ends_of(box) -> list[dict[str, Fraction]]:
    """The numbers of the wall at both ends of the side that has a range."""
    wide = [name for name, (low, high) in box.items() if low < high]
    if len(wide) > 1:
        raise Refused("more than one number of the wall has a range")
    return [
        {name: ends[index if name in wide else 0] for name, ends in box.items()}
        for index in range(1 + len(wide))
    ]


def _rests_in_any_order(family: Family, line: dict, box):
    """Refused, unless what a graph stores falls in all frames at both ends of a side; see (3) of `contact.py`."""
    if set(line) != {"nodes", "edges", "start", "h"}:
        raise Unreadable("what comes to rest in any order has nodes, edges, a start and h")
    if "" in family.frames.words or family.held:
        raise Refused("a graph at a wall is of frames that vary, without a force that is held")
    points = _ends_of(box)
    size = len(family.states) + 1
    forms = []
    for node in _nodes(line):
        if set(node) != {"L"}:
            raise Unreadable("a node at a wall has L alone")
        ends = _expect(node["L"], list, "L", len(points))
        forms.append([form_from({"L": rows}, balls.POINT, [1] * size).parts[()] for rows in ends])
    h = _fraction(line["h"])
    steps = [*_walked(family, line, len(forms), 2)]
    for index, point in enumerate(points):
        frames = sampled_at(family, point)
        for source, letter, kind, target, more in steps:
            g, a = map(_fraction, more)
            left = contact.left_over_of(
                frames[kind], forms[source][index], forms[target][index], (h, g, a)
            )
            if not form.positive(left):
                raise Refused(
                    f"what node {source} stores does not fall with the frame {letter} {_in_words(box)}"
                )


def sampled_at(family: Family, point: Mapping[str, Fraction]) -> dict[str, contact.Sampled]:
    """The kinds of frames at a wall with these numbers, the stiffness first."""
    cell = Cell({name: (value, value) for name, value in point.items()})
    frames = {}
    for kind in family.frames.words:
        rows = reduced(cell, family.rows(kind, cell), [family.rest] if family.rest else [])
        frames[kind] = contact.sampled_at(cell, rows, point, family.states, bool(family.rest))
    return frames


def _keeps_energy(family: Family, gain: Gain | None, cell: Cell, line: dict, box):
    """Refused, unless a form shows that a gain stays below its level, or without one that the hand's port is passive."""
    if line.keys() - {"L", "Q"}:
        raise Unreadable("a form of a gain or of a port has L and Q alone")
    P = form_from(line, cell, [1] * len(family.states))
    rows = family.rows("", cell)
    if not gain:
        if not port.is_passive(cell, rows, family.states, P, port.stiffness(family.drifts)):
            raise Refused(f"the hand's port may not be passive {_in_words(box)}")
    elif not stays_below(cell, rows, family.states, P, gain.at_most):
        raise Refused(f"the gain may be {float(gain.at_most)!r} or more {_in_words(box)}")


def opened_at(family: Family, point: Mapping[str, Fraction]) -> contact.Opened:
    """The loop cut at a wall with these numbers, the stiffness first."""
    cell = Cell({name: (value, value) for name, value in point.items()})
    A = reduced(cell, family.frames.matrix("", cell), family.drifts)
    stiff = bool(next(iter(point.values())))
    return contact.opened_at(cell, A, family.rest, family.states, stiff, family.held)


def _graph(family: Family, times: Mapping, cell: Cell, line: dict, box):
    """Refused, unless the forms of a graph decrease along every edge, and no frame that may come lacks one.

    The walk begins at the node "start". A form is positive: it is L' L at s = 0, and stays so as long as those
    that follow do. times: of a tick, by its letter.
    """
    if line.keys() - {"nodes", "edges", "start"}:
        raise Unreadable("a graph has nodes, edges and a start alone")
    forms = _forms(family, cell, line)
    cells = {letter: Cell(box | {for_all.TICK: ends}) for letter, ends in times.items()}
    matrices: dict[str, list[form.Matrix]] = {}
    for node, letter, kind, target, _ in _walked(family, line, len(forms)):
        if kind not in matrices:
            A = family.matrix(kind, cells.get(letter, cell))
            matrices[kind] = form.control_points(A) if times else [A]
        if not all(form.decreases(forms[node], [(None, A, forms[target])]) for A in matrices[kind]):
            raise Refused(
                f"the form of node {node} does not decrease with the frame {letter} {_in_words(box)}"
            )


def _walked(
    family: Family, line: dict, nodes: int, weights: int = 0
) -> Iterator[tuple[int, str, str, int, list]]:
    """Yield the steps of a graph that frames may take from its start: node, letter, kind, next node, and further entries of the edge.

    Refused, if a frame that may come lacks an edge.
    """
    edges = {}
    for edge in _expect(line.get("edges"), list, "edges"):
        source, letter, target, *more = _expect(edge, list, "an edge", 3 + weights)
        for node in (source, target):
            if _expect(node, int, "a node") not in range(nodes):
                raise Unreadable(f"an edge has the node {node} of {nodes}")
        _expect(letter, str, "a letter")
        edges[source, letter] = target, more
    done = set()
    start = _expect(line.get("start", 0), int, "a start")
    if start not in range(nodes):
        raise Unreadable("a graph starts at one of its nodes")
    reached = {(family.start, start)}
    todo = list(reached)
    while todo:
        state, node = todo.pop()
        for letter, (kind, following, _) in family.moves[state].items():
            if (node, letter) not in edges:
                raise Refused(
                    f"the frame {letter} may come at node {node}, which has no edge of it"
                )
            target, more = edges[node, letter]
            if (node, kind, target) not in done:
                yield node, letter, kind, target, more
                done.add((node, kind, target))
            if (following, target) not in reached:
                reached.add((following, target))
                todo.append((following, target))


def _nodes(line: dict) -> list[dict]:
    nodes = _expect(line["nodes"], list, "nodes")
    if not 0 < len(nodes) <= NODES:
        raise Unreadable(f"{len(nodes)} nodes; at most {NODES}")
    return [_expect(node, dict, "a node") for node in nodes]


def _forms(family: Family, cell: Cell, line: dict) -> list[form.Matrix]:
    nodes = _nodes(line)
    for node in nodes:
        if node.keys() - {"L", "Q"}:
            raise Unreadable("a node has L and Q alone")
    return [form_from(node, cell, [1] * len(family.states)) for node in nodes]


def _chain(family: Family, cell: Cell, line: dict, box):
    """Refused, unless the forms of a chain's states decrease on average (Costa, Fragoso and Marques, 2005): then the mean of
    x' P_q x over all runs does, and with it the mean of all squares."""
    if set(line) != {"nodes"}:
        raise Unreadable("a chain has nodes alone")
    forms = dict(zip(family.moves, _forms(family, cell, line), strict=False))
    if len(forms) != len(family.moves) or len(line["nodes"]) != len(forms):
        raise Refused(f"{len(line['nodes'])} forms of {len(family.moves)} states")
    matrices = {kind: family.matrix(kind, cell) for kind in family.frames.words}
    for state, following in family.moves.items():
        steps = []
        for kind, after, chance in following.values():
            radius, *parts = chance.value(cell)
            low = parts[0] - radius - sum(map(abs, parts[1:]))
            high = parts[0] + radius + sum(map(abs, parts[1:]))
            if low < -balls.ONE >> 64 or high > balls.ONE + (balls.ONE >> 64):
                raise Refused(f"a probability that may be no probability {_in_words(box)}")
            share = form.Matrix(
                {m: [[c]] for m, c in zip(cell.ring.monomials, parts, strict=False)}, [[radius]]
            )
            steps.append((share, matrices[kind], forms[after]))
        if not form.decreases(forms[state], steps):
            raise Refused(
                f"the form of the state {state} does not decrease on average {_in_words(box)}"
            )


def _with_coordinates(claim: Claim, line: dict) -> Claim:
    drifts = [_taking_part(names) for names in _expect(line.get("drifts", []), list, "drifts")]
    states = [_expect(name, str, "a state") for name in _expect(line.get("states"), list, "states")]
    rest = []
    if "rest" in line:
        if claim.claim not in OF_WALLS:
            raise Unreadable("a rest is one of walls that let go")
        rest = _taking_part(line["rest"])
    return replace(claim, drifts=drifts, states=states, rest=rest)


def _taking_part(listed) -> list[str]:
    names = [_expect(name, str, "a name") for name in _expect(listed, list, "a drift")]
    if not names or len(set(names)) < len(names):
        raise Unreadable("a drift of nothing, or of a name twice")
    return names


def _size(box, sides) -> Fraction:
    size = Fraction(1)
    for name, (low, high) in sides.items():
        if low < high:
            size *= box[name][1] - box[name][0]
    return size


def _outside(family: Family, claim: Claim, cell: Cell, line: dict, box) -> Any:
    """How many modes are outside in a cell; None where a map says nothing."""
    if line == {"open": True}:
        if claim.outside is None and claim.claim == "modes":
            return None
        raise Refused(f"nothing is shown {_in_words(box)}")
    unknown = line.keys() - {"L", "signs", "Q", "turn"}
    if unknown:
        raise Unreadable(f"the field {min(unknown)} of a cell is not known")
    signs = [{"+": 1, "-": -1}.get(sign, 0) for sign in _expect(line.get("signs"), str, "signs")]
    if len(signs) != len(claim.states) or 0 in signs:
        raise Unreadable("the signs of a form are + and -, one for each state")
    turn = line.get("turn", 0)
    if turn not in (0, 1, -1) or isinstance(turn, bool):
        raise Unreadable("the turn of a form is 1 or -1")
    P = form_from(line, cell, signs)
    A = family.matrix("", cell)
    if signs and not form.decreases(P, [(None, A, P)], turn):
        raise Refused(f"the form {_in_words(box)} does not decrease")
    return signs.count(-1)


def form_from(line, cell: Cell, signs) -> form.Matrix:
    """The form that a line of the file gives."""
    slopes = []
    for slope in _expect(line.get("Q", []), list, "Q"):
        exponents, rows = _expect(slope, list, "a slope", 2)
        m = tuple(
            _expect(power, int, "an exponent") for power in _expect(exponents, list, "exponents")
        )
        if len(m) != cell.width or not 1 <= sum(m) <= form.KEPT or min(m) < 0:
            raise Unreadable(
                f"a slope has an exponent of each side that is wide, 1 to {form.KEPT} together"
            )
        slopes.append((m, rows_of(rows, len(signs))))
    return form.form_of(cell.width, rows_of(line.get("L"), len(signs)), signs, slopes)


def rows_of(lists, size: int) -> form.Rows:
    """A matrix of a form in units of 2^-BITS, rounded to half of these digits."""
    rows = [
        _expect(row, list, f"a row of {size}", size)
        for row in _expect(lists, list, f"a matrix of {size} rows", size)
    ]
    shift = balls.BITS - form.HALF
    return [[int(_decimal(x) * (1 << form.HALF)) << shift for x in row] for row in rows]


def _decimal(text) -> Decimal:
    """Of a form, which is what its numbers are rounded to."""
    if not isinstance(text, str) or len(text) > balls.LONGEST or not balls.DECIMAL.fullmatch(text):
        raise Unreadable(f"{text!r} is no decimal number of a form")
    value = Decimal(text)
    if abs(value.adjusted()) > balls.EXPONENT:
        raise Unreadable(f"{text} is too large or too small")
    return value


def _in_words(box) -> str:
    ends = [
        f"for {name} from {float(low)!r} to {float(high)!r}" for name, (low, high) in box.items()
    ]
    return ", ".join(ends) or "at this point"
