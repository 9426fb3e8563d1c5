"""Loops drawn in a spec, block by block of docs/blocks.md, in exact time.

Variables of a tick are outputs of blocks, "block.port", and inputs of plants, "into block.port". The memory, by the names in
proof files, is written at the end of an instant with what stands behind it (B is a block, of a class with dots):

    @B xI                      state I of a plant or of ss: of a mass x, v; of several axes all positions, then all velocities
    @into B.PORT               what is held at a port of a plant since the last tick
    @held B.PORT               an output, of a block that does not run in each tick until it runs again
    @B state I, @B K state I   of tf, lead, notch and biquad, and of section K of butterworth (filters.py)
    @B integral, @B moved, @B u, @B d   of integrator, pi and pid: the integral; of an explicit one the last step times input;
                               the last input, also of a difference; the filtered slope
    @B y                       of lowpass;   @B sum of impulse;   @B depth of a wall;   @B x, @B v of avatar and local_model
    @B ago K                   inputs K runs ago, of delay, fir and mean;   @B sent K of a channel K messages before
    @B given K, @B seen K      of a dead time between ticks: what blocks gave and what plants showed K ticks ago; @B arrived
    @before SIGNAL, @last SIGNAL   of prev(...): in the last tick, of an impulse in its last run
"""

import ast
import math
from fractions import Fraction
from functools import cached_property
from typing import Any

from . import devices, filters
from .classes import written_out
from .controllers import add_model, add_sections
from .expressions import (
    FUNCTIONS,
    bounded_parts,
    equations_of,
    linear,
    multiplied_out,
    names_in,
    number,
    parsed,
    terms_of,
)
from .loops import (
    Instant,
    Keys,
    Schedule,
    Unreadable,
    bounded,
    diagonal,
    form,
    identity,
    inverse,
    product,
    rows_of,
    scaled,
    shifted,
    ticks_and_rest,
    transposed,
    warped,
)
from .names import OF_BLOCKS, Rule

DEVICES = tuple(devices.DEFAULTS)  # of several axes
RESERVED = {*FUNCTIONS, "prev", "pi", "dt"}
NO_NAMES = {"nan", "inf", "infinity", "none", "null", "na", "true", "false"}
SAME_SHARE, NO_GAIN = (
    Fraction(10) ** -9,
    Fraction(10) ** -40,
)  # rounding of numbers with ranges is below
ASKEW = Fraction(10) ** -12  # of entries of a symmetric matrix
NEEDED = {  # of ports that there are
    "hand": {"force", "displacement"},
    "environment": {"force", "displacement"},
    "wall": {"stiffness", "damping"},
}
ABOVE_0 = Rule(low=Fraction(0), above=True)
PLANTS = {"mass", "inertia", "mass_matrix", *DEVICES, "spring", "ss", "tf"}

# Laws of blocks: into.PORT and out.PORT are its ports, memory.NAME is @B NAME, inner.NAME another variable; the rest are keys.
MEANT = {"out": "{}.{}", "memory": "@{} {}", "inner": "{} {}"}
PLAIN = "out.y = into.u"
PI = "inner.now = into.u; memory.u = inner.now; memory.integral = inner.i; memory.moved = dt*inner.now;"
SMOOTHED = "out.y = (1 - a)*memory.y + a*into.u; memory.y = out.y"
MOVED = "out.v = (sqrt(2*b)*into.in - inner.f)/b; out.out = into.in - sqrt(2*b)/b*inner.f; memory.x = out.x;"
WALL = "out.made = (K + B/dt)*out.depth - B/dt*memory.depth; memory.depth = out.depth"
LAWS = {
    **dict.fromkeys(("hold", "channel", "saturation"), PLAIN),
    "gain": "out.y = k*into.u",
    "impulse": f"{PLAIN}; out.sum = memory.sum + out.y; memory.sum = out.sum",
    "difference": "inner.now = into.u; out.y = (inner.now - memory.u)/dt; memory.u = inner.now",
    "integrator": PI,
    "pi": f"{PI} out.y = kp*inner.now + ki*inner.i;",
    "pid": f"{PI} out.y = kp*inner.now + ki*inner.i + kd*inner.d;"
    "inner.d = (tau*memory.d + inner.now - memory.u)/(tau + dt); memory.d = inner.d;",
    "lowpass": "memory.y = out.y;"
    "out.y = (memory.y + 2*pi*cutoff_hz*dt*into.u)/(1 + 2*pi*cutoff_hz*dt)",
    "avatar": f"{MOVED} inner.f = into.f;",
    "local_model": f"{MOVED} inner.f = K*out.x_spring + B*out.v;",
    "wave": "",
    "wall": f"out.depth = nx*into.x + ny*into.y; {WALL}",
    "wall-3d": f"out.depth = nx*into.x + ny*into.y + nz*into.z; {WALL}",
}
FORCES = {"wall": "out.fx = nx*out.force; out.fy = ny*out.force"}
FORCES["wall-3d"] = f"{FORCES['wall']}; out.fz = nz*out.force"
CHOICES = {  # a key that says a part of the law, and what it is without
    "integrator": ("method", "explicit"),
    **dict.fromkeys(("pi", "pid"), ("method", "implicit")),
    **dict.fromkeys(("avatar", "local_model"), ("integration", "implicit")),
    "wave": ("gives", "force"),
}
PARTS = {
    ("method", "explicit"): "inner.i = memory.integral + memory.moved",
    ("method", "implicit"): "inner.i = memory.integral + dt*inner.now",
    ("method", "trapezoidal"): "inner.i = memory.integral + dt/2*(inner.now + memory.u)",
    ("integration", "explicit"): "out.x = memory.x + dt*out.v; out.x_spring = memory.x",
    ("integration", "implicit"): "out.x = memory.x + dt*out.v; out.x_spring = out.x",
    ("integration", "trapezoidal"): "out.x = memory.x + dt/2*(out.v + memory.v);"
    "memory.v = out.v; out.x_spring = out.x",
    ("gives", "force"): "out.force = b*into.v - sqrt(2*b)*into.in;"
    "out.out = sqrt(2*b)*into.v - into.in",
    ("gives", "velocity"): "out.v = (sqrt(2*b)*into.in - into.f)/b;"
    "out.out = into.in - sqrt(2*b)/b*into.f",
}
DEFAULTS = {  # of keys in laws
    **dict.fromkeys(("k", "b0", "nx"), 1),
    **dict.fromkeys(("ki", "kd", "tau", "B", "depth", "b1", "b2", "a1", "a2", "ny", "nz"), 0),
    **dict.fromkeys(("wall K", "wall-3d K"), 100),
}
# Transfer functions num, den: s = c (z - 1)/(z + 1), with c = 1/tan(pi f dt) of a frequency f that it keeps.
WARPED = {"zero": "zero_hz", "pole": "pole_hz", "c": "frequency_hz"}
MODELS = {
    "lead": ("1 + zero, 1 - zero", "1 + pole, 1 - pole"),
    "notch": (
        "c*c + depth*c/q + 1, 2 - 2*c*c, c*c - depth*c/q + 1",
        "c*c + c/q + 1, 2 - 2*c*c, c*c - c/q + 1",
    ),
    "biquad": ("b0, b1, b2", "1, a1, a2"),
}


