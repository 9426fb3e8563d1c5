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
    entry: the signal from outside that the example gives. late: ticks after which what the
    amplifier is asked for is exerted, maybe before the last ends.
    """

    own: ExportedController
    whole: MarchedLoop
    members: Mapping[str, str]
    entry: str
    late: int

    @property
    def plants(self) -> list[RunningBlock]:
        """The blocks of the device."""
        return [block for block in self.whole.blocks if block.plant]

    @property
    def dead_times(self) -> list[RunningBlock]:
        """The dead times through which the device is driven."""
        return [block for block in self.whole.blocks if block.type == "dead time"]

    def texts(self) -> dict[str, Any]:
        """Return the texts for the names of the template."""
        own = self.own
        members = self.members
        names = self._names()
        moved = list(self._moved(names))
        shown = [f"in.{members[name]}" for name in own.inputs]
        shown += [f"out.{members[name]}" for name in own.outputs]
        computed = [f"        next[{i}] = {total};" for i, (_, total) in enumerate(moved)]
        written = [f"        {name} = next[{i}];" for i, (name, _) in enumerate(moved)]
        return {
            "host": "\n".join(f"    double {name} = 0.0;" for name in names.values()),
            "amplifier_ticks": self.late,
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
        for block in self.dead_times:
            names += [f"{block.name}.{name}" for name in ("u", *_past(block))]
        return dict(zip(names, identifiers(names, "host_"), strict=True))

    def _sensed(self, names: Mapping[str, str]) -> Iterator[str]:
        """Yield the lines that give the controller what it reads."""
        own = self.own
        members = self.members
        for block in self.plants:
            for port in block.outputs:
                name = f"{block.name}.{port}"
                if name in members:
                    total = _sum(block, block.law.gives[port], names)
                    yield f"        in.{members[name]} = {total};"
        for name in own.inputs:
            if name in own.outside:
                yield f"        in.{members[name]} = {'given' if name == self.entry else '0.0'};"

    def _pushed(self, names: Mapping[str, str]) -> list[str]:
        """The lines that compute what acts on each input of the device.

        A port with AT is by how much the one before it changes within the tick: what is asked for
        after `late` ticks less what is exerted now.
        """
        late = self.late
        lines: list[str] = []
        brought: dict[str, str] = {}
        for block in self.dead_times:
            asked, *past = (f"{block.name}.{name}" for name in ("u", *_past(block)))
            lines.append(f"        {names[asked]} = {self._given_out(asked)}{self._given(asked)};")
            now, soon = (names[name] for name in ([asked, *past][-1], [asked, *past][-2]))
            brought |= {f"{block.name}.y": now, f"{block.name}.next": f"({soon} - {now})"}
        for port in (f"{block.name}.{port}" for block in self.plants for port in _used(block)):
            place = names[port]
            arrives = [term for term in self.whole.wires.get(port, ()) if term[1] in brought]
            products = "".join(product_in_c(float(gain), brought[name]) for gain, name in arrives)
            if arrives and AT in port:
                lines.append(f"        {place} = 0.0{products};")
                continue
            if AT in port:
                lines.insert(-1, f"        {place} = -asked[tick % {late}];")
                lines.append(f"        {place} += asked[(tick + 1) % {late}];")
                continue
            force = self._given_out(port)
            exerted = f"asked[tick % {late}]" if late else force
            lines.append(f"        {place} = {exerted}{products}{self._given(port)};")
            if late:
                lines.append(f"        asked[tick % {late}] = {force};")
        return lines

    def _given_out(self, port: str) -> str:
        """What the controller gives at a port, in C."""
        output = besides(port)
        return f"out.{self.members[output]}" if output in self.members else "0.0"

    def _given(self, port: str) -> str:
        """The product that adds what the example gives at a port; empty if nothing."""
        own = self.own
        terms = own.beside.get(port)
        if not terms:
            wires = own.loop.wires.get(port, ())
            terms = [term for term in wires if term[1] in own.loop.inputs]
        share = sum(float(gain) for gain, name in terms if name == self.entry)
        if share:
            return product_in_c(share, "given")
        return ""

    def _moved(self, names: Mapping[str, str]) -> Iterator[tuple[str, str]]:
        """Yield the name in C of each state, and the sum that it is in the next tick."""
        for block in self.plants:
            for name, terms in block.law.keeps.items():
                yield names[f"{block.name}.{name}"], _sum(block, terms, names)
        for block in self.dead_times:
            for name, before in zip(_past(block), ("u", *_past(block)), strict=False):
                yield names[f"{block.name}.{name}"], names[f"{block.name}.{before}"]


def _used(block: RunningBlock) -> list[str]:
    """The inputs of a block that have an effect; what a whole tick of dead time brings has none within it."""
    law = block.law
    terms = [term for made in (law.keeps, law.gives) for each in made.values() for term in each]
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
