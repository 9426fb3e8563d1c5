"""The device in the example of an exported controller: what is sensed, what pushes it, and how it
moves."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wavesweep.engine.drawing import AT
from wavesweep.simulation.export.controller import ExportedController, identifiers
from wavesweep.simulation.export.tick_functions import product_in_c
from wavesweep.simulation.running_blocks import MarchedLoop, RunningBlock
from wavesweep.simulation.tick_sums import besides


@dataclass(frozen=True, slots=True)
class ExampleHost:
    """The device that the example simulates.

    whole: the loop with its amplifier. members: names in C of what the controller reads and gives.
    entry: the signal from outside that the example gives.
    """

    own: ExportedController
    whole: MarchedLoop
    members: Mapping[str, str]
    entry: str

    @property
    def plants(self) -> list[RunningBlock]:
        """The blocks of the device."""
        return [block for block in self.whole.blocks if block.plant]

    @property
    def late(self) -> list[RunningBlock]:
        """The dead times, or delays of an amplifier, through which the device is driven."""
        computed = {block.name for block in self.own.loop.blocks if not block.plant}
        apart = [block for block in self.whole.blocks if not block.plant and block.law.moves]
        return [block for block in apart if block.name not in computed]

    def texts(self) -> dict[str, Any]:
        """Return the texts for the names of the template."""
        controller = self.own
        members = self.members
        names = self._names()
        moved = list(self._moved(names))
        shown = [f"in.{members[name]}" for name in controller.inputs]
        shown += [f"out.{members[name]}" for name in controller.outputs]
        computed = [f"        next[{i}] = {total};" for i, (_, total) in enumerate(moved)]
        written = [f"        {name} = next[{i}];" for i, (name, _) in enumerate(moved)]
        return {
            "host": "\n".join(f"    double {name} = 0.0;" for name in names.values()),
            "size": len(moved),
            "header": ",".join(members.values()),
            "formats": ",%.17g" * len(shown),
            "printed": ", ".join(shown),
            "sensed": "\n".join(self._sensed(names)),
            "pushed": "\n".join(self._pushed(names)),
            "moved": "\n".join([*computed, *written]),
        }

    def _names(self) -> dict[str, str]:
        """The names in C of the device's states and inputs."""
        names = []
        for block in self.plants:
            names += [f"{block.name}.{name}" for name in (*block.law.keeps, *_used(block))]
        for block in self.late:
            names += [f"{block.name}.{name}" for name in ("u", *_past(block))]
        return dict(zip(names, identifiers(names, "host_"), strict=True))

    def _sensed(self, names: Mapping[str, str]) -> Iterator[str]:
        """Yield the lines that give the controller what it reads."""
        controller = self.own
        members = self.members
        for block in self.plants:
            for port in block.outputs:
                name = f"{block.name}.{port}"
                if name in members:
                    total = _sum(block, block.law.gives[port], names)
                    yield f"        in.{members[name]} = {total};"
        for name in controller.inputs:
            if name in controller.outside:
                yield f"        in.{members[name]} = {'given' if name == self.entry else '0.0'};"

    def _pushed(self, names: Mapping[str, str]) -> list[str]:
        """The lines that compute what acts on each input of the device, some of it through dead times.

        A port with AT is by how much the one before it changes within the tick.
        """
        lines: list[str] = []
        brought: dict[str, str] = {}
        taken = set()
        for block in self.late:
            now, *past = (names[f"{block.name}.{name}"] for name in ("u", *_past(block)))
            port, gain = self._into(block)
            taken.add(port)
            product = product_in_c(1.0 / gain, self._given_out(port))
            added = self._given(port) if gain == 1.0 else ""
            lines.append(f"        {now} = 0.0{product}{added};")
            brought[f"{block.name}.y"] = past[-1]
            brought[f"{block.name}.next"] = f"({[now, *past][-2]} - {past[-1]})"
        for port in (f"{block.name}.{port}" for block in self.plants for port in _used(block)):
            terms = self.whole.wires.get(port, ())
            products = [
                product_in_c(float(gain), brought[name]) for gain, name in terms if name in brought
            ]
            force = "0.0" if port in taken or AT in port else self._given_out(port)
            added = "" if AT in port else self._given(port)
            lines.append(f"        {names[port]} = {force}{''.join(products)}{added};")
        return lines

    def _into(self, block: RunningBlock) -> tuple[str, float]:
        """The port at which the controller gives what goes into a dead time, and the factor with which it acts there: its own,
        or the one that the amplifier of a built-in controller drives."""
        drawn = any(inner.name == block.name for inner in self.own.loop.blocks)
        for port, terms in self.whole.wires.items():
            for gain, name in terms:
                if name == f"{block.name}.y" and not drawn:
                    return port, float(gain)
        return f"{block.name}.u", 1.0

    def _given_out(self, port: str) -> str:
        """What the controller gives at a port, in C."""
        output = besides(port)
        return f"out.{self.members[output]}" if output in self.members else "0.0"

    def _given(self, port: str) -> str:
        """The product that adds what the example gives at a port; empty if nothing."""
        controller = self.own
        terms = controller.beside.get(port)
        if not terms:
            wires = controller.loop.wires.get(port, ())
            terms = [term for term in wires if term[1] in controller.loop.inputs]
        share = sum(float(gain) for gain, name in terms if name == self.entry)
        if share:
            return product_in_c(share, "given")
        return ""

    def _moved(self, names: Mapping[str, str]) -> Iterator[tuple[str, str]]:
        """Yield the name in C of each state, and the sum that it is in the next tick."""
        for block in self.plants:
            for name, terms in block.law.keeps.items():
                yield names[f"{block.name}.{name}"], _sum(block, terms, names)
        for block in self.late:
            for name, before in zip(_past(block), ("u", *_past(block)), strict=False):
                yield names[f"{block.name}.{name}"], names[f"{block.name}.{before}"]


def _used(block: RunningBlock) -> list[str]:
    """The inputs of a block that have an effect; what a whole tick of dead time brings has none within it."""
    law = block.law
    terms = [term for made in (law.keeps, law.gives) for total in made.values() for term in total]
    return [port for port in block.inputs if any(gain and name == port for gain, name in terms)]


def _past(block: RunningBlock) -> Sequence[str]:
    """The names of what went into a dead time in the ticks before, the last one first."""
    return block.law.moves[0][1]


def _sum(block: RunningBlock, terms: Iterable[tuple[float, str]], names: Mapping[str, str]) -> str:
    """A sum of states and inputs of a block."""
    products = [
        product_in_c(float(gain), names[f"{block.name}.{name}"]) for gain, name in terms if gain
    ]
    return "".join(["0.0", *products])
