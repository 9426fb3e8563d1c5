"""One controller of a loop: the blocks that one program runs, what they read and give, and what it
assumes of the rest."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import gcd

from wavesweep.engine.drawing import Drawing, DrawnBlock, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import Tree, sum_of
from wavesweep.engine.keys import nearest
from wavesweep.program.spec import Spec
from wavesweep.simulation.export.repeated_experiment import drawing_of
from wavesweep.simulation.running_blocks import MarchedLoop, RunningBlock, loop_of


@dataclass(frozen=True)
class ControllerGroup:
    """A controller in its loop.

    name: as it was asked for. drawing, loop: the whole; its wall is linear, and part of the blocks
    and wires in which its numbers stand. blocks: of the controller. first: the tick of its first
    step; every: the ticks from step to step. inputs: signals of the rest that it reads; outputs:
    its own that others read.
    """

    name: str
    drawing: Drawing
    loop: MarchedLoop
    blocks: tuple[RunningBlock, ...]
    first: int
    every: int
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def own_wires(self) -> dict[str, tuple[tuple[float, str], ...]]:
        """What its ports read."""
        ports = [f"{block.name}.{port}" for block in self.blocks for port in block.inputs]
        return {port: self.loop.wires.get(port, ()) for port in ports}

    def steps(self, k: int) -> bool:
        """Whether it makes a step in tick k."""
        return k >= self.first and (k - self.first) % self.every == 0

    def has(self, signal: str) -> bool:
        """Whether a port, a signal or a state is of one of its blocks."""
        return signal.rpartition(".")[0] in {block.name for block in self.blocks}


def group_of(spec: Spec, name: str) -> ControllerGroup:
    """Return the controller that a name stands for.

    name: of a block, which takes all blocks of its rate with it to which wires lead; or names with
    commas between them, which are just these. Plants, channels, dead times and the amplifier of a
    device belong to the rest.

    Errors: UsageError for another name, for steps of several lengths, and for a controller that
    reads nothing or gives nothing.
    """
    drawing = replace(drawing_of(spec, amplifier=True), wall=None)
    loop = loop_of(drawing, spec.values)
    known = _run_by_programs(spec, drawing, loop)
    named = [block_name.strip() for block_name in name.split(",") if block_name.strip()]
    _refuse_unknown(named or [name], known)
    if "," not in name:
        named = _connected(loop, known, named[0])
    blocks = tuple(block for block in loop.blocks if block.name in named)
    _refuse_uneven(spec, drawing, named)
    phases = sorted(phase for block in blocks for phase in block.rhythm.phases)
    apart = [phase - phases[0] for phase in phases]
    every = gcd(*apart, *(block.rhythm.every for block in blocks))
    group = ControllerGroup(name, drawing, loop, blocks, phases[0], every, (), ())
    inputs, outputs = _exchanged(group)
    if not (inputs and outputs):
        lacking = "gives nothing to the rest" if inputs else "reads nothing of the rest"
        whole = ", ".join(block.name for block in blocks)
        raise UsageError(
            f"--controller: expected a controller that acts on a rest, found one that {lacking} ({whole}); some of these with commas "
            "between are that alone"
        )
    return replace(group, inputs=inputs, outputs=outputs)


def _exchanged(group: ControllerGroup) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The signals that a group reads of the rest of its loop, and those that it gives to it."""
    loop = group.loop
    read = {signal: None for terms in group.own_wires.values() for _, signal in terms}
    inputs = tuple(signal for signal in read if not group.has(signal))
    read_by_rest = set()
    for port, terms in loop.wires.items():
        if port in loop.ports and not group.has(port):
            read_by_rest.update(signal for _, signal in terms)
    ports = [f"{block.name}.{port}" for block in group.blocks for port in block.outputs]
    return inputs, tuple(signal for signal in ports if signal in read_by_rest)


def _refuse_unknown(names: Sequence[str], known: Collection[str]) -> None:
    """UsageError for a name of no block that a program runs."""
    for name in names:
        if name not in known:
            near = nearest(name, known)
            meant = f"; did you mean {near}?" if near else ""
            raise UsageError(
                f"--controller: expected blocks that a program runs ({', '.join(known)}), found {name}{meant}"
            )


def _run_by_programs(spec: Spec, drawing: Drawing, loop: MarchedLoop) -> dict[str, RunningBlock]:
    """The blocks that a program runs, by name: no plants, channels and dead times, and none of the
    amplifier."""
    amplifier = {block.name for block in drawing.blocks}
    amplifier -= {block.name for block in drawing_of(spec).blocks}
    blocks = {}
    for block in loop.blocks:
        of_rest = block.plant or block.type in ("dead time", "channel")
        if not of_rest and block.name not in amplifier:
            blocks[block.name] = block
    return blocks


