"""A tick as sums of products, in an order in which each number is there before it is read.

What goes round within a tick is solved: some of the numbers on the way are taken as zero, which
shows what the others add to them, and a linear equation gives their values. `TickSums` has a
program for each set of blocks that run together.
"""

from collections.abc import Collection, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.simulation.laws import Sum
from wavesweep.simulation.running_blocks import (
    DEPTH,
    FORCE,
    POSITION,
    SPEED,
    VELOCITY,
    MarchedLoop,
    Rhythm,
    RunningBlock,
    Wall,
)

Line = tuple[int, tuple[tuple[float, int], ...]]
"""A place, and the factors and places of the sum that is put there."""
Sums = Mapping[str, Sum]
# relative rounding of the share of a number that comes back within the tick
TICK_SHARE_ROUNDING = 2.0**-50
# of its open response: below this share a wall's depth does not depend on its force, but for
# rounding
OPEN = 1e-12


class Meeting(NamedTuple):
    """How a wall is met in a tick: its depth and speed with the force F are `depth + yields F`
    and `speed + slows F`."""

    K: float
    B: float
    yields: float
    slows: float
    position: float | None
    pulls: bool = True

    def force(self, depth: float, speed: float) -> tuple[float, bool]:
        """Return the force (N) and whether the wall is touched, of a depth (m) and a speed (m/s)
        without the force.

        A one-sided wall fills depths above its position. Pressed, the force is that of spring and
        damper; it is if the depth with this force is above the position. Free, the force is 0.
        Between the two the damper alone would throw out what arrives, and let in what does not
        touch: the depth stays at the position, with the part of the damper's force that keeps it
        there. One that does not pull has the force of both, cut off at 0.
        """
        gap = depth if self.position is None else depth - self.position
        # Of spring and damper, at the depth and the speed that they leave.
        force = (self.K * gap + self.B * speed) / (1.0 - self.K * self.yields - self.B * self.slows)
        if not self.pulls:
            return (force, True) if force > 0.0 else (0.0, False)
        pressed = gap * (1.0 - self.B * self.slows) + self.yields * self.B * speed > 0.0
        if self.position is None or pressed:
            return force, True
        if gap > 0.0 and self.yields < 0.0:
            return -gap / self.yields, True
        return 0.0, False


class Program(NamedTuple):
    """A tick: lines up to the wall, how it is met (None if its force is not computed), lines after
    it, and what is kept.

    moves: (source, first, last) of rows of places that move on by one. limits: (low, high) of
    places. stops: lines of `keeps` that leave a place as it is, with the places of a number before
    and behind its limit, and of what drives it.
    """

    first: list[Line]
    wall: Meeting | None
    second: list[Line]
    keeps: list[Line]
    moves: list[tuple[int, int, int]]
    limits: dict[int, tuple[float, float]]
    stops: list[tuple[int, int, int, int]]


def arrived(signal: str) -> str:
    """The name of a slow result as it has arrived."""
    return f"{signal} arrived"


def besides(port: str) -> str:
    """The name of what acts on a plant's port besides the inputs from outside."""
    return f"{port} besides"


def actual(port: str) -> str:
    """The name of a port of the device as it is, and not as it is measured."""
    return f"{port} actual"


def run(lines: Iterable[Line], z: list, limits: Mapping[int, tuple[float, float]]) -> None:
    """Compute lines in their order; each sum begins with 0, adds product after product, and ends
    at its limits."""
    for target, terms in lines:
        total = 0.0
        for factor, source in terms:
            total += factor * z[source]
        if target in limits:
            low, high = limits[target]
            total = low if total < low else min(total, high)
        z[target] = total


def keep(program: Program, z: list) -> None:
    """Put what a tick keeps in its places, all of it from the numbers as they were before."""
    kept_rows = []
    for _, terms in program.keeps:
        total = 0.0
        for factor, source in terms:
            total += factor * z[source]
        kept_rows.append(total)
    for line, free, limited, driven in program.stops:
        if (z[free] > z[limited] and z[driven] > 0.0) or (z[free] < z[limited] and z[driven] < 0.0):
            kept_rows[line] = z[program.keeps[line][0]]
    for (target, _), total in zip(program.keeps, kept_rows, strict=True):
        z[target] = total
    for source, first, last in program.moves:
        z[first + 1 : last] = z[first : last - 1]
        z[first] = z[source]


