"""Reading [ports] of a drawn loop: the hand, the wall, inputs and outputs, each mistake at its
place."""

from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from wavesweep.engine._drawing.drawing import ENVIRONMENT, path_of_port
from wavesweep.engine._drawing.drawing_keys import NAME, KeyReader, is_dotted, is_name
from wavesweep.engine._drawing.drawn_block import DrawnBlock
from wavesweep.engine._drawing.expressions import ONE, PERIOD, RESERVED, Terms
from wavesweep.engine._keys.checking import nearest, show
from wavesweep.engine._keys.key import TURNED, Key, Leaf


class PortPart(NamedTuple):
    """A key of a port. type: of its value, as JSON calls it. several: whether it may be a list, of
    one value for each axis."""

    type: str = "string"
    optional: bool = False
    several: bool = False


SIGNAL = {"signal": PortPart(), "unit": PortPart(optional=True)}
# The parts of a port; of inputs and outputs each has a name.
PORTS = MappingProxyType(
    {
        "hand": {
            "force": PortPart(several=True),
            "displacement": PortPart(several=True),
            "reaction": PortPart(optional=True),
            "turns": PortPart("boolean", optional=True),
            "volts": PortPart("boolean", optional=True),
        },
        "environment": {"force": PortPart(), "displacement": PortPart()},
        "wall": {"stiffness": PortPart(), "damping": PortPart()},
        "inputs": SIGNAL,
        "outputs": SIGNAL,
    }
)
TURNS = Key(
    "ports.hand.turns",
    "boolean",
    False,
    "",
    "whether force and displacement of the hand are a torque and an angle",
)
VOLTS = Key(
    "ports.hand.volts",
    "boolean",
    False,
    "",
    "whether force and displacement of the hand are a voltage and a charge",
)
NAMED = MappingProxyType(
    {"inputs": "a signal from outside", "outputs": "an expression linear in signals"}
)
COLUMNS = ("inputs.", "outputs.", "signals.")  # of names that a table of a run has itself
WITHOUT = " (of a wall without one a number that is 0 and multiplies the velocity in the wall's wire, K*x + B*v)"

Path = tuple[str, ...]
Parts = dict[str, Leaf]
# the parts of hand and wall, and of each input and output by its name
Ports = dict[str, dict[str, Any]]