def called_of(block: str):
    """What a name on the left of a law stands for, in a block."""

    def called(name: str) -> str:
        prefix, _, part = name.partition(".")
        return MEANT[prefix].format(block, part)

    return called


def loses_at_random(channel: dict) -> bool:
    """Whether messages of a channel are lost with a probability: it has loss or burst, which is not just the number 0."""
    chances = [parsed(channel[key]) for key in ("loss", "burst") if key in channel]
    return any(not isinstance(node, ast.Constant) or Fraction(node.value) != 0 for node in chances)


def is_name(name) -> bool:
    """Whether it is a name of ASCII letters, digits and _, and no word for a value."""
    plain = isinstance(name, str) and name.isascii() and name.isidentifier()
    return plain and name.lower() not in NO_NAMES


def named_numbers(entries: dict) -> dict[str, Any]:
    """The values of the table [numbers], by name."""
    numbers = {}
    for name, entry in entries.items():
        table = entry if isinstance(entry, dict) else {"value": entry}
        if not is_name(name.replace(".", "_")):  # that of a class in a class has dots
            raise Unreadable(f"{name!r} is no name of a number")
        if "value" not in table or table.keys() - {"value", "unit", "description"}:
            raise Unreadable(
                f"numbers.{name} is no number and no table of value, unit and description"
            )
        numbers[name] = table["value"]
    return numbers