class TickSums:
    """The programs of a loop, whose numbers have places in a row, by their names: ports, signals,
    states.

    host: plants that are moved by somebody else. late: signals that are read by others as they have
    arrived, see `arrived`.
    """

    def __init__(
        self, loop: MarchedLoop, host: Collection[str] = (), late: Collection[str] = ()
    ) -> None:
        self.loop = loop
        self.host = host
        self.late = frozenset(late)
        self.sent = {f"{name}.y" for name in loop.channels}
        self.places: dict[str, int] = {}
        self.blocks = [block for block in loop.blocks if block.name not in host]
        for block in self.blocks:  # a row that moves has its places side by side
            for _, names in block.law.moves:
                for name in names:
                    self.place(f"{block.name}.{name}")
        sets: dict[tuple[RunningBlock, ...], int] = {}
        self.kinds = []  # of each tick of a frame, the number of the set of blocks that run in it
        for k in range(loop.frame):
            running = tuple(block.in_tick(k) for block in self.blocks if block.rhythm.runs(k))
            self.kinds.append(sets.setdefault(running, len(sets)))
        self.sets = list(sets)
        self._programs = {}

    def place(self, name: str) -> int:
        """The place of a number."""
        return self.places.setdefault(name, len(self.places))

    def program(self, k: int, arriving: frozenset[str], touching: bool) -> Program:
        """The program of tick k, in which these late signals arrive at once; touching: whether the
        wall is.

        Errors: IllPosedLoopError if what goes round within the tick has no solution, or several.
        """
        key = self.kinds[k % self.loop.frame], arriving, touching
        if key not in self._programs:
            self._programs[key] = self._made(*key)
        return self._programs[key]

    def _of_device(self, terms: Sum) -> Sum:
        """A sum in which outputs of the device are what it does, and not what is sensed of it."""
        found = []
        for gain, name in terms:
            block = name.rpartition(".")[0]
            found.append((gain, actual(name) if block in self.host else name))
        return tuple(found)

    def _made(self, kind: int, arriving: frozenset[str], touching: bool) -> Program:
        running = self.sets[kind]
        wires = self.loop.wires if touching else self.loop.away
        sums = {}
        keeps = {}
        moves = []
        limits = {}
        stops = {}
        for block in running:
            law = block.law if touching else block.away
            for name in block.inputs:
                port = f"{block.name}.{name}"
                sums[port] = self._read(wires.get(port, ()), block.rhythm.slow)
            for terms_of_law, lines in ((law.gives, sums), (law.keeps, keeps)):
                for name, terms in terms_of_law.items():
                    lines[f"{block.name}.{name}"] = _named(block, terms)
            limits |= {f"{block.name}.{name}": pair for name, pair in law.limits.items()}
            for name, sources in law.stops.items():
                stops[f"{block.name}.{name}"] = [f"{block.name}.{source}" for source in sources]
            for source, names in law.moves:
                first = self.place(f"{block.name}.{names[0]}")
                moves.append((self.place(f"{block.name}.{source}"), first, first + len(names)))
        self._add_pushed_apart(sums, wires)
        for name in self.loop.signals:
            if name in (POSITION, VELOCITY):
                sums[name] = self._of_device(wires[name])
            else:
                sums[name] = self._read(wires[name], slow=False)
        for name in sorted(arriving):
            sums[arrived(name)] = ((1.0, name),)
        sums = {name: tuple(term for term in terms if term[0]) for name, terms in sums.items()}
        first, met, second = self._ordered(running, sums, limits)
        limits = {self.place(name): pair for name, pair in limits.items()}
        stops_of_lines = []
        for line, name in enumerate(keeps):
            if name in stops:
                stops_of_lines.append((line, *map(self.place, stops[name])))
        first, second, kept = map(self.lines, (first, second, keeps.items()))
        return Program(first, met, second, kept, moves, limits, stops_of_lines)

    def _add_pushed_apart(self, sums, wires):
        """Let inputs of plants read what comes from outside apart from the rest."""
        for block in self.loop.blocks:
            if not block.plant:
                continue
            for name in block.inputs:
                port = f"{block.name}.{name}"
                terms = wires.get(port, ())
                pushed = [term for term in terms if term[1] in self.loop.inputs]
                rest = [term for term in terms if term not in pushed]
                sums[besides(port)] = self._read(rest, slow=False)
                if port in sums:
                    sums[port] = ((1.0, besides(port)), *pushed)

    def _ordered(self, running, sums, limits):
        """The sums in the order in which they can be computed, before and behind the wall's
        force if it is computed then."""
        wall = self.loop.wall
        if wall and {Rhythm(), *(block.rhythm for block in running)}.intersection(
            self.loop.readers(FORCE)
        ):
            slow = self.loop.wall_rhythm.slow
            sums = sums | {DEPTH: self._read(wall.depth, slow), SPEED: self._read(wall.speed, slow)}
            _refuse_limits_on_circles(limits, sums | {FORCE: ((1.0, DEPTH), (1.0, SPEED))})
            return _around(sums, wall)
        _refuse_limits_on_circles(limits, sums)
        return straight(sums)[0], None, []

    def _read(self, terms, slow):
        """A sum as a block reads it: messages as they have arrived, and if the block is not
        slow, slow results too."""
        late = self.late & self.sent if slow else self.late
        return tuple((factor, arrived(name) if name in late else name) for factor, name in terms)

    def lines(self, sums: Iterable[tuple[str, Sum]]) -> list[Line]:
        """The sums with places in place of names, without products with zero."""
        return [
            (self.place(name), tuple((gain, self.place(source)) for gain, source in terms if gain))
            for name, terms in sums
        ]