class PortReader(KeyReader):
    """A reading of [ports]. asked: the signals that a table names."""

    asked: Mapping[str, Leaf]

    def complete_ports(self, table: Mapping[Path, Leaf]) -> Ports:
        """Sort the leaves of [ports]; inputs and outputs without a signal are left out."""
        ports = self.sorted_ports(table)
        for side in ("hand", "environment", "wall"):
            needed = [key for key, part in PORTS[side].items() if not part.optional]
            missing = [key for key in needed if key not in ports[side]]
            if missing and ports[side]:
                expected = f"both {' and '.join(needed)}{WITHOUT * (missing == ['damping'])}"
                place = next(iter(ports[side].values())).place.parent()
                self.refuse(place, f"ports.{side}", expected, f"no {' and no '.join(missing)}")
        for side in NAMED:
            ports[side] = self.named(side, ports[side])
        return self.with_further(self.with_environment(ports))

    def sorted_ports(self, table: Mapping[Path, Leaf]) -> Ports:
        """Sort the leaves of [ports]; unknown ports and keys are mistakes."""
        ports: Ports = {side: {} for side in PORTS}
        for (side, *rest), leaf in table.items():
            path = f"ports.{side}"
            named = side in NAMED
            if side not in PORTS:
                place = leaf.place.under(leaf.place.path[:2])
                expected = "hand, environment, wall, inputs or outputs"
                self.refuse(place, path, expected, "an unknown port", nearest(side, PORTS))
            elif not rest:
                if leaf.value != {} or not named:
                    self.refuse(leaf, path, expected_table(side), show(leaf.value))
            elif named:
                key = ".".join(rest[1:]) or "signal"
                if self.mistakes.is_known(key, PORTS[side], leaf, f"{path}.{rest[0]}.{key}"):
                    ports[side].setdefault(rest[0], {})[key] = leaf
            elif self.mistakes.is_known(rest[0], PORTS[side], leaf, f"{path}.{rest[0]}"):
                ports[side][rest[0]] = leaf if len(rest) == 1 else Leaf({}, leaf.place.parent())
        return ports

    def _refuse_unpaired(self, listed: list[tuple[str, Leaf]], ports: Ports) -> None:
        """Refuse lists of the hand that do not pair forces and displacements, or that stand
        beside other ports."""
        counts = []  # of texts, of each list that has texts alone
        for _, leaf in listed:
            texts = leaf.value if isinstance(leaf.value, list) else []
            if texts and all(isinstance(text, str) for text in texts):
                counts.append(len(texts))
        alone = not ports["environment"] and "reaction" not in ports["hand"]
        if len(counts) != 2 or counts[0] != counts[1] or not alone:
            key, leaf = listed[0]
            expected = (
                "as many names of forces as displacements, in two lists, "
                "without reaction and environment"
            )
            self.refuse(leaf, f"ports.hand.{key}", expected, show(leaf.value), of_key=False)

    def with_further(self, ports: Ports) -> Ports:
        """Add the axes of the hand but the first, of lists of forces and displacements, to the
        inputs and outputs."""
        hand = ports["hand"]
        listed = []
        for key, part in PORTS["hand"].items():
            if part.several and key in hand and isinstance(hand[key].value, list):
                listed.append((key, hand[key]))
        if not listed:
            return ports
        self._refuse_unpaired(listed, ports)
        for key, leaf in listed:
            values = leaf.value or [""]
            self.lists[f"ports.hand.{key}"] = leaf
            hand[key] = Leaf(values[0], leaf.place)
            for number, value in enumerate(values[1:], 2):
                side = "inputs" if key == "force" else "outputs"
                ports[side][f"hand.{key}.{number}"] = {"signal": Leaf(value, leaf.place)}
        return ports

    def with_environment(self, ports: Ports) -> Ports:
        """Add the environment's force to the inputs and its displacement to the outputs."""
        for side, name in zip(NAMED, ENVIRONMENT, strict=True):
            leaf = ports["environment"].get(name.partition(".")[2])
            if leaf:
                ports[side][name] = {"signal": leaf}
                self.leaves[f"ports.{name}"] = leaf
        return ports

    def named(self, side: str, ports: dict[str, Parts]) -> dict[str, Parts]:
        """Check the names of inputs or outputs; return those that have a signal."""
        for name, keys in ports.items():
            path = f"ports.{side}.{name}"
            first = next(iter(keys.values()))
            for key, leaf in keys.items():
                self.leaves[path if key == "signal" else f"{path}.unit"] = leaf
            fits = is_dotted(name) if side == "outputs" else is_name(name)
            if not fits or name in (*RESERVED, *self.numbers):
                expected = f"{NAME}, and neither pi nor a function nor a number"
                self.refuse(first, path, expected, show(name))
            if "signal" not in keys:
                self.refuse(first.place.parent(), path, f"the key signal, {NAMED[side]}", "none")
        return {name: keys for name, keys in ports.items() if "signal" in keys}

    def read_inputs(self, ports: Ports) -> tuple[tuple[str, str, str], ...]:
        """Read the name, signal and unit of each input."""
        inputs: list[tuple[str, str, str]] = []
        for name, keys in ports["inputs"].items():
            path = path_of_port("inputs", name)
            leaf = keys["signal"]
            fault = self.fault_from_outside(leaf.value)
            if fault and name in self.read:
                fault = (f'{fault[0]}, as {name} = "{name}"', fault[1])
            if not fault and leaf.value in [signal for _, signal, _ in inputs]:
                fault = "a signal that no other port has", f"{show(leaf.value)} again"
            if fault:
                self.refuse(leaf, path, *fault, of_key=False)
            else:
                inputs.append((name, leaf.value, self.word(f"{path}.unit", keys.get("unit"))))
        return tuple(inputs)

    def read_outputs(self, ports: Ports) -> tuple[tuple[str, Terms, str], ...]:
        """Read the name, terms and unit of each output."""
        outputs: list[tuple[str, Terms, str]] = []
        for name, keys in ports["outputs"].items():
            path = path_of_port("outputs", name)
            if name in ports["inputs"]:
                self.refuse(keys["signal"], path, "another name than that of an input", show(name))
            terms = self.read_terms(path, keys["signal"])
            if terms is not None:
                outputs.append((name, terms, self.word(f"{path}.unit", keys.get("unit"))))
        self.leaves |= self.lists
        return tuple(outputs)

    def refuse_names_of_others(
        self,
        ports: Ports,
        outputs: Iterable[tuple[str, Terms, str]],
        blocks: Iterable[DrawnBlock],
        wires: Mapping[str, Leaf],
    ) -> None:
        """Add the mistakes of inputs and outputs that have the name of another signal, of which
        a table would show one."""
        owners = _owners(blocks)
        named: list[tuple[str, str, Terms | None]] = [
            ("inputs", name, None) for name in ports["inputs"]
        ]
        for name, terms, _ in outputs:
            if name in ports["outputs"]:
                named.append(("outputs", name, terms))
        for side, name, terms_of_name in named:
            leaf = ports[side][name]["signal"]
            path = path_of_port(side, name)
            meant = self.terms_of_signal(name, leaf, owners.get(name), wires)
            if meant is not None and (
                terms_of_name is None or _texts(terms_of_name) != _texts(meant)
            ):
                itself = ", or the signal itself" * (terms_of_name is not None)
                self.refuse(leaf, path, f"another name than that of a signal{itself}", show(name))
            elif name.startswith(COLUMNS):
                expected = f"a name that does not begin as columns do: {', '.join(COLUMNS)}"
                self.refuse(leaf, path, expected, show(name))

    def fault_from_outside(
        self, signal: object, purpose: str = "a signal from outside"
    ) -> tuple[str, str] | None:
        """Return expected and found text of a value that is not a signal from outside that a
        wire reads. purpose: it should be."""
        if not (isinstance(signal, str) and is_name(signal) and signal not in RESERVED):
            return f"{NAME}, for {purpose}", show(signal)
        if signal in (*self.numbers, PERIOD):
            return "a name that is no number", show(signal)
        if signal not in self.read:
            return "a signal that a wire reads", f"{show(signal)}, which no wire reads"
        return None

    def read_asked(
        self,
        blocks: Iterable[DrawnBlock],
        wires: Mapping[str, Leaf],
        numbers: Iterable[tuple[str, str, str]],
        tables: Mapping[str, dict[str, Any]],
    ) -> Iterator[tuple[str, Terms, str]]:
        """Yield an output for each signal that a table names and [ports] does not declare; see
        `Drawing.signals`.

        Its unit is that of a port with the same signal. Names of no signal are left to
        `Request.refuse_unknown_ends`.
        """
        owners = _owners(blocks)
        units = {name: unit for name, unit, _ in numbers}
        for side in NAMED:
            for keys in tables[side].values():
                if "unit" in keys:
                    units[str(keys["signal"].value)] = str(keys["unit"].value)
        for name, leaf in self.asked.items():
            if name in tables["outputs"]:
                continue
            block = owners.get(name)
            terms = self.terms_of_signal(name, leaf, block, wires)
            if terms is not None:
                yield name, terms, units.get(name) or _unit_of(name, block, units)

    def terms_of_signal(
        self, name: str, leaf: Leaf, block: DrawnBlock | None, wires: Mapping[str, Leaf]
    ) -> Terms | None:
        """Return the terms of a port or of a name in [signals]; None if it is neither. block:
        whose port it is."""
        if block and name in wires:
            with self.in_period(self.periods[block.name]):
                return self.read_terms(f"wire.{name}", wires[name])
        if block and name in self.signals:
            return ((name, ONE),)
        if name in self.meanings and name in self.signals:
            self.read.add(name)
            return self.terms_of(f"signals.{name}", leaf, self.meanings[name])
        return None

    def read_hand(self, keys: Mapping[str, Leaf]) -> tuple[str, Terms, Terms | None] | None:
        force = keys.get("force")
        if force:
            self.leaves["ports.hand.force"] = force
            fault = self.fault_from_outside(force.value, "the hand's force")
            if fault:
                self.refuse(force, "ports.hand.force", *fault, of_key=False)
        terms: dict[str, Terms | None] = {"displacement": None, "reaction": None}
        for key in terms:
            if key in keys:
                terms[key] = self.read_terms(f"ports.hand.{key}", keys[key])
        position = terms["displacement"]
        if force and isinstance(force.value, str) and position is not None:
            return force.value, position, terms["reaction"]
        return None

    def read_wall(self, keys: Mapping[str, Leaf]) -> tuple[str, ...] | None:
        numbers = []
        for key in PORTS["wall"]:
            if key not in keys:
                continue
            leaf = keys[key]
            path = f"ports.wall.{key}"
            name = leaf.value
            self.leaves[path] = leaf
            if name not in self.numbers or name in self.meanings:
                expected = "the name of a number in [numbers]"
                hint = nearest(name, self.numbers) if isinstance(name, str) else ""
                self.refuse(leaf, path, expected, show(name), hint, of_key=False)
            elif name in numbers:
                expected = "another number than the stiffness"
                self.refuse(leaf, path, expected, show(name), of_key=False)
            numbers.append(str(name))
        return tuple(numbers) or None


