"""From instants with their equations to the matrix of a frame: memory after it, of memory before it.

A map is {memory: {memory: coefficient}}, a row for each memory that it changes; what has no row stays. A frame is a list of
steps, each a map. Those that depend on no side of a cell are multiplied once.

A frame goes through its instants in order; at each the equations of what happens there are solved together and the memory is
written, and between two instants plants move by exp(A t) with all else held. The memory of a loop is what some frame reads before
it writes it; what each instant writes as 0 is left out. The states of a form are the memory less the first of each drift, sorted.
"""

from fractions import Fraction
from math import factorial

from .balls import (
    BITS,
    POINT,
    UNIT,
    Cell,
    Number,
    Refused,
    add,
    ball,
    least,
    number,
)
from .reader.loops import INPUT, OUTPUT, Instant, Schedule, Unreadable, instants_of

LARGEST = 200  # memory of a loop
LONGEST = 1000  # inputs and outputs of a frame beside it
INSTANTS = 20_000  # of a frame
BLOCK = 4  # terms of the series of an exponential that are multiplied with the same power


def _read_for(rows: dict[str, dict], writes: dict[str, dict]) -> dict[str, dict]:
    """The equations of the signals that memory is written from, and of those that these read, by name."""
    needed: set[str] = set()
    waiting = [name for terms in writes.values() for name in terms]
    while waiting:
        name = waiting.pop()
        if name in rows and name not in needed:
            needed.add(name)
            waiting += rows[name]
    return {name: rows[name] for name in sorted(needed)}


def solved(instant: Instant) -> dict[str, dict[str, Number]]:
    """Memory that is written, over memory before: the equations of the instant solved, inputs from outside left out.

    Exact coefficients stay exact as far as possible, so that what cancels is not there.
    """
    rows = {name: _clean(terms) for name, terms in instant.equations.items()}
    for terms in (*instant.equations.values(), *instant.writes.values()):
        for name in terms:
            if name not in rows and not name.startswith(("@", "!")):
                raise Unreadable(f"nothing gives {name!r}")
    rows = _read_for(rows, instant.writes)
    unsolved = set(rows)
    while unsolved:  # those first that wait for nobody
        name = min(
            unsolved,
            key=lambda signal: (
                sum(k in unsolved for k in rows[signal]),
                signal in rows[signal],
                signal,
            ),
        )
        unsolved.discard(name)
        loop_gain = rows[name].pop(name, None)
        if loop_gain is not None:
            rows[name] = {k: c / (1 - loop_gain) for k, c in rows[name].items()}
        for reader, row in rows.items():
            if reader != name and name in row:
                share = row.pop(name)
                rows[reader] = _clean(_sum(row, share, rows[name]))
    written = {}
    for name, terms in instant.writes.items():
        total: dict[str, Number] = {}
        for k, c in _clean(terms).items():
            total = _sum(total, c, rows.get(k, {k: number(1)}))
        written[name] = _clean(total)
    return written


def _clean(terms) -> dict[str, Number]:
    numbers = {name: number(c) for name, c in terms.items() if not name.startswith("!")}
    return {name: c for name, c in numbers.items() if c}


def _sum(row, factor, addend):
    total = dict(row)
    for name, c in addend.items():
        term = factor * c
        total[name] = total[name] + term if name in total else term
    return total


class Written:
    """The step of an instant."""

    def __init__(self, rows: dict[str, dict[str, Number]]):
        self.rows = rows
        self.reads = {name: set(row) for name, row in rows.items()}
        self.moves = any(c.moves for row in rows.values() for c in row.values())

    def map(self, cell: Cell):
        return {name: {k: c.value(cell) for k, c in row.items()} for name, row in self.rows.items()}