def _named(part, terms):
    return tuple((factor, f"{part.name}.{name}") for factor, name in terms)


def _refuse_limits_on_circles(limits, sums):
    """Refuse a number with limits that comes back to itself within the tick, of which no linear
    equation gives the value."""
    readers = _readers(sums) if limits else {}
    for name in limits:
        if name in _closure(readers.get(name, ()), readers):
            raise IllPosedLoopError(
                f"{name}: what it gives comes back to it within the tick, where limits may leave several values or none; "
                "expected a delay on the way, as of a controller that computes in one tick and acts in the next"
            )


def _torn(sums: Sums) -> tuple[list[str], list[str], dict[str, list[str]]]:
    """The numbers whose equations are to be solved, the order of all others, and what these read
    of each other."""
    torn: list[str] = []
    while True:
        graph = {}
        for name, terms in sums.items():
            if name not in torn:
                graph[name] = [
                    source for _, source in terms if source in sums and source not in torn
                ]
        try:
            return torn, list(TopologicalSorter(graph).static_order()), graph
        except CycleError as error:
            rank = {name: i for i, name in enumerate(sums)}
            torn.append(min(error.args[1], key=rank.get))


def straight(sums: Sums) -> tuple[list[tuple[str, Sum]], list[str]]:
    """Return the sums in an order in which they can be computed, and the numbers t for which an
    equation is solved.

    Numbers that follow from each other in a circle are computed as `t = a + S t`, where t are some of
    them that are torn out of the circle. With 0 in place of t, the numbers before them give a, what
    comes to t alone. Then t solves `(1 - S) t = a`, and all that t moves is computed again.
    Errors: IllPosedLoopError if there is no solution.
    """
    torn, order, graph = _torn(sums)
    if not torn:
        return [(name, sums[name]) for name in order], torn
    zeros = [(name, ()) for name in torn]
    before = _closure({source for name in torn for _, source in sums[name]}, graph)
    once = [(name, sums[name]) for name in order if name in before]
    alone = [(f"{name} alone", sums[name]) for name in torn]
    solved = _solved(torn, once, alone)
    moved = _closure(torn, _readers(sums))
    again = [(name, sums[name]) for name in order if name not in before or name in moved]
    return [*zeros, *once, *alone, *solved, *again], torn


