"""The registers that `prev(...)` reads: the blocks that they are, and when each of them runs.

`prev(SIGNAL)` is the signal as it was before the tick, the output of a delay of one tick. What an
output holds between two runs is the same before the tick as it was in the last run, so that the
register may run with its block if all that read it do. An `impulse` is 0 between its runs: of it a
block that runs in the same ticks reads what it gave in the last run, and whatever else reads it
reads the value before the tick. So each of the two has a register of its own, and what one reader
gets does not depend on the others, nor on how periods are written.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from wavesweep.engine._drawing.drawn_block import DrawnBlock, Plant
from wavesweep.engine._drawing.expressions import ONE, Terms, Tree

Wires = tuple[tuple[str, Terms], ...]
PULSES = "impulse"  # the type of blocks whose outputs are 0 between their runs


@dataclass(frozen=True, slots=True)
class _Clock:
    """When a register runs, and the first block that reads it then."""

    every: Tree
    phase: Tree
    reader: str = ""

    @property
    def text(self) -> tuple[str, str]:
        """Texts of the period and the phase, which are the same for the same clock."""
        return self.every.text, self.phase.text


EVERY_TICK = _Clock(ONE, Plant.phase)


@dataclass
class _Register:
    """What a register remembers: a signal, or the output of another register, and of which block
    at the end of such a row. clocks: those of its readers, by their texts."""

    signal: str
    source: DrawnBlock | None
    clocks: dict[tuple[str, str], _Clock] = field(default_factory=dict)

    @property
    def pulses(self) -> bool:
        """Whether the signal is that of an impulse."""
        return self.source is not None and self.source.type == PULSES


def with_registers(
    blocks: tuple[DrawnBlock, ...],
    wires: Wires,
    shown: Iterable[Terms | None],
    remembered: Mapping[str, str],
) -> tuple[tuple[DrawnBlock, ...], Wires]:
    """Return the blocks and the wires of a drawing with those of the registers that are read.

    shown: terms that are read in every tick, in addition to those of wires. remembered: the output
    of each register, by which wires call it, and the signal in it.
    """
    placed = {block.name: block for block in blocks}
    registers = {}
    for output, signal in remembered.items():
        first = signal
        while first in remembered:
            first = remembered[first]
        registers[output] = _Register(signal, placed.get(_block_of(first)))

    def clock_of(output: str, reader: DrawnBlock | None) -> _Clock:
        register = registers[output]
        if register.source is None or reader is None:
            return EVERY_TICK
        if register.pulses:
            return _with_pulses(register.source, reader)
        is_own = register.signal not in registers and _ticks(reader) == _ticks(register.source)
        return _Clock(register.source.every, register.source.phase) if is_own else EVERY_TICK

    readers = [(placed.get(_block_of(port)), terms) for port, terms in wires]
    readers += [(None, terms or ()) for terms in shown]
    for reader, terms in readers:
        for output, _ in terms:
            if output in registers:
                clock = clock_of(output, reader)
                while output in registers:
                    registers[output].clocks.setdefault(clock.text, clock)
                    output = registers[output].signal  # noqa: PLW2901 - the one behind it
    for register in registers.values():
        if len(register.clocks) > 1 and not register.pulses:
            register.clocks = {EVERY_TICK.text: EVERY_TICK}

    def name_of(output: str, clock: _Clock) -> str:
        """The output of the register with this clock; of a signal that is none the signal."""
        if output not in registers:
            return output
        clocks = registers[output].clocks
        if len(clocks) == 1 or clock.text == EVERY_TICK.text:
            return output
        return f"{_block_of(output)} in {clocks[clock.text].reader}.y"

    named = []
    for port, terms in wires:
        reader = placed.get(_block_of(port))
        renamed = []
        for signal, gain in terms:
            is_register = signal in registers
            name = name_of(signal, clock_of(signal, reader)) if is_register else signal
            renamed.append((name, gain))
        named.append((port, tuple(renamed)))
    made = []
    for output, register in registers.items():
        for clock in register.clocks.values():
            name = _block_of(name_of(output, clock))
            made.append(DrawnBlock(name, "delay", (("steps", ONE),), clock.every, clock.phase))
            named.append((f"{name}.u", ((name_of(register.signal, clock), ONE),)))
    return (*blocks, *made), tuple(named)


def _with_pulses(source: DrawnBlock, reader: DrawnBlock) -> _Clock:
    """When a register of an impulse runs for a block: with the impulse if both run in the same
    ticks, which their numbers say, otherwise in every tick.

    Of numbers that may be axes, 0**x is 1 for x = 0 and else 0.
    """
    apart = _squared(reader.every - source.every) + _squared(reader.phase - source.phase)
    if _ticks(source) == _ticks(reader) or (not apart.names and apart.finite_value({}) == 0):
        return _Clock(source.every, source.phase, reader.name)
    if not apart.names:
        return EVERY_TICK
    together = Tree("**", (Tree.number(0.0), apart))
    every = ONE + together * (source.every - ONE)
    return _Clock(every, together * source.phase, reader.name)


def _squared(tree: Tree) -> Tree:
    return tree * tree


def _ticks(block: DrawnBlock) -> tuple[str, str]:
    """Texts of the period and the phase of a block."""
    return block.every.text, block.phase.text


def _block_of(name: str) -> str:
    return name.rpartition(".")[0]