def _unit_of(signal: str, block: DrawnBlock | None, units: Mapping[str, str]) -> str:
    """Return the unit of a port of a body, empty if it is not known: a `mass` may turn, which
    the unit of its number shows."""
    if block is None or block.type not in ("mass", "inertia"):
        return ""
    mass = dict(block.keys).get("mass", ONE)
    turns = block.type == "inertia"
    moves = False
    if not turns and mass.operation == "name":
        turns = units.get(mass.leaf) == "kg*m^2"
        moves = units.get(mass.leaf) == "kg"
    unit = {"f": "N", "x": "m", "v": "m/s"}.get(signal.rpartition(".")[2], "")
    if turns and unit:
        return TURNED[unit]
    return unit if moves else ""


def _owners(blocks: Iterable[DrawnBlock]) -> dict[str, DrawnBlock]:
    """The block of each port."""
    owners = {}
    for block in blocks:
        for port in (*block.ports[0], *block.ports[1]):
            owners[f"{block.name}.{port}"] = block
    return owners


def expected_table(side: str) -> str:
    """Return what a table of [ports] has to be."""
    return f"a table, NAME = {NAMED[side]}" if side in NAMED else f"{{ {', '.join(PORTS[side])} }}"


def _texts(terms: Terms) -> list[tuple[str, str]]:
    """The terms without the places of their names."""
    return sorted((signal, gain.text) for signal, gain in terms)