class Flow:
    """The step between instants: exp(G) of the motion times its duration, by its series and squarings.

    E = exp(G/2^k) - 1 with |G|/2^k below 1/16 in the largest sum of a row, so the series leaves out less than twice the first term
    that is left out; then k times (1 + E)^2 - 1 = 2 E + E E. What is 1 or 0 by the structure of G stays so.
    """

    def __init__(self, motion: dict[str, dict[str, Number]], duration: Number):
        self.exponent = {  # G
            name: {k: c * duration for k, c in row.items()} for name, row in motion.items()
        }
        reached = {name: set(row) for name, row in self.exponent.items()}
        while True:
            further = {
                name: row.union(*(reached.get(k, ()) for k in row)) for name, row in reached.items()
            }
            if further == reached:
                break
            reached = further
        self.pattern = reached  # of E: what each row of G, G^2, ... reads
        self.reads = {name: {name, *row} for name, row in reached.items()}  # of exp(G) = 1 + E
        self.moves = any(c.moves for row in self.exponent.values() for c in row.values())

    def map(self, cell: Cell):
        G = {
            name: {k: c.value(cell) for k, c in row.items()} for name, row in self.exponent.items()
        }
        halvings = max(0, _size(G).bit_length() - BITS + 4)
        if halvings > 30:
            raise Refused("a plant that moves too fast for its tick")
        G = {
            name: {k: _divided(c, 1 << halvings) for k, c in row.items()} for name, row in G.items()
        }
        size = _size(G)  # below 1/16, so that terms from the k-th on are below twice its bound
        count = BLOCK
        while 2 * size**count > factorial(count) << BITS * (count - 1):
            count += BLOCK
        powers = [G]
        for _ in range(1, BLOCK):
            powers.append(_times(cell, powers[-1], G))
        held = {k for row in G.values() for k in row} - G.keys()  # what moves others and not itself
        constant: tuple[int, ...] = (0, 0)
        E: dict[str, dict[str, tuple]] = {name: {} for name in G}
        for first in range(count - BLOCK, -1, -BLOCK):  # Horner's scheme in the last power
            E = _times(cell, powers[-1], E | {k: {k: constant} for k in held})
            constant = ball(Fraction(1, factorial(first)))
            for name, row in E.items():
                if first:
                    row[name] = add(row.get(name, (0, 0)), constant)
                for place, power in enumerate(powers[:-1], first + 1):
                    for k, c in power[name].items():
                        row[k] = add(row.get(k, (0, 0)), _divided(c, factorial(place)))
        rest = (1, 0)
        E = {
            name: {k: add(E[name].get(k, (0, 0)), rest) for k in row}
            for name, row in self.pattern.items()
        }
        for _ in range(halvings):
            squared = _times(cell, E, E)
            for name, row in E.items():
                for k, c in row.items():
                    twice = (2 * c[0], *(2 * entry for entry in c[1:]))
                    row[k] = add(twice, squared[name].get(k, (0, 0)))
        return {name: {**row, name: add(row.get(name, (0, 0)), UNIT)} for name, row in E.items()}


def _size(rows) -> int:
    """The largest sum of a row."""
    return max(
        (sum(abs(part) for c in row.values() for part in c) for row in rows.values()), default=0
    )