def _connected(loop: MarchedLoop, blocks: dict[str, RunningBlock], name: str) -> list[str]:
    """The blocks of the rate of one of them to which wires lead from it, in either direction."""
    same = {
        block_name for block_name, block in blocks.items() if block.rhythm == blocks[name].rhythm
    }
    pairs = []
    for port, terms in loop.wires.items():
        for _, signal in terms:
            pairs.append({port.rpartition(".")[0], signal.rpartition(".")[0]})
    reached_before = {name}
    while True:
        reached = set().union(*(pair for pair in pairs if pair & reached_before)) & same
        if reached <= reached_before:
            return [block_name for block_name in blocks if block_name in reached_before]
        reached_before |= reached


def _refuse_uneven(spec: Spec, drawing: Drawing, named: list[str]) -> None:
    """Refuse a controller whose steps have several lengths, and frames that vary in the run."""
    varying = {axis.name for axis in spec.for_all.changing} if spec.for_all else set()
    everys = {name for block in drawing.blocks if block.name in named for name in block.every.names}
    if drift := sorted(everys & varying):
        raise UsageError(
            f"--controller: expected steps of one length, found blocks whose `every` has {drift[0]}, which varies in [for_all]"
        )
    if spec.simulate["frames"]:
        raise UsageError(
            "--controller: expected frames of one length in [simulate], found frames; --set simulate.frames= leaves them out"
        )


def assumed_of_rest(spec: Spec, group: ControllerGroup) -> Iterator[str]:
    """Yield what a controller is, when it runs, what it reads and gives, and what it assumes of the
    rest: wires, blocks with their numbers, rates."""
    tick = 1e3 * group.loop.tick
    drawn = {block.name: block for block in group.drawing.blocks}
    names = {block.name for block in group.blocks}
    period = f"{group.every * tick:g} ms ({group.every} tick{'s' * (group.every > 1)})"
    said = ", ".join(_block_in_words(drawn[part.name], spec) for part in group.blocks)
    yield f"controller {group.name}: {said}; a step every {period}, the first in tick {group.first}"
    inside = {name: port for port, name in group.drawing.inside.items()}
    inputs = ", ".join(inside.get(part, part) for part in group.inputs)
    yield f"  reads in the tick of its step: {inputs}; gives until its next: {', '.join(group.outputs)}"
    own_wires = [wire for wire in group.drawing.wires if wire[0] in group.own_wires]
    yield f"  its wires: {', '.join(f'{port} = {sum_of(terms)}' for port, terms in own_wires)}"
    yield "  assumes of the rest:"
    wires: dict[str, tuple] = {}
    for port, terms in (*group.drawing.wires, *group.drawing.couplings):
        if port.rpartition(".")[0] not in names and terms:
            wires[port] = (*wires.get(port, ()), *terms)
    for port, terms in wires.items():
        yield f"    {port} = {sum_of(terms)}"
    if spec.wall:
        wall = (f"{path} = {spec.values[path]:g}" for path in spec.wall)
        yield f"    a linear wall of {', '.join(wall)}"
    numbers = scalars(spec.values)
    by_rate: dict[str, list[str]] = {}
    for block in group.drawing.blocks:
        if block.name in names:
            continue
        every = int(block.every.value(numbers))
        phases = block.phases or (int(block.phase.value(numbers)),)
        when = f"every {every * tick:g} ms, in tick {', '.join(map(str, phases))}"
        if block.plant:
            when = "moves continuously"
        by_rate.setdefault(when, []).append(_block_in_words(block, spec))
    for when, blocks in by_rate.items():
        yield f"    {when}: {', '.join(blocks)}"


def _block_in_words(block: DrawnBlock, spec: Spec) -> str:
    """A block with its type and its keys, each with its value."""
    numbers = scalars(spec.values)

    def told(value: object, name: str = "") -> str:
        if isinstance(value, Tree):
            number = f"{value.value(numbers):g}"
            return number if value.text == name or not value.names else f"{value.text} = {number}"
        if isinstance(value, tuple):
            return f"[{', '.join(map(told, value))}]"
        return str(value)

    keys = (f"{name} = {told(value, name)}" for name, value in (*block.keys, *block.limits))
    return f"{block.name} ({', '.join([block.type, *keys])})"