def _solved(torn, once, alone) -> list[tuple[str, Sum]]:
    """The sums that solve the equations `x = S x + alone` of the torn numbers x, `x = (1 - S)^-1 alone`.
    Errors: IllPosedLoopError if they have no solution."""
    shares = []  # columns of S: of a unit of each torn number, what comes back to all of them
    for name in torn:
        values = evaluated([*once, *alone], {name: 1.0})
        shares.append([values.get(back, 0.0) for back, _ in alone])
    share = np.array(shares, dtype=float).T
    rest = np.eye(len(torn)) - share
    least = np.linalg.svd(rest, compute_uv=False)[-1]
    if least <= TICK_SHARE_ROUNDING * (1.0 + np.abs(share).max()):
        raise IllPosedLoopError(
            f"{', '.join(torn)}: what goes round within the tick comes back as it is, so it has no single value; a delay on "
            "the way, such as that of the environment or of the local model, makes it one"
        )
    # A single one may be made from numbers with names.
    if len(torn) > 1:
        inverse = np.linalg.inv(rest).tolist()
    else:
        inverse = [[1.0 / (1.0 - shares[0][0])]]
    sources = [source for source, _ in alone]
    return [
        (name, tuple(zip(row, sources, strict=True)))
        for name, row in zip(torn, inverse, strict=True)
    ]


def _around(sums: Sums, wall: Wall):
    """The lines up to the wall, how it is met, and the lines after it."""
    before = _closure((DEPTH, SPEED), {name: [s for _, s in terms] for name, terms in sums.items()})
    upwards = {name: terms for name, terms in sums.items() if name in before}
    up, torn = straight(upwards)
    gains = evaluated(up, {FORCE: 1.0})
    alone = evaluated(up, {FORCE: 1.0}, torn)
    yields = gains[DEPTH]
    slows = gains[SPEED]
    open_ = alone[DEPTH]
    by_spring = wall.K * yields
    by_damper = wall.B * slows
    determinant = 1.0 - by_spring - by_damper
    size = 1.0 + abs(by_spring) + abs(by_damper)
    if abs(yields) <= OPEN * abs(open_):
        yields = 0.0
    grazes = wall.pulls and wall.B and yields > 0.0
    several = wall.position is not None and open_ and (determinant < -OPEN * size or grazes)
    if several or abs(determinant) <= TICK_SHARE_ROUNDING * size:
        raise IllPosedLoopError(
            "within the tick the one-sided wall is both touched and not, or neither: its force has no single value; "
            "give the environment or the local model a delay"
            if several
            else "what the wall's force moves within the tick comes back as this force: it has no single value"
        )
    changed = _closure((FORCE,), _readers(upwards))
    settled = before - (changed - {DEPTH, SPEED})
    again = {name: terms for name, terms in sums.items() if name not in settled}
    zero = [(FORCE, ())] * (len(changed) > 1)
    return (
        [*zero, *up],
        Meeting(wall.K, wall.B, yields, slows, wall.position, wall.pulls),
        straight(again)[0],
    )


def evaluated(
    lines: Iterable[tuple[str, Sum]],
    numbers: Mapping[str, float],
    known_names: Collection[str] = (),
) -> dict[str, float]:
    """The numbers of lines with these given and all others zero; known_names: numbers that lines do not
    change."""
    values = dict(numbers)
    for name, terms in lines:
        if name not in known_names:
            total = 0.0  # `sum` of Python 3.12 rounds otherwise than a program in C
            for factor, source in terms:
                total = total + factor * values.get(source, 0.0)
            values[name] = total
    return values


def _closure(names: Iterable[str], graph: Mapping[str, Iterable[str]]) -> set[str]:
    """The names, and all that can be reached from them."""
    closed = set()
    open_ = list(names)
    while open_:
        name = open_.pop()
        if name not in closed:
            closed.add(name)
            open_ += graph.get(name, ())
    return closed


def _readers(sums: Sums) -> dict[str, list[str]]:
    """The names of the sums that read each name."""
    readers: dict[str, list[str]] = {}
    for name, terms in sums.items():
        for _, source in terms:
            readers.setdefault(source, []).append(name)
    return readers
