"""A controller without its device: the programs of its ticks, what it reads, and what it gives."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

from wavesweep.engine.drawing import PORT
from wavesweep.engine.errors import UsageError
from wavesweep.simulation.laws import Sum
from wavesweep.simulation.march import Results, results_of
from wavesweep.simulation.running_blocks import (
    DEPTH,
    FORCE,
    REACTION,
    SPEED,
    MarchedLoop,
    RunningBlock,
)
from wavesweep.simulation.tick_sums import Line, Program, TickSums, arrived, besides

MOST_PRODUCTS = 50_000  # in all programs together; each is a product in the source
MOST_PROGRAMS = 1000  # kinds of ticks


class ExportedController(NamedTuple):
    """A controller without its device.

    ticks: the lines and places of its programs. programs; table: the number of the program for each
    kind of tick, for each set of slow results that are in time (bits), and for a wall that is free
    or touched. results: slow results that may be late, or that show whether the wall is touched.
    inputs, outputs: names of numbers. late: whether results may be late. places: the name in C of
    each place. beside: ports of the device that only signals from outside enter.
    """

    loop: MarchedLoop
    ticks: TickSums
    programs: list[Program]
    table: list[int]
    results: list[Results]
    inputs: list[str]
    outputs: list[str]
    late: bool
    places: dict[str, str]
    beside: dict[str, Sum]

    @property
    def outside(self) -> list[str]:
        """The signals from outside."""
        return outside_of(self.loop)


def outside_of(loop: MarchedLoop) -> list[str]:
    """The signals from outside that enter a loop."""
    return [*loop.inputs, *(signal for _, signal in loop.entries)]


def _ports_of(blocks: Iterable[RunningBlock]) -> tuple[list[str], list[str]]:
    """The inputs and the outputs of blocks."""
    inputs = []
    outputs = []
    for block in blocks:
        inputs += [f"{block.name}.{port}" for port in block.inputs]
        outputs += [f"{block.name}.{port}" for port in block.outputs]
    return inputs, outputs


def with_late_device(loop: MarchedLoop) -> MarchedLoop:
    """Return the loop with its dead times as parts of the device, as those of a PWM are: what goes
    into them is an output of the controller, and what they bring to plants is none.

    Errors: UsageError for a dead time that is not between the controller and a plant.
    """
    late = {block.name for block in loop.blocks if block.type == "dead time"}
    brought = {f"{name}.{port}" for name in late for port in ("y", "next")}
    plants = {block.name for block in loop.blocks if block.plant}

    def apart(wires):
        return {
            port: tuple(term for term in terms if port not in loop.ports or term[1] not in brought)
            for port, terms in wires.items()
        }

    for port, terms in loop.wires.items():
        block, _, kind = port.rpartition(".")
        elsewhere = {name.rpartition(".")[0] for _, name in terms if name in brought}
        if port not in loop.ports or block in plants:
            continue
        if block in late and ((kind == "sensed" and terms) or not loop.ports[port].law.moves):
            elsewhere.add(block)
        if elsewhere:
            problem = f"block.{min(elsewhere)}, which is between the ticks of a program"
            raise UsageError(
                f"export: expected dead times from the controller to plants alone, and else delays of whole steps, found {problem}"
            )
    blocks = tuple(replace(block, plant=block.plant or block.name in late) for block in loop.blocks)
    return replace(loop, blocks=blocks, wires=apart(loop.wires), away=apart(loop.away))


def _cut_off(loop: MarchedLoop, unforced: set[str]) -> MarchedLoop:
    """The loop with the wires that a controller computes: those of ports, without the ports of
    plants that it does not push."""
    wires = {}
    away = {}
    for port, terms in loop.wires.items():
        if port in loop.ports and port not in unforced:
            wires[port] = terms
    for port, terms in loop.away.items():
        if port not in unforced:
            away[port] = terms
    cut = replace(loop, wires=wires, away=away)
    if cut.wall_rhythm != loop.wall_rhythm:
        # The force against the hand reads the wall's in every tick.
        return replace(loop, wires={**wires, REACTION: loop.wires[REACTION]})
    return cut


def controller_of(loop: MarchedLoop, late: bool) -> ExportedController:
    """Return the controller of a loop, and what it reads of its device and puts there.

    late: whether its slow results may be late. Errors: see `exported`.
    """
    plants = [block for block in loop.blocks if block.plant]
    _refuse(loop, plants)
    one_sided = loop.wall is not None and loop.wall.position is not None
    results = results_of(loop) if late or one_sided else []
    # Results in time change no program; a one-sided wall shows with them whether it is touched.
    late_results = results if late else []
    outside = outside_of(loop)
    ports, sensed = _ports_of(plants)
    pushed = [port for port in ports if _is_pushed(loop, port, outside)]
    unforced = set(ports).difference(pushed)
    cut = _cut_off(loop, unforced)
    delayed = [signal for result in late_results for signal in result.signals]
    ticks = TickSums(cut, [block.name for block in plants], delayed)
    programs, table = _programs(ticks, late_results, one_sided and loop.gated)

    # what the programs read. names: of places
    names = list(ticks.places)
    read = set()
    for program in programs:
        for _, terms in lines_of(program):
            read.update(names[source] for _, source in terms)
    inputs = [name for name in (*sensed, *outside) if name in read]
    if not pushed or not inputs:
        raise UsageError(
            "export: expected a controller that reads the device and acts on it, found one that does not"
        )

    # All places are known before they are named in C. These three have one even if nothing reads
    # them.
    for name in (DEPTH, SPEED, FORCE):
        ticks.place(name)
    for signal in delayed:
        ticks.place(signal)
        ticks.place(arrived(signal))
    words = identifiers([name.replace(" ", "_") for name in ticks.places], "ws_z_")
    beside = {port: loop.wires[port] for port in sorted(unforced) if loop.wires.get(port)}
    return ExportedController(
        loop=cut,
        ticks=ticks,
        programs=programs,
        table=table,
        results=results,
        inputs=inputs,
        outputs=[besides(port) for port in pushed],
        late=late,
        places=dict(zip(ticks.places, words, strict=True)),
        beside=beside,
    )


def _refuse(loop: MarchedLoop, plants: Sequence[RunningBlock]) -> None:
    """Raise UsageError if the loop is not a device, whose outputs are states, and a controller."""
    if not plants or (len(plants) == len(loop.blocks) and not loop.wall):
        problem = "nothing else" if plants else "none"
        raise UsageError(
            f"export: expected a device (continuous blocks, as a mass) and further blocks, found {problem}"
        )
    read = {name for terms in loop.wires.values() for _, name in terms}
    for block in plants:
        if _responds_at_once(block, read):
            problem = f"block.{block.name} with direct terms"
            raise UsageError(
                f"export: expected a device whose outputs follow its inputs a tick later, found {problem}"
            )


def _responds_at_once(block: RunningBlock, read: Collection[str]) -> bool:
    """Whether an output of a block that is read depends on an input in the same tick."""
    for port in block.outputs:
        if f"{block.name}.{port}" not in read:
            continue
        if any(factor and name in block.inputs for factor, name in block.law.gives[port]):
            return True
    return False


def _is_pushed(loop: MarchedLoop, port: str, outside: Collection[str]) -> bool:
    """Whether anything but signals from outside enters a port."""
    return any(gain and name not in outside for gain, name in loop.wires.get(port, ()))


def _programs(
    ticks: TickSums, results: Sequence[Results], gated: bool
) -> tuple[list[Program], list[int]]:
    """The programs, and which of them belongs to each kind of tick, results in time and contact."""
    numbers: dict[tuple, int] = {}
    programs = []
    table = []
    firsts = [ticks.kinds.index(kind) for kind in range(len(ticks.sets))]
    for tick, bits, touching in product(firsts, range(2 ** len(results)), (False, True)):
        in_time: set[str] = set()
        for place, result in enumerate(results):
            if bits >> place & 1 and result.shown(tick):
                in_time.update(result.signals)
        key = (tick, frozenset(in_time), touching or not gated)
        if key not in numbers and len(numbers) < MOST_PROGRAMS:
            programs.append(ticks.program(*key))
        table.append(numbers.setdefault(key, len(numbers)))
    refuse_large(programs, len(numbers))
    return programs, table


def refuse_large(programs: Sequence[Program], kinds: int) -> None:
    """Raise UsageError for programs of more terms, or for more kinds of ticks, than C is written
    for."""
    terms = sum(len(line[1]) for program in programs for line in lines_of(program))
    if terms > MOST_PRODUCTS or kinds > MOST_PROGRAMS:
        raise UsageError(
            f"export: expected at most {MOST_PRODUCTS} terms in {MOST_PROGRAMS} kinds of ticks, found {terms} in {kinds}"
        )


def lines_of(program: Program) -> list[Line]:
    """Return the sums of a program."""
    return [*program.first, *program.second, *program.keeps]


def identifiers(signals: Sequence[str], start: str = "ws_") -> list[str]:
    """Return a name in C for each signal, no two the same; start: of all of them, which no word
    or macro of C has, as EOF or unix."""
    names: dict[str, None] = {}
    for signal in signals:
        base = start + re.sub(r"\W", "_", as_drawn(signal), flags=re.ASCII)
        name = base
        count = 1
        while name in names:
            count += 1
            name = f"{base}_{count}"
        names[name] = None
    return list(names)


def as_drawn(name: str) -> str:
    """Return the name of a port as it is drawn."""
    if PORT in name:
        name = name.rpartition(".")[2].replace(PORT, ".")
    return name.removesuffix(" besides")