class Drawing:
    """Numbers, blocks, wires and ports of a spec, with its classes written out.

    arithmetic: of its numbers. cut: see `loop_of`. Errors: Unreadable.
    """

    def __init__(self, tables: dict, arithmetic, cut: str = ""):
        self.arithmetic = arithmetic
        self.cut = cut
        self.key = Keys(written_out(tables))
        self.key("type")  # asked for, so that it is a known key
        self.numbers = named_numbers(self.key("numbers", {}))
        for name, value in self.numbers.items():
            if not isinstance(value, str):
                Rule().refuse(f"numbers.{name}", value, arithmetic)
        self.known: dict[str, object] = {}
        self.read: set[tuple[str, str]] = set()  # keys of blocks that were asked for
        self.instants: dict[
            object, tuple[Instant, list]
        ] = {}  # of ticks, the same in all schedules
        hz = arithmetic.time(self.number(self.key("rates.tick_hz")))
        ABOVE_0.refuse("rates.tick_hz", hz, arithmetic)
        self.T = 1 / hz
        self.signals = self.key("signals", {})
        self.blocks = self.key("block", {})
        self.wires = self.key("wire", {})
        self.outside = self.inputs()
        names = [*self.numbers, *self.signals, *self.outside]
        for name in names:
            if names.count(name) > 1 or name in RESERVED or self.owner(name) in self.blocks:
                raise Unreadable(f"{name} has two meanings")
        wires = {f"wire {port}": wire for port, wire in self.wires.items()}
        bounded_parts({**self.signals, **wires})
        texts = {name: entry for name, entry in self.numbers.items() if isinstance(entry, str)}
        bounded_parts(texts)
        for block, keys in self.blocks.items():
            for key in keys:
                if key in OF_BLOCKS.get(keys.get("type"), {}):
                    self.refuse(block, key)
            self.refuse_unfit(block, keys)
            self.phase(block)  # raises if it is not below every
        # (what, "" of each tick or a block of its runs)
        self.remembered: set[tuple[str, str]] = set()
        self.plants = {name: self.plant(name) for name in self.blocks if self.is_plant(name)}
        self.late = {}  # blocks that are dead times: (whole ticks, rest in s)
        for name, block in self.blocks.items():
            if block["type"] == "delay" and "seconds" in block:
                self.late[name] = self.dead_time(name)
        self.refuse_two_meanings()

    # Numbers and names

    def number(self, entry, dt: Fraction | None = None):
        """A number, or what an expression in numbers gives."""
        if entry is None:
            raise Unreadable("a number is missing")
        if not isinstance(entry, str):
            return self.arithmetic.number(entry)

        def value_of(name):
            return {"": self.constant(name, dt)}

        return number(entry, value_of, self.arithmetic)

    def constant(self, name: str, dt: Fraction | None):
        """A number by its name, pi, or dt where there is a period."""
        if name == "pi":
            return self.arithmetic.pi
        if name == "dt" and dt is not None:
            return self.arithmetic.number(dt)
        return self.number_called(name)

    def number_called(self, name: str):
        if name not in self.known and name in self.numbers:
            entry = self.numbers.pop(name)  # so that one that reads itself is not known
            self.known[name] = self.number(entry)
            self.numbers[name] = entry
        if name not in self.known:  # of a device: its block's name and its key
            block, _, key = name.partition("_")
            if block not in self.blocks:
                raise Unreadable(f"the number {name} is not known, or it reads itself")
            self.known[name] = self.value(block, key)
        return self.known[name]

    def value(self, block: str, key: str, default=None):
        """A key of a block that is a number."""
        entry = self.word(block, key, default)
        if entry is None:
            raise Unreadable(f"block.{block}.{key} is missing")
        return self.number(entry, self.period(block))

    def refuse(self, block: str, key: str) -> None:
        """Unreadable for a key that its type of block does not allow."""
        entry = self.blocks[block][key]
        rule = OF_BLOCKS[self.blocks[block]["type"]][key]
        if not rule.words:
            entry = self.number(entry, None if key == "every" else self.period(block))
        rule.refuse(f"block.{block}.{key}", entry, self.arithmetic)

    def refuse_unfit(self, block: str, keys: dict) -> None:
        """Unreadable for limits, and for losses of messages, that do not fit together; the loop itself does not read them."""
        path = f"block.{block}"
        acts = keys.get("anti_windup", "none")
        needs = (
            keys.keys() & {"low", "tracking_s"}
            or acts != "none"
            or keys.get("type") == "saturation"
        )
        if needs and "high" not in keys:
            raise Unreadable(f"{path}.high is missing")
        if (acts == "back-calculation") != ("tracking_s" in keys):
            raise Unreadable(
                f"{path}.tracking_s stands beside back-calculation, and not without it"
            )
        number, ends = self.number, self.arithmetic.ends
        if "high" in keys and ends(number(keys["high"]) - number(keys.get("low", 0)))[0] <= 0:
            raise Unreadable(f"{path}.high is not above low, or 0")
        share = (
            number(keys.get("tracking_s", 1)) / self.period(block) if "tracking_s" in keys else 1
        )
        if ends(share)[0] < 1 - Fraction(1, 10**6):
            raise Unreadable(f"{path}.tracking_s is less than the period of the block")
        if keys.get("type") == "channel" and loses_at_random(keys):
            for key in ("late", "lost"):
                if ends(number(keys.get(key, 0))) != (0, 0):
                    raise Unreadable(f"{path}.{key} stands beside messages that are lost at random")

    def whole(self, block: str, key: str, default=None) -> int:
        entry = self.number(self.word(block, key, default))
        return bounded(self.arithmetic.whole(entry), f"block.{block}.{key}")

    def word(self, block: str, key: str, default=None):
        self.key.asked.add(f"block.{self.blocks[block]['type']}.{key}")
        self.read.add((block, key))
        return self.blocks[block].get(key, default)

    def matrix(self, block: str, key: str, rows: int, columns: int):
        entries = self.word(block, key, [])
        if not entries and (key in ("D", "damping", "stiffness") or not rows * columns):
            return [[0] * columns for _ in range(rows)]
        values = [[self.number(entry, self.period(block)) for entry in row] for row in entries]
        if len(values) != rows or any(len(row) != columns for row in values):
            raise Unreadable(
                f"block.{block}.{key} is no matrix of {rows} rows and {columns} columns"
            )
        return values

    def every(self, block: str) -> int:
        return self.whole(block, "every", 1)

    def phase(self, block: str) -> int:
        tick = self.whole(block, "phase", 0)
        if tick >= self.every(block):
            raise Unreadable(f"block.{block}.phase = {tick} is not below every")
        return tick

    def period(self, block: str) -> Fraction:
        return self.every(block) * self.T

    def inputs(self) -> set[str]:
        """Names of signals from outside."""
        for port, needed in NEEDED.items():
            entry = self.key(f"ports.{port}", {})
            if entry and needed - entry.keys():
                raise Unreadable(f"ports.{port}.{min(needed - entry.keys())} is missing")
        of_hand = [self.key(f"ports.hand.{key}", False) for key in ("turns", "volts")]
        if not all(isinstance(flag, bool) for flag in of_hand) or all(of_hand):
            raise Unreadable("ports.hand: turns and volts are true or false, and not both true")
        if not isinstance(self.key("ports.hand.reaction", ""), str):
            raise Unreadable("ports.hand.reaction is an expression")
        wall = self.key("ports.wall", {})
        if wall and wall["stiffness"] == wall["damping"]:
            raise Unreadable("ports.wall: stiffness and damping are two numbers")
        signals: set[str] = set()
        for end in ("hand", "environment"):
            force = self.key(f"ports.{end}.force", [])
            signals |= {force} if isinstance(force, str) else set(force)
        for entry in self.key("ports.inputs", {}).values():
            signals.add(entry["signal"] if isinstance(entry, dict) else entry)
        return signals

    # Signals

    def read_form(self, node, block: str) -> dict:
        """The form of a part of a wire to `block`, over variables of the tick, memory and inputs."""
        terms = linear(node, lambda name: self.signal(name, block), self.arithmetic)
        if terms.pop("", 0):
            raise Unreadable(f"a constant in a wire to {block}")
        return terms

    def signal(self, name: str, block: str) -> dict:
        if name.startswith("prev "):
            return self.before(name.removeprefix("prev "), block)
        if name in self.outside:
            return {"!" + name: 1}
        if name in self.signals:
            return linear(
                self.signals[name], lambda inner: self.signal(inner, block), self.arithmetic
            )
        if name in ("pi", "dt") or name in self.numbers:
            return {"": self.constant(name, self.period(block) if name == "dt" else None)}
        return {"cut" if name == self.cut else name: 1}

    def before(self, name: str, block: str) -> dict:
        """The same signal in the tick before; of an impulse that runs with the block what it gave in its last run."""
        now = self.signal(name, block)
        then = {}
        for part, coefficient in now.items():
            if part:
                source = self.owner(part.split()[-1])
                impulse = self.blocks.get(source, {}).get("type") == "impulse"
                pulse = impulse and not part.endswith(".sum")
                together = (
                    pulse
                    and block
                    and (self.every(source), self.phase(source))
                    == (self.every(block), self.phase(block))
                )
                self.remembered.add((part, source if together else ""))
                then[f"@{'last' if together else 'before'} {part}"] = coefficient
            else:
                then[""] = coefficient
        return then

    def into(self, block: str, port: str = "u") -> dict:
        """What a wire gives to a port, in a tick."""
        self.key.asked.add(f"wire.{block}.{port}")
        wire = self.wires.get(f"{block}.{port}")
        if wire is None:
            raise Unreadable(f"{block}.{port} has no wire")
        return self.read_form(parsed(wire), block)

    def owner(self, name: str) -> str:
        return name.rpartition(".")[0]

    # Plants

    def is_plant(self, name: str) -> bool:
        kind = self.blocks[name]["type"]
        return kind in PLANTS and not self.word(name, "discrete", False)

    def plant(self, name: str):
        """(inputs, outputs, A, B, C, D) of a plant."""
        kind = self.blocks[name]["type"]
        self.in_each_tick(name)
        if kind in {"mass", "inertia"}:
            mass = self.value(name, kind)
            damping = self.value(name, "damping", 0)
            stiffness = self.value(name, "stiffness", 0)
            A = [[0, 1], [-stiffness / mass, -damping / mass]]
            return ["f"], ["x", "v"], A, [[0], [1 / mass]], identity(2), [[0], [0]]
        if kind == "spring":
            k = self.value(name, "k")
            d = self.value(name, "d", 0)
            return (
                ["x1", "v1", "x2", "v2"],
                ["f1", "f2"],
                [],
                [],
                [[], []],
                [[-k, -d, k, d], [k, d, -k, -d]],
            )
        if kind == "mass_matrix":
            return self.mass_matrix(name)
        if kind in DEVICES:
            axes, *parts = devices.parts_of(
                kind, lambda key, default: self.value(name, key, default), self.arithmetic
            )
            return self.body(axes, *parts)
        if kind == "tf":
            A, B, C, D = filters.transfer(
                self.numbers_of(name, "num"), self.numbers_of(name, "den")
            )
            return ["u"], ["y"], A, [[entry] for entry in B], [C], [[D]]
        return self.state_space(name)

    def in_each_tick(self, name: str) -> None:
        if self.every(name) != 1 or self.phase(name):
            raise Unreadable(f"block.{name} is continuous, and runs every so many ticks")

    def state_space(self, name: str):
        if self.word(name, "file") is not None:
            raise Unreadable(f"block.{name}.file: matrices in another file")
        inputs = self.names_of(name, "inputs", ["u"])
        outputs = self.names_of(name, "outputs", ["y"])
        if not outputs:
            raise Unreadable(f"block.{name} has no outputs")
        states = len(self.word(name, "A", []))
        A = self.matrix(name, "A", states, states)
        B = self.matrix(name, "B", states, len(inputs))
        C = self.matrix(name, "C", len(outputs), states)
        D = self.matrix(name, "D", len(outputs), len(inputs))
        return inputs, outputs, A, B, C, D

    def names_of(self, block: str, key: str, default: list[str]) -> list[str]:
        """Different names of ports."""
        listed = self.word(block, key, default)
        if not all(map(is_name, listed)) or len(set(listed)) < len(listed):
            raise Unreadable(f"block.{block}.{key} is no list of different names")
        return listed

    def mass_matrix(self, name: str):
        axes = self.names_of(name, "axes", ["x", "y"])
        if not 1 <= len(axes) <= 3 or {*axes} & {f"v{axis}" for axis in axes}:
            raise Unreadable(
                f"block.{name}.axes are 1 to 3 names, of which none is v and another one"
            )
        through = self.word(name, "through", [])
        coordinates = len(through) or len(axes)
        J = self.matrix(name, "through", coordinates, len(axes)) if through else identity(len(axes))
        parts = []
        for key in ("mass", "damping", "stiffness"):
            entries = self.word(name, key, [])
            rows = 1 if len(entries) == 1 else coordinates
            part = self.matrix(name, key, rows, coordinates)
            if key == "mass" and rows > 1:
                self.refuse_askew(part, name)
            parts.append(
                product(product(transposed(J), diagonal(part[0]) if len(entries) == 1 else part), J)
            )
        return self.body(axes, *parts)

    def refuse_askew(self, matrix, name: str) -> None:
        for row, column in zip(matrix, transposed(matrix), strict=True):
            for entry, mirrored in zip(row, column, strict=True):
                low, high = self.arithmetic.ends(entry - mirrored)
                size = sum(map(abs, self.arithmetic.ends(entry + mirrored)))
                if max(low, -high) > ASKEW * size:
                    raise Unreadable(f"block.{name}.mass is not symmetric")

    def body(self, axes, mass, damping, stiffness):
        """The plant of M a + D v + K x = f."""
        size = len(axes)
        light = inverse(
            mass, lambda pivot: ABOVE_0.refuse("a pivot of a mass matrix", pivot, self.arithmetic)
        )
        A = [[0] * size + row for row in identity(size)]
        A += [
            [-entry for entry in (*back, *slow)]
            for back, slow in zip(product(light, stiffness), product(light, damping), strict=True)
        ]
        B = [[0] * size for _ in axes] + light
        outputs = axes + [f"v{axis}" for axis in axes]
        nothing = [[0] * size for _ in outputs]
        return [f"f{axis}" for axis in axes], outputs, A, B, identity(2 * size), nothing

    def numbers_of(self, block: str, key: str) -> list:
        return [self.number(entry, self.period(block)) for entry in self.word(block, key, [])]

    def wire_of_plant(self, block: str, port: str):
        """(what acts continuously, what is sampled in a tick and held, what arrives between ticks)."""
        continuous: dict = {}
        held_form: dict = {}
        arriving: dict = {}
        self.key.asked.add(f"wire.{block}.{port}")
        text = self.wires.get(f"{block}.{port}")
        if text is None:
            self.refuse_loose(block, port)
            return continuous, held_form, arriving
        for acts, factor, signal in self.products_of(block, text):
            for name, coefficient in scaled(factor, self.signal(signal, block)).items():
                owner = self.owner(name)
                if owner in self.late and self.late[owner][1]:
                    held_form = form(held_form, (coefficient, f"{owner} read"))
                    arriving = form(arriving, (coefficient, f"@{owner} arrived"))
                elif acts and owner in self.plants:
                    continuous = form(continuous, (coefficient, name))
                else:
                    held_form = form(held_form, (coefficient, name))
        return continuous, held_form, arriving

    def products_of(self, block: str, text):
        """(whether it acts continuously, factor, signal) of each product of a wire to a plant."""
        for acts, products in zip((True, False), self.parted(block, text), strict=True):
            for sign, factors, signal in products:
                factor = sign
                for part in factors:
                    factor = factor * self.number(part, self.period(block))
                yield acts, factor, signal

    def refuse_two_meanings(self) -> None:
        """Unreadable for a name of [signals] of which a plant's output acts continuously in one wire, or in a product, and
        is held in another."""
        signals = self.signals
        ends = self.arithmetic.ends
        for name, meant in signals.items():
            first: dict[str, Any] = {}
            for port, text in self.wires.items():
                block = self.owner(port)
                if block not in self.plants or name not in self.names_read(text):
                    continue
                for meaning in (meant, f"1*({meant})"):
                    sizes: dict[
                        str, list
                    ] = {}  # of a signal: what is held, and what acts continuously
                    for sign, instead in ((1, meaning), (-1, "0")):
                        self.signals = {**signals, name: instead}
                        for acts, factor, signal in self.products_of(block, text):
                            sizes.setdefault(signal, [0, 0])[acts] += sign * factor
                    self.signals = signals
                    for signal in sizes.keys() & self.names_read(meant):
                        parts = [max(map(abs, ends(size))) for size in sizes[signal]]
                        if self.owner(signal) not in self.plants or sum(parts) < NO_GAIN:
                            continue
                        share = parts[1] / sum(parts)
                        if abs(share - first.setdefault(signal, share)) > SAME_SHARE:
                            raise Unreadable(
                                f"signals.{name} acts continuously, and is held elsewhere: {port}"
                            )

    def names_read(self, entry) -> set[str]:
        """All that expressions read, through names of signals and numbers."""
        if isinstance(entry, list):
            return {name for part in entry for name in self.names_read(part)}
        if not isinstance(entry, str):
            return set()
        names = names_in(parsed(entry))
        further = [self.signals.get(name, self.numbers.get(name)) for name in names]
        return names | self.names_read(further)

    def refuse_loose(self, block: str, port: str) -> None:
        """Unreadable for a port without a wire, but for those of a spring that need none."""
        keys = self.blocks[block]
        at_ground = port in ("x2", "v2") and not self.wires.keys() & {f"{block}.x2", f"{block}.v2"}
        undamped = port in ("v1", "v2") and not keys.get("d", 0)
        if keys["type"] != "spring" or not (at_ground or undamped):
            raise Unreadable(f"{block}.{port} has no wire")

    def parted(self, block: str, text):
        """The products of a wire to a plant that act continuously, and those that are held.

        A term that reads another plant is continuous; what reads the plant alone is held, but for the near end of such a
        term, which has the same factors and the other sign, `-ks*motor.x` of `ks*link.x - (ks + kp)*motor.x`. In brackets
        it is the same, unless a far end has no near end there: then they are one term.
        """
        between, sampled, halves, alone = [], [], [], []
        for sign, term in terms_of(text, self.signals):
            products = []
            numbers = {*self.numbers, "pi", "dt"}
            for factor, factors, signal in multiplied_out(term, self.signals, numbers):
                if signal:
                    products.append((sign * factor, factors, signal))
            far = [each for each in products if self.owner(each[2]) in self.plants.keys() - {block}]
            near = [each for each in products if self.owner(each[2]) == block]
            if self.blocks[block]["type"] == "spring":
                between += products
            elif far and near:
                unpaired, unmatched, pairs = self.paired(near, far)
                ends = {each[2].rpartition(".")[2] for each in unmatched}
                if any(each[2].rpartition(".")[2] in ends for each in unpaired):
                    between += products
                    continue
                between += pairs
                halves += unmatched
                alone += unpaired
                sampled += [each for each in products if each not in (*near, *far)]
            elif far:
                halves += products
            else:
                (alone if len(near) == len(products) else sampled).extend(products)
        unpaired, unmatched, pairs = self.paired(alone, halves)
        return between + pairs + unmatched, sampled + unpaired

    def paired(self, near, far):
        """What is left of near ends and of far ends, and those that belong together."""
        pairs = []
        unmatched = []
        unpaired = [*near]
        for half in far:
            fits = [each for each in unpaired if each[:2] == (-half[0], half[1])]
            fits.sort(key=lambda each: each[2].rpartition(".")[2] != half[2].rpartition(".")[2])
            if fits:
                unpaired.remove(fits[0])
                pairs += [half, fits[0]]
            else:
                unmatched.append(half)
        return unpaired, unmatched, pairs

    def motion(self) -> Instant:
        """The derivatives of all plants' states, over states and what is held: x' = A x + B u, y = C x + D u, u = L y + h."""
        moving = Instant()
        for name, (inputs, outputs, A, B, C, D) in self.plants.items():
            states = [f"@{name} x{state}" for state in range(len(A))]
            acting = [f"u {name}.{port}" for port in inputs]
            for into, port in zip(acting, inputs, strict=True):
                continuous, sampled, arriving = self.wire_of_plant(name, port)
                into_plant = {
                    f"y {signal}": coefficient for signal, coefficient in continuous.items()
                }
                moving.equations[into] = form(
                    into_plant, arriving, {f"@into {name}.{port}": 1} if sampled else {}
                )
            shown = [f"y {name}.{port}" for port in outputs]
            moving.equations |= rows_of(shown, C, states, D, acting)
            moving.writes |= rows_of(states, A, states, B, acting)
        return moving

    @cached_property
    def flow(self) -> Instant:
        """The motion, the same in all schedules."""
        return self.motion()

    def plant_rows(self, equations, writes):
        """Outputs of plants as a tick shows them, and what is held from this tick on."""
        for name, (inputs, outputs, A, _, C, D) in self.plants.items():
            for port in inputs:
                continuous, held_form, arriving = self.wire_of_plant(name, port)
                equations[f"held into {name}.{port}"] = held_form
                equations[f"into {name}.{port}"] = form(
                    continuous, arriving, (1, f"held into {name}.{port}")
                )
                if held_form:
                    writes[f"@into {name}.{port}"] = {f"held into {name}.{port}": 1}
            shown = [f"{name}.{port}" for port in outputs]
            states = [f"@{name} x{state}" for state in range(len(A))]
            fed = [f"into {name}.{port}" for port in inputs]
            equations |= rows_of(shown, C, states, D, fed)

    # Dead times

    def dead_time(self, name: str) -> tuple[int, Any]:
        entry = self.word(name, "seconds")
        if (
            isinstance(entry, str)
            and entry in self.numbers
            and not isinstance(self.numbers[entry], str)
        ):
            entry = self.numbers[entry]  # a decimal number, and not the double nearest to it
        seconds = self.arithmetic.time(self.number(entry) if isinstance(entry, str) else entry)
        self.in_each_tick(name)
        return ticks_and_rest(seconds, self.T, f"block.{name}.seconds", self.arithmetic)

    def late_rows(self, name, equations, writes):
        """A dead time of `whole` ticks and a `rest`.

        What blocks and hands give is held and arrives `rest` after a tick; what plants do is read
        `rest` before a tick. Blocks read both in their ticks.
        """
        whole, rest = self.late[name]
        seen: dict = {}
        input_form: dict = {}
        for part, coefficient in self.into(name, "u").items():
            if self.owner(part) in self.plants:
                seen = form(seen, (coefficient, part))
            else:
                input_form = form(input_form, (coefficient, part))
        if rest:
            equations[f"{name} read"] = {f"@{name} seen {whole}": 1} if seen else {}
            equations[f"{name}.y"] = {f"{name} read": 1, f"@{name} arrived": 1}
            writes |= shifted(f"@{name} given ", whole, input_form)
            arrival = {f"@{name} arrived": {f"@{name} given {whole}": 1} if input_form else {}}
            look = Instant({}, {})
            for part in seen:
                plant = self.owner(part)
                _, outputs, A, _, C, _ = self.plants[plant]
                row = outputs.index(part.rpartition(".")[2])
                look.equations[part] = form(
                    *((C[row][state], f"@{plant} x{state}") for state in range(len(A)))
                )
            look.writes |= shifted(f"@{name} seen ", whole, dict(seen))
            extra = [(self.T - rest, f"{name} looks", look)] if seen else []
            if input_form:
                return [(rest, f"{name} arrives", Instant({}, arrival)), *extra]
            writes |= arrival
            return extra
        equations[f"{name} now"] = form(seen, input_form)
        fifo(equations, writes, name, f"{name} now", [(f"{name}.y", whole)])
        return []

    # Blocks that run in ticks

    def run(self, name, equations, writes):
        """The law of a block in a tick in which it runs."""
        kind = self.blocks[name]["type"]
        law = LAWS.get(kind)
        if kind in CHOICES:
            key, default = CHOICES[kind]
            law += PARTS[key, self.word(name, key, default)]
        if kind == "integrator":
            law = law.replace("inner.i", "out.y")
        if kind == "lowpass" and self.word(name, "a") is not None:
            law = SMOOTHED
        if law:
            for rows, part in zip((equations, writes), self.laws(name, law), strict=True):
                rows.update(part)
        elif kind in MODELS:
            coefficients = [
                [number(part, self.value_in(name), self.arithmetic) for part in side.split(",")]
                for side in MODELS[kind]
            ]
            self.model(name, equations, writes, *coefficients)
        elif hasattr(self, run := "run_" + kind.replace("-", "_")):
            getattr(self, run)(name, equations, writes)
        else:
            raise Unreadable(f"the type {kind!r} of the block {name} is not known")

    def laws(self, block: str, law: str) -> tuple[dict, dict]:
        return equations_of(law, called_of(block), self.value_in(block), self.arithmetic)

    def value_in(self, block: str):
        """What a name in a law of a block stands for, {variable: factor} with "" for a constant.

        "into.PORT" is what its wire gives, "out.PORT", "inner.NAME" and "memory.NAME" a variable (see MEANT), NAME a number.
        """

        def value_of(name: str) -> dict:
            prefix, _, part = name.partition(".")
            if prefix == "into":
                return self.into(block, part)
            if part:
                return {called_of(block)(name): 1}
            if name in ("pi", "dt"):
                return {"": self.constant(name, self.period(block))}
            if name in WARPED:
                return {"": 1 / self.warped(block, WARPED[name])}
            default = DEFAULTS.get(name, DEFAULTS.get(f"{self.blocks[block]['type']} {name}"))
            return {"": self.value(block, name, default)}

        return value_of

    def model(self, name, equations, writes, top, bottom):
        """A transfer function from port u to port y."""
        realisation = filters.transfer(top, bottom)
        add_model(equations, writes, name, realisation, self.into(name), f"{name}.y")

    def messages(self, name, new, runs, equations, writes):
        """The receiver gets the message that was sent so many messages before the newest one, or None, and holds what it has."""
        now = [f"{name} now"] * runs
        # Of those that may still come.
        count_kept = self.whole(name, "late", 0) // self.every(name) + 1 - runs
        sent = [*now, *(f"@{name} sent {age}" for age in range(count_kept))]
        if runs:
            equations[f"{name} now"] = self.into(name)
            for age, message in enumerate(sent):
                writes[f"@{name} sent {age}"] = {message: 1}
        if new is not None:
            output = {sent[new]: 1}
        elif runs and self.word(name, "missing", "held") == "zero":
            output = {}
        else:
            output = {f"@held {name}.y": 1}
        equations[f"{name}.y"] = output

    def run_delay(self, name, equations, writes):
        equations[f"{name} now"] = self.into(name)
        taps = self.word(name, "taps")
        if taps is None:
            outputs = [(f"{name}.y", self.whole(name, "steps", 1))]
        else:
            runs = [
                bounded(self.arithmetic.whole(self.number(tap)), f"a tap of {name}") for tap in taps
            ]
            if not runs or runs != sorted(runs):
                raise Unreadable(f"block.{name}.taps do not rise")
            outputs = [(f"{name}.y{at}", ago) for at, ago in enumerate(runs, 1)]
        fifo(equations, writes, name, f"{name} now", outputs)

    def run_butterworth(self, name, equations, writes):
        order = self.whole(name, "order")
        side = self.word(name, "pass", "low")
        self.value(name, "cutoff_hz")
        sections = []
        if order:
            sections = filters.butterworth(
                order, self.warped(name, "cutoff_hz"), side, self.arithmetic
            )
        equations[f"{name} now"] = self.into(name)
        add_sections(equations, writes, name, sections, f"{name} now", f"{name}.y")

    def warped(self, name, key):
        """tan(pi f T) of a frequency, with which the bilinear transform keeps it."""
        path = f"block.{name}.{key}"
        return warped(self.value(name, key), self.period(name), path, self.arithmetic)

    def run_fir(self, name, equations, writes):
        self.weighted(name, equations, writes, self.numbers_of(name, "coefficients"))

    def run_mean(self, name, equations, writes):
        count = self.whole(name, "n")
        self.weighted(name, equations, writes, [Fraction(1, count)] * count)

    def weighted(self, name, equations, writes, weights):
        """The sum of weights times the last inputs, the first one of the newest."""
        equations[f"{name} now"] = self.into(name)
        outputs = [(f"{name} ago {age}", age) for age in range(len(weights))]
        fifo(equations, writes, name, f"{name} now", outputs)
        equations[f"{name}.y"] = form(
            *((weight, f"{name} ago {age}") for age, weight in enumerate(weights))
        )

    def run_tf(self, name, equations, writes):
        coefficients = self.numbers_of(name, "num"), self.numbers_of(name, "den")
        self.model(name, equations, writes, *coefficients)

    def run_ss(self, name, equations, writes):
        inputs, outputs, A, B, C, D = self.state_space(name)
        states = [f"@{name} x{state}" for state in range(len(A))]
        for port in inputs:
            equations[f"into {name}.{port}"] = self.into(name, port)
        fed = [f"into {name}.{port}" for port in inputs]
        shown = [f"{name}.{port}" for port in outputs]
        equations |= rows_of(shown, C, states, D, fed)
        writes |= rows_of(states, A, states, B, fed)

    def wall_rows(self, name, equations, writes):
        """Its force comes so many ticks later as `late` says, whether it runs there or not."""
        fifo(
            equations,
            writes,
            name,
            f"{name}.made",
            [(f"{name}.force", self.whole(name, "late", 0))],
        )
        equations |= self.laws(name, FORCES[self.blocks[name]["type"]])[0]

    # Time

    def frame_ticks(self) -> int:
        """After so many ticks all blocks are in step again."""
        ticks = math.lcm(1, *(self.every(name) for name in self.blocks if name not in self.plants))
        return bounded(ticks, "a period in ticks")

    def schedule(self, held: list[dict] | None = None) -> Schedule:
        """All instants of one period; held: of each tick the message that each channel gets."""
        running = [
            name for name in self.blocks if name not in self.plants and name not in self.late
        ]
        period = self.frame_ticks()
        kinds: dict[object, Instant] = {}
        rank: list[tuple[Any, int, object]] = []
        for tick in range(period):
            active = tuple(
                name for name in running if (tick - self.phase(name)) % self.every(name) == 0
            )
            now = held[tick] if held else {}
            own = (active, *now.items())
            if own not in self.instants:
                self.instants[own] = self.tick(running, active, now)
            kinds[own], extra = self.instants[own]
            rank.append((tick * self.T, 1, own))
            for later, kind, instant in extra:
                kinds[kind] = instant
                rank.append((tick * self.T + later, 2, kind))
        shown = {name: name for name in kinds[own].equations}
        least = self.arithmetic.least
        return Schedule.of(period * self.T, kinds, rank, self.flow, shown, least)

    def tick(self, running, active, held):
        """What happens in a tick in which the blocks `active` run."""
        equations: dict[str, dict] = {}
        writes: dict[str, dict] = {}
        for name in running:
            equations_of_block: dict[str, dict] = {}
            writes_of_block: dict[str, dict] = {}
            self.run(name, equations_of_block, writes_of_block)
            if name in active:
                equations |= equations_of_block
                writes |= writes_of_block
            outputs = [out for out in equations_of_block if self.owner(out) == name]
            for out in outputs:
                if name not in active:
                    holds = self.blocks[name]["type"] != "impulse" or out.endswith(".sum")
                    equations[out] = {f"@held {out}": 1} if holds else {}
                writes[f"@held {out}"] = {out: 1}
        for name, new in held.items():
            self.messages(name, new, name in active, equations, writes)
        if self.cut:
            runs = self.owner(self.cut) in active
            equations["cut"] = {self.cut: 1, "!cut": 1} if runs else {"@held cut": 1}
            writes["@held cut"] = {"cut": 1}
        for name in running:
            if self.blocks[name]["type"].startswith("wall"):
                self.wall_rows(name, equations, writes)
        extra = [row for name in self.late for row in self.late_rows(name, equations, writes)]
        self.plant_rows(equations, writes)
        for name, text in self.port_signals().items():
            equations[name] = self.read_form(parsed(text), "")
        for name in self.signals:
            equations.setdefault(name, self.read_form(parsed(self.signals[name]), ""))
        for part, source in self.remembered:
            if not source:
                writes[f"@before {part}"] = {part: 1}
            elif source in active:
                writes[f"@last {part}"] = {part: 1}
        return Instant(equations, writes), extra

    def port_signals(self) -> dict[str, str]:
        """Expressions of [ports], by the names of their outputs; of a hand of several axes the first one's."""
        signals = {}
        for name in ("displacement", "reaction"):
            entry = self.key(f"ports.hand.{name}")
            if entry:
                signals[f"hand {name}"] = entry if isinstance(entry, str) else entry[0]
        for name, entry in self.key("ports.outputs", {}).items():
            signals[f"output {name}"] = entry["signal"] if isinstance(entry, dict) else entry
        return signals


def fifo(equations, writes, name, source, outputs):
    """Each of `outputs`, (variable, runs), is `source` so many runs ago."""
    longest = max(runs for _, runs in outputs)
    for age in range(longest):
        writes[f"@{name} ago {age + 1}"] = {f"@{name} ago {age}": 1} if age else {source: 1}
    for out, runs in outputs:
        equations[out] = {f"@{name} ago {runs}": 1} if runs else {source: 1}