def _divided(c, n: int):
    return -(-c[0] // n) + len(c), *(part // n for part in c[1:])


def _times(cell: Cell, rows, table):
    """The product of two square tables."""
    return {name: _row(cell, row, table, lambda _: {}) for name, row in rows.items()}


def _row(cell: Cell, row, table, missing):
    """A row times a table. missing: gives the row of the table for a name without one."""
    total: dict[str, tuple] = {}
    for k, c in row.items():
        for further, e in (table[k] if k in table else missing(k)).items():
            term = cell.ring.multiply(c, e)
            total[further] = add(total[further], term) if further in total else term
    return total


class Frames:
    """Kinds of frames over one memory: of each the list of its steps, and their matrices in cells.

    words: {name of a frame: steps}. The memory is what some frame reads before it writes it, whichever frame comes next, and
    outputs.
    """

    def __init__(self, words: dict[str, list[Written | Flow]]):
        live: set[str] = {
            name
            for steps in words.values()
            for step in steps
            for row in step.reads.values()
            for name in row
        }
        shown = {
            name
            for steps in words.values()
            for step in steps
            for name in step.reads
            if name.startswith(OUTPUT)
        }
        live |= shown
        while True:  # what is written before it is read needs not be kept
            before = {name for steps in words.values() for name in _needed(steps, live)[0]}
            before |= shown
            if before == live:
                break
            live = before
        outside = sum(name.startswith((INPUT, OUTPUT)) for name in live)
        if len(live) - outside > LARGEST or outside > LONGEST:
            raise Unreadable(
                f"a memory of {len(live) - outside} values, and {outside} inputs and outputs of a frame; "
                f"at most {LARGEST}, and {LONGEST}"
            )
        self.live = live
        self.cell = POINT
        self.still: dict[Written | Flow, dict] = {}  # maps of steps that depend on no side
        self.maps: dict[Written | Flow, dict] = {}  # of the others in the cell
        self.words = {name: self._gathered(steps) for name, steps in words.items()}

    def _gathered(self, steps):
        """Steps in a row that depend on no side as one map, of what is wanted after it: [(step or map, wanted after it)]."""
        wanted = _needed(steps, self.live)[1:]
        still_steps = {step for step in steps if not step.moves} - self.still.keys()
        self.still |= {step: step.map(POINT) for step in still_steps}
        gathered: list[tuple] = []
        still = None
        for step, after in zip(steps, wanted, strict=True):
            if step.moves:
                gathered += [(still[0], still[1])] if still else []
                gathered.append((step, after))
                still = None
            else:
                now = self.still[step]
                still = (_after(POINT, still[0], now, after) if still else now, after)
        return gathered + ([still] if still else [])

    def matrix(self, name: str, cell: Cell) -> dict[str, dict[str, tuple]]:
        """The rows of a frame's matrix over all memory."""
        moving = {step for step, _ in self.words[name] if not isinstance(step, dict)}
        if cell is not self.cell:
            self.cell, self.maps = cell, {}
        self.maps |= {step: step.map(cell) for step in moving - self.maps.keys()}
        factors = []
        for step, after in self.words[name]:
            now = step if isinstance(step, dict) else self.maps[step]
            factors.append((now, after))
        total = _in_a_row(cell, factors, {}) if factors else {}
        return {row: total.get(row, {row: UNIT}) for row in self.live}


def _in_a_row(cell: Cell, factors: list[tuple[dict, frozenset[str]]], done: dict) -> dict:
    """The map of some maps one after the other, each with what is wanted after it. done: those in a row that were multiplied, as
    what comes again is multiplied once."""
    if len(factors) == 1:
        return factors[0][0]
    key = tuple((id(now), after) for now, after in factors)
    if key not in done:
        half = 1 << ((len(factors) - 1).bit_length() - 1)
        first = _in_a_row(cell, factors[:half], done)
        then = _in_a_row(cell, factors[half:], done)
        done[key] = _after(cell, first, then, factors[-1][1])
    return done[key]


def _needed(steps, live) -> list[frozenset[str]]:
    """The memory that is wanted before each step, and after the last one."""
    wanted = [frozenset(live)]
    for step in reversed(steps):
        wanted.append(frozenset(k for name in wanted[-1] for k in step.reads.get(name, (name,))))
        if len(wanted[-1]) > 2 * LARGEST + LONGEST:  # also what is written before a frame ends
            raise Unreadable(f"a memory of more than {LARGEST} values")
    return wanted[::-1]


def _after(cell: Cell, first, then, wanted):
    """The map of `then` after `first`, of what is wanted."""
    composed = {name: row for name, row in first.items() if name in wanted and name not in then}
    for name, row in then.items():
        if name in wanted:
            composed[name] = _row(cell, row, first, lambda k: {k: UNIT})
    return composed


def steps_of(schedules: dict[str, Schedule]) -> dict[str, list[Written | Flow]]:
    """The steps of periods of one loop in order.

    Memory to which each of them writes 0 and nothing else, as what a hand exerts, is 0 after the first one and left out.
    """
    for schedule in schedules.values():
        if len(schedule.times) > INSTANTS:
            raise Unreadable(f"a frame of {len(schedule.times)} instants; at most {INSTANTS}")
    rows = {key: solved(instant) for key, instant in instants_of(schedules.values()).items()}
    names = set.intersection(
        *(
            {k for _, kind in schedule.times for k in rows[id(schedule.kinds[kind])]}
            for schedule in schedules.values()
        )
    )
    silent = {name for name in names if not any(each.get(name) for each in rows.values())}
    written = {key: Written(_without(each, silent)) for key, each in rows.items()}
    flows: dict[tuple, Flow] = {}
    return {name: _in_order(schedule, written, flows) for name, schedule in schedules.items()}


def _in_order(schedule: Schedule, written: dict[int, Written], flows) -> list[Written | Flow]:
    """The steps of a period. written: of instants by their identity; flows: those that there are already."""
    motion = id(schedule.motion)
    steps: list[Written | Flow] = []
    ends = [time for time, _ in schedule.times[1:]] + [schedule.period]
    for (time, kind), until in zip(schedule.times, ends, strict=True):
        steps.append(written[id(schedule.kinds[kind])])
        duration = number(until - time)
        if duration and least(duration) <= 0:
            raise Unreadable(
                "instants whose order is not the same in the whole of a range of dead times"
            )
        if duration and written[motion].rows:
            key = motion, frozenset(duration.exact.items())
            if key not in flows:
                flows[key] = Flow(written[motion].rows, duration)
            steps.append(flows[key])
    return steps


def _without(rows, silent):
    return {
        name: {k: c for k, c in row.items() if k not in silent}
        for name, row in rows.items()
        if name not in silent
    }


def states_of(frames: Frames, drifts) -> list[str]:
    """The memory that is left: without a memory of each drift, and without what no frame reads."""
    gone = {next(iter(v)) for v in drifts}
    return sorted(frames.live - gone)
