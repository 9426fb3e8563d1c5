"""How old the numbers of a loop are: the newest measurement in each of them, and the numbers that
forces on plants are made of.

A measurement is what a block reads of a plant. A number is what a block gives in one of its runs,
and holds until the next one. A force is made of many numbers. Each reaches it by its quickest way,
and is as old as the newest measurement in it: a filter remembers older ones too, but lets the
newest one through. With the ticks t_j in which a block runs, and the lag, the number of runs after
which an input is first felt in an output (0 with a direct term D, otherwise the least n for which C
A^(n-1) B is not zero),

    age of the output in run j    = min over inputs of  t_j - t_(j-lag) + age of the input at t_(j-lag)
    age of the output at a tick t = t - t_j + age in run j,    j the last run up to t

in ticks. Ages repeat after a frame, in which all blocks are in step again, and those of the
quickest ways are the least ones that meet these equations. With the runs of one block in place of
measurements, the same equations say which of its numbers a force is made of.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.blocks import Block
from wavesweep.engine.drawing import Drawing, DrawnBlock, scalars
from wavesweep.engine.loop import Loops


@dataclass(frozen=True, slots=True)
class Carrier:
    """The output of a block that holds numbers, or what a plant reads of plants itself.

    block: its name. every: ticks from one run to the next, on average. runs: the ticks of the frame
    in which it runs. reads: the signals that it is made of, and after how many runs. late, lost:
    the most ticks by which a message comes late, and the most in a row that never come. dead: ticks
    of a dead time; None without.
    """

    block: str
    every: float
    runs: tuple[int, ...]
    reads: tuple[tuple[str, int], ...]
    late: int = 0
    lost: int = 0
    dead: float | None = None


@dataclass(frozen=True, slots=True)
class Life:
    """A number: the measurement that it is made of, the run in which it is computed, and from when
    to when it is in a force.

    All are in ticks, and none is rounded: a dead time ends between two.
    """

    measured: float
    run: int
    start: float
    end: float

    @property
    def oldest(self) -> float:
        """Its age when the next number takes its place."""
        return self.end - self.measured

    def later(self, ticks: int) -> "Life":
        """The number of another frame, so many ticks later."""
        return Life(self.measured + ticks, self.run + ticks, self.start + ticks, self.end + ticks)

    def until(self, end: float) -> "Life":
        """The same number, held until another end."""
        return replace(self, end=end)


@dataclass(frozen=True, slots=True)
class DataFlow:
    """What is read by whom, and when.

    ticks: of the frame. tick_s: period (s) of a tick. carriers: by their signals. plants: signals
    that are outputs of plants. forces: the signals that act on each input port of a plant, but for
    those that act continuously.
    """

    ticks: int
    tick_s: float
    carriers: Mapping[str, Carrier]
    plants: frozenset[str]
    forces: Mapping[str, tuple[str, ...]]

    @staticmethod
    def of(
        drawing: Drawing, values: Mapping[str, object], late: bool = False, lost: bool = False
    ) -> "DataFlow":
        """Return the flow of a loop, compiled with its numbers.

        values: flat numbers. late, lost: whether messages come as late as they may, and as many of
        them are lost in a row.
        """
        loops = Loops(drawing, values).read
        compiled = loops.drawn()
        numbers = scalars(values)
        dead = {}
        for name, dead_time in loops.dead_times().items():
            dead[name] = dead_time.ticks - float(dead_time.share)
        before = _registers_of_impulses(drawing)
        wires = {}
        for port, terms in drawing.wires:
            gains = {signal: float(gain.values(numbers)) for signal, gain in terms}
            wires[port] = _read(gains, before)
        drawn = {block.name: block for block in drawing.blocks if not block.plant}
        carriers = {}
        for scheduled in compiled.placed:
            name = scheduled.block.name
            if name not in drawn:
                continue
            runs = tuple(np.flatnonzero(scheduled.runs(compiled.ticks)).tolist())
            carrier = Carrier(name, compiled.ticks / len(runs), runs, ())
            if name in dead:
                reads = tuple((each, 0) for each in wires.get(f"{name}.u", ()))
                carriers[f"{name}.y"] = replace(carrier, dead=dead[name], reads=reads)
                continue
            most_late, most_lost = _messages(drawn[name], numbers, round(carrier.every))
            carrier = replace(carrier, late=most_late * late, lost=most_lost * lost)
            for signal, reads in _through(scheduled.block, wires):
                carriers[signal] = replace(carrier, reads=reads)
        inputs, outputs = _ports_of_plants(drawing)
        forces = {}
        for port in inputs:
            signals = wires.get(port, ())
            measured = tuple((each, 0) for each in signals if each in outputs)
            forces[port] = tuple(each for each in signals if each not in outputs)
            if measured:  # which is held over a tick, as what a block gives in every tick
                held_port = f"{port} held"
                carriers[held_port] = Carrier(port, 1.0, tuple(range(compiled.ticks)), measured)
                forces[port] += (held_port,)
        return DataFlow(compiled.ticks, 1 / drawing.rate(values), carriers, outputs, forces)

    def up_to(self, every: float) -> "DataFlow":
        """The flow without the blocks that run less often than once in so many ticks."""
        carriers = {
            name: carrier for name, carrier in self.carriers.items() if carrier.every <= every
        }
        return replace(self, carriers=carriers)


def _registers_of_impulses(drawing: Drawing) -> dict[str, str]:
    """What each register remembers by which `prev(...)` reads an impulse: its sum, which may be
    remembered already; the sum itself is what remembers nothing."""
    wires = dict(drawing.wires)
    before = {f"{block.name}.sum": "" for block in drawing.blocks if block.type == "impulse"}
    for block in drawing.blocks:
        terms = wires.get(f"{block.name}.u", ())
        if block.name.startswith("prev(") and terms[0][0] in before:
            before[f"{block.name}.y"] = terms[0][0]
    return before


def _read(gains: dict[str, float], before: Mapping[str, str]) -> tuple[str, ...]:
    """The signals that a sum reads; of impulses those of which pulses are left.

    With S_0 the sum of an impulse, S_1 the one before and so on, g_0 S_0 + g_1 S_1 + ... has the
    pulse S_d - S_(d+1) times g_0 + ... + g_d. gains: of the signals. before: see
    `_registers_of_impulses`.
    """
    read = [signal for signal, gain in gains.items() if gain and signal not in before]
    rows = []  # of each impulse the signals S_0, S_1, ... as far as they are read
    for row in ([signal] for signal in gains if signal in before):
        while before[row[0]]:
            row.insert(0, before[row[0]])
        rows.append(row)
    for row in rows:
        if any(longer[: len(row)] == row for longer in rows if len(longer) > len(row)):
            continue
        total = 0.0
        for signal in row:
            total += gains.get(signal, 0.0)
            if total:
                read.append(signal)
    return tuple(read)


def _ports_of_plants(drawing: Drawing) -> tuple[list[str], frozenset[str]]:
    """The inputs and the outputs of the plants."""
    inputs = []
    outputs = []
    for block in drawing.blocks:
        if block.plant:
            into, out = block.ports
            inputs += [f"{block.name}.{port}" for port in into]
            outputs += [f"{block.name}.{port}" for port in out]
    return inputs, frozenset(outputs)


def _through(block: Block, wires: Mapping[str, tuple[str, ...]]) -> Iterator[tuple[str, tuple]]:
    """Yield each output signal of a block, and the signals that it is made of with their lags."""
    lags = [_lags(block, index) for index in range(len(block.inputs))]
    for index, port in enumerate(block.outputs):
        reads = []
        for source, of_source in zip(block.inputs, lags, strict=True):
            if index in of_source:
                signals = wires.get(f"{block.name}.{source}", ())
                reads += [(signal, of_source[index]) for signal in signals]
        yield f"{block.name}.{port}", tuple(reads)


def _lags(block: Block, input_number: int) -> dict[int, int]:
    """The outputs of a block in which an input is felt, and after how many runs.

    In C A^(n-1) B, A = I + E, n - 1 steps go from state to state by entries that are not zero.
    """
    A = block.E + np.eye(len(block.states))
    lags = dict.fromkeys(np.flatnonzero(block.D[:, input_number]).tolist(), 0)
    front = block.B[:, input_number] != 0
    reached = front
    lag = 1
    while front.any():
        for output in np.flatnonzero(block.C[:, front].any(axis=1)).tolist():
            lags.setdefault(output, lag)
        front = A[:, front].any(axis=1) & ~reached
        reached = reached | front
        lag += 1
    return lags


def _messages(block: DrawnBlock, numbers: Mapping[str, object], every: int) -> tuple[int, int]:
    """The most ticks by which a message of a block comes late, and the most messages in a row
    whose place an older one takes; every: ticks from one of its runs to the next.

    What shows zero without a message does so from each run on. So a message is there up to the
    first run after it arrives, and longest if it arrives in a run.
    """
    keys = dict(block.keys)
    if block.type != "channel":
        return 0, 0
    late = int(keys["late"].values(numbers))
    if keys["missing"] == "zero":
        return late - late % every, 0
    return late, int(keys["lost"].values(numbers))


class Ages:
    """The ages of measurements and of the numbers of every carrier, in every signal.

    held: of each signal the ages in every tick of the frame, `(ticks, 1 + carriers)`, infinite for
    what is not in it; the first column is of measurements. computed: of each carrier the ages in
    its runs, `(runs, 1 + carriers)`.
    """

    def __init__(self, flow: DataFlow):
        self.flow = flow
        self.column = {name: column for column, name in enumerate(flow.carriers, start=1)}
        shape = (flow.ticks, 1 + len(flow.carriers))
        measurement = np.full(shape, np.inf)
        measurement[:, 0] = 0.0
        self.held = dict.fromkeys(flow.plants, measurement)
        self.held |= {name: np.full(shape, np.inf) for name in flow.carriers}
        self.computed: dict[str, np.ndarray] = {}
        settled = False
        while not settled:
            settled = True
            for name, carrier in flow.carriers.items():
                ages = self._run(name, carrier)
                settled &= np.array_equal(ages, self.held[name])
                self.held[name] = ages

    def _run(self, name: str, carrier: Carrier) -> np.ndarray:
        """Compute a carrier's ages from those of what it reads."""
        ticks = self.flow.ticks
        runs = np.array(carrier.runs)
        ages = np.full((runs.size, 1 + len(self.flow.carriers)), np.inf)
        for signal, lag in carrier.reads:
            if signal not in self.held:
                continue
            if carrier.dead is not None:
                read = np.floor(runs - carrier.dead)
                since = runs - read
                if signal in self.flow.plants:  # which is read between two ticks
                    since = np.full(runs.size, carrier.dead)
            else:
                read = _tick_of_run(runs, np.arange(runs.size) - lag, ticks)
                since = runs - read
            of_read = self.held[signal][read.astype(int) % ticks]
            ages = np.minimum(ages, since[:, None] + of_read)
        ages[:, self.column[name]] = 0.0
        self.computed[name] = ages
        instant = np.arange(ticks) - carrier.late
        last = (
            np.searchsorted(runs, instant % ticks, side="right")
            - 1
            + runs.size * (instant // ticks)
        )
        last -= carrier.lost
        since = np.arange(ticks) - _tick_of_run(runs, last, ticks)
        return since[:, None] + ages[last % runs.size]

    def lives(self, name: str, port: str) -> list[Life]:
        """The numbers of a carrier that a force is made of in one frame, as they follow each
        other; none if it is not."""
        ticks = self.flow.ticks
        starts = []
        newest = []
        for signal in self.flow.forces[port]:
            carrier = self.flow.carriers.get(signal)
            if carrier is None:
                continue
            start = np.arange(ticks, dtype=float)
            age = self.held[signal][:, self.column[name]]
            if carrier.dead is not None and not self._senses(carrier):
                start, age = self._arriving(carrier, name)
            finite = np.isfinite(age)
            frame = np.floor(start[finite] / ticks)
            starts.append(start[finite] - ticks * frame)
            newest.append((start - age)[finite] - ticks * frame)
        if not starts or not np.concatenate(starts).size:
            return []
        start = np.concatenate(starts)
        run = np.round(np.concatenate(newest))
        order = np.lexsort((run, start))
        start = start[order]
        before = run.max() - ticks  # the newest one of the frame before
        run = np.maximum.accumulate(np.concatenate([[before], run[order]]))
        first = np.flatnonzero(np.diff(run) > 0)
        starts_of_lives = [*start[first].tolist(), float(start[first[0]]) + ticks]
        runs = self.flow.carriers[name].runs
        lives = []
        for index, number in enumerate(run[first + 1].astype(int).tolist()):
            age = self.computed[name][runs.index(number % ticks), 0]
            if np.isfinite(age):
                ends = starts_of_lives[index : index + 2]
                lives.append(Life(number - float(age), number, *ends))
        return lives

    def _senses(self, carrier: Carrier) -> bool:
        """Whether a dead time reads plants, so that what acts on a plant is read, and held over
        a tick."""
        return any(signal in self.flow.plants for signal, _ in carrier.reads)

    def _arriving(self, carrier: Carrier, name: str) -> tuple[np.ndarray, np.ndarray]:
        """When what a dead time was given in each tick arrives at a plant, and the ages of a
        carrier's numbers in it."""
        age = np.full(self.flow.ticks, np.inf)
        for signal, _ in carrier.reads:
            if signal in self.held:
                age = np.minimum(age, self.held[signal][:, self.column[name]])
        return np.arange(self.flow.ticks) + carrier.dead, age + carrier.dead


def _tick_of_run(runs: np.ndarray, number: np.ndarray, ticks: int) -> np.ndarray:
    """The ticks of runs by their numbers, those of earlier frames being negative."""
    return runs[number % runs.size] + ticks * (number // runs.size)
