"""A loop of several rates: blocks that run every so many ticks, and the junctions between them."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import lcm
from numbers import Integral
from typing import Any

import numpy as np

from wavesweep.engine._keys.key import LONGEST_FRAME
from wavesweep.engine._loops.block import Block
from wavesweep.engine.components import strong_components
from wavesweep.engine.errors import IllPosedLoopError, UsageError


@dataclass(frozen=True, slots=True, eq=False)
class ScheduledBlock:
    """A block that runs at the ticks `phase`, `phase + every`, and so on; between these its outputs
    hold.

    phase: a tick, or several ticks of the same period.
    """

    block: Block
    every: int = 1
    phase: int | tuple[int, ...] = 0

    def __post_init__(self) -> None:
        """Refuse a block that would never run, or between two ticks. Errors: UsageError."""
        phases = self.phase if isinstance(self.phase, tuple) else (self.phase,)
        whole = all(isinstance(number, Integral) for number in (self.every, *phases))
        if not (whole and phases and all(0 <= phase < self.every for phase in phases)):
            raise UsageError(
                f"block {self.block.name}: expected every >= 1 and phases from 0 on and below it, whole numbers, found every = "
                f"{self.every!r}, phase = {self.phase!r}"
            )

    def runs(self, ticks: int) -> np.ndarray:
        """Whether it runs in each of the first ticks, `(ticks,)`, read-only."""
        return _runs(self.every, self.phase, ticks)


@lru_cache(maxsize=256)
def _runs(every: int, phase: int | tuple[int, int, int], ticks: int) -> np.ndarray:
    runs = np.isin(np.arange(ticks) % every, phase)
    runs.flags.writeable = False
    return runs


@dataclass(frozen=True, slots=True, eq=False)
class MultirateLoop:
    """Blocks placed on a common tick, and the loop that they make.

    period: of the tick (s), a number or an array over the batch. sums: junctions by the signal that
    they make: source signal -> gain (a number or an array over the batch); a port is the signal
    "block.port". inputs: signals from outside. All blocks that run in the same tick see each
    other's outputs of that tick. exact: gives the equations at rest of some of the blocks in exact
    numbers (see `equations_of`); None if the entries of the blocks are all that is known. rate:
    ticks per second (Hz) as it was given, from which 1/period may differ in the last bit; by
    default 1/period. Errors: UsageError for a frame of more than LONGEST_FRAME ticks.
    """

    period: Any
    placed: tuple[ScheduledBlock, ...]
    sums: Mapping[str, Mapping[str, np.ndarray | float]]
    inputs: tuple[str, ...] = ()
    exact: Callable[[Sequence[Block]], Any] | None = None
    rate: np.ndarray | float | None = None
    ticks: int = field(init=False)

    def __post_init__(self) -> None:
        ticks = lcm(*(scheduled.every for scheduled in self.placed))
        if ticks > LONGEST_FRAME:
            raise UsageError(
                f"the frame, after which all blocks are in step again, has {ticks} ticks, expected at most {LONGEST_FRAME}; "
                "choose rates with a larger common divisor"
            )
        object.__setattr__(self, "ticks", ticks)

    def __repr__(self) -> str:
        """The blocks, the ticks of a frame and the inputs."""
        blocks = ", ".join(scheduled.block.name for scheduled in self.placed)
        inputs = ", ".join(self.inputs) or "no inputs"
        return f"<MultirateLoop: {blocks}; frame of {self.ticks} ticks; {inputs}>"

    def labels(self) -> dict[str, str]:
        """Readable labels of the states of blocks and of outputs that are held, by their names
        in `MarginalModes`."""
        readable_labels = {}
        for scheduled in self.placed:
            block = scheduled.block
            readable = block.labels or [f"{block.name} {state}" for state in block.states]
            for state, label in zip(block.states, readable, strict=True):
                readable_labels[f"{block.name}.{state}"] = label
            # nothing else of it could be meant
            alone = len(block.outputs) == 1 and not block.states
            for port in block.outputs:
                output = block.name if alone else f"{block.name} {port}"
                readable_labels[f"{block.name}.{port} held"] = f"{output} held"
        return readable_labels

    def sources(self, signal: str) -> set[str]:
        """The block outputs and inputs from outside that a signal is made of."""
        ends = set()
        open_ = [signal]
        while open_:
            name = open_.pop()
            if name in self.sums:
                open_ += self.sums[name]
            else:
                ends.add(name)
        return ends

    def rings(self) -> list[list[str]]:
        """The blocks of each algebraic loop, in which what they read depends on what they give;
        only the largest ones."""
        rings = []
        for running in self.schedule()[0]:
            for ring in self._rings(running):
                if ring not in rings:
                    rings.append(ring)
        return [ring for ring in rings if not any(set(ring) < set(larger) for larger in rings)]

    def direct_blocks(self) -> list[str]:
        """Names of the blocks on loops of direct terms, which are closed within a tick."""
        return list(dict.fromkeys(name for ring in self.rings() for name in ring))

    @contextmanager
    def naming_blocks(self) -> Iterator[None]:
        """Name the blocks of an algebraic loop that turns out to have no solution. Errors:
        IllPosedLoopError."""
        try:
            yield
        except IllPosedLoopError as error:
            blocks = ", ".join(self.direct_blocks()) or "the wires"
            raise IllPosedLoopError(
                f"the loop of direct terms through {blocks} has no solution, or none that double precision can find; "
                "put a delay or a hold into it, or change the gain that closes it"
            ) from error

    def _rings(self, running: Iterable[int]) -> Iterator[list[str]]:
        """Those among blocks (indices) that run together, by the terms that are not zero: the
        strong components of the graph of what signals depend on."""
        blocks = [self.placed[index].block for index in running]
        reads = self._direct_reads(blocks)
        place = {signal: number for number, signal in enumerate(reads)}
        direct = np.zeros((len(reads), len(reads)), bool)
        for signal, sources in reads.items():
            direct[place[signal], [place[source] for source in sources if source in place]] = True
        owners = [signal.rpartition(".")[0] for signal in reads]
        for ring in sorted(strong_components(direct)):
            if len(ring) > 1 or direct[ring[0], ring[0]]:
                inside = {owners[number] for number in ring}
                yield [block.name for block in blocks if block.name in inside]

    def _direct_reads(self, blocks: list[Block]) -> dict[str, list[str]]:
        """Signal -> the signals that it depends on within a tick in which these blocks run."""
        reads = {}
        for name, terms in self.sums.items():
            reads[name] = [source for source, gain in terms.items() if np.any(gain)]
        for block in blocks:
            direct = np.any(block.D, axis=tuple(range(block.D.ndim - 2)))
            for port, row in zip(block.outputs, direct, strict=True):
                inputs = [block.inputs[index] for index in np.flatnonzero(row)]
                reads[f"{block.name}.{port}"] = [f"{block.name}.{name}" for name in inputs]
        return reads

    def living(self, watched: Sequence[str]) -> "MultirateLoop":
        """The same without the blocks of which nothing is read, by a block that remains or as one
        of the signals `watched`.

        A block that is a loop in itself remains.
        """
        ports = _port_names([scheduled.block for scheduled in self.placed], "inputs")
        read: set[str] = set()
        for signal in (*ports, *watched):
            read.update(source.rpartition(".")[0] for source in self.sources(signal))
        remaining = []
        for scheduled in self.placed:
            if scheduled.block.name in read or scheduled.block.ring:
                remaining.append(scheduled)
        if len(remaining) == len(self.placed):
            return self
        return replace(self, placed=tuple(remaining)).living(watched)

    def schedule(self) -> tuple[list[tuple[int, ...]], np.ndarray]:
        """The different sets of blocks (indices) that run in a tick, and the number of the set
        of each tick of the frame."""
        rhythms = tuple((scheduled.every, scheduled.phase) for scheduled in self.placed)
        sets, set_numbers = _schedule(rhythms, self.ticks)
        return list(sets), set_numbers

    def held(self, watched: Sequence[str] = ()) -> dict[str, list[str]]:
        """Block -> its output ports that something reads in a tick in which the block does not run.

        watched: signals that are read in every tick.
        """
        runs = {scheduled.block.name: scheduled.runs(self.ticks) for scheduled in self.placed}
        readings = [(np.ones(self.ticks, bool), signal) for signal in watched]
        for scheduled in self.placed:
            block = scheduled.block
            for port in block.inputs:
                readings.append((runs[block.name], f"{block.name}.{port}"))
        held_signals = set()
        for is_read, signal in readings:
            for source in self.sources(signal):
                name = source.rpartition(".")[0]
                if name in runs and np.any(is_read & ~runs[name]):
                    held_signals.add(source)
        held_ports = {}
        for scheduled in self.placed:
            block = scheduled.block
            ports = [port for port in block.outputs if f"{block.name}.{port}" in held_signals]
            held_ports[block.name] = ports
        return held_ports


@lru_cache(maxsize=64)
def _schedule(
    rhythms: tuple[tuple[int, int | tuple[Any, ...]], ...], ticks: int
) -> tuple[tuple[tuple[Any, ...], ...], np.ndarray]:
    masks = np.stack([_runs(*rhythm, ticks) for rhythm in rhythms], axis=1)
    sets, set_numbers = np.unique(masks, axis=0, return_inverse=True)
    set_numbers = set_numbers.reshape(-1)
    set_numbers.flags.writeable = False
    return tuple(tuple(np.flatnonzero(row).tolist()) for row in sets), set_numbers


def _port_names(blocks: list[Block], side: str) -> set[str]:
    """The ports of blocks on one side, their inputs or outputs."""
    return {f"{block.name}.{port}" for block in blocks for port in getattr(block, side)}
