"""Loops drawn in a spec, block by block of docs/blocks.md, in exact time.

Variables of a tick are outputs of blocks, "block.port", and inputs of plants, "into block.port".
"""

import ast
import math
from fractions import Fraction

import numpy as np
from meaning import filters
from meaning.classes import written_out
from meaning.controllers import Keys, add_model, add_sections
from meaning.expressions import linear, multiplied_out, number, terms_of
from meaning.machine import Instant, Schedule, exact, form, scaled

DEVICES = ("five-bar", "pantograph", "delta")  # of several axes
PLANTS = {"mass", "inertia", "mass_matrix", *DEVICES, "spring", "ss", "tf"}


def read(tables: dict, cut: str = "") -> Schedule:
    """The schedule of a spec that draws its loop.

    cut: an output of a block, to which where it is read an input is added whenever the block runs.
    """
    return Drawing(tables, cut).schedule()


class Drawing:
    """Numbers, blocks, wires and ports of a spec, with its classes written out."""

    def __init__(self, tables: dict, cut: str = ""):
        self.cut = cut
        self.key = Keys(tables)
        self.key("type")
        self.key = Keys(written_out(tables))
        self.numbers = {}
        for name, given in self.key("numbers", {}).items():
            self.numbers[name] = given["value"] if isinstance(given, dict) else given
        self.known: dict[str, float] = {}
        rate = self.key("rates.tick_hz")
        if isinstance(rate, str):
            self.T = Fraction(1 / self.number(rate))
        else:
            self.T = 1 / exact(rate)
        self.signals = self.key("signals", {})
        self.blocks = self.key("block", {})
        self.wires = self.key("wire", {})
        self.outside = self.inputs()
        self.remembered: set[tuple[str, str]] = set()  # what is remembered: of each tick, or of the runs of a block
        self.plants = {name: self.plant(name) for name in self.blocks if self.is_plant(name)}
        self.late = {}  # blocks that are dead times: (whole ticks, rest in s)
        for name, block in self.blocks.items():
            if block["type"] == "delay" and "seconds" in block:
                self.late[name] = self.dead_time(name)

    # Numbers and names

    def number(self, given, dt: float | None = None) -> float:
        """A number, or what an expression in numbers gives."""
        if not isinstance(given, str):
            return float(given)

        def value_of(name):
            if name == "pi":
                return {"": math.pi}
            if name == "dt":
                return {"": dt}
            return {"": self.number_called(name)}

        return number(given, value_of)

    def number_called(self, name: str) -> float:
        if name not in self.known and name not in self.numbers:  # of a device: its block's name and its key
            block, _, key = name.partition("_")
            self.known[name] = self.value(block, key)
        if name not in self.known:
            self.known[name] = self.number(self.numbers[name])
        return self.known[name]

    def value(self, block: str, key: str, default=None) -> float:
        """A key of a block that is a number."""
        Keys.asked.add(f"block.{self.blocks[block]['type']}.{key}")
        given = self.blocks[block].get(key, default)
        return self.number(given, self.period(block))

    def whole(self, block: str, key: str, default=None) -> int:
        Keys.asked.add(f"block.{self.blocks[block]['type']}.{key}")
        given = self.blocks[block].get(key, default)
        return round(self.number(given))

    def word(self, block: str, key: str, default):
        Keys.asked.add(f"block.{self.blocks[block]['type']}.{key}")
        return self.blocks[block].get(key, default)

    def matrix(self, block: str, key: str, rows: int, columns: int) -> np.ndarray:
        given = self.word(block, key, [])
        if not given:
            return np.zeros((rows, columns))
        values = [[self.number(entry, self.period(block)) for entry in row] for row in given]
        return np.array(values).reshape(rows, columns)

    def every(self, block: str) -> int:
        return self.whole(block, "every", 1)

    def phase(self, block: str) -> int:
        return self.whole(block, "phase", 0)

    def period(self, block: str) -> float:
        return self.every(block) * float(self.T)

    def inputs(self) -> set[str]:
        """Names of signals from outside."""
        force = self.key("ports.hand.force", [])
        found = {force} if isinstance(force, str) else set(force)
        for given in self.key("ports.inputs", {}).values():
            found.add(given["signal"] if isinstance(given, dict) else given)
        return found

    # Signals

    def read_form(self, node, block: str) -> dict[str, float]:
        """The form of a part of a wire to `block`, over variables of the tick, memory and inputs."""
        terms = linear(node, lambda name: self.signal(name, block))
        if terms.get("", 0.0):
            raise ValueError("a constant in a wire")
        terms.pop("", None)
        return terms

    def signal(self, name: str, block: str) -> dict[str, float]:
        if name.startswith("prev "):
            return self.before(name.removeprefix("prev "), block)
        if name in self.outside:
            return {"!" + name: 1.0}
        if name in self.signals:
            return linear(self.signals[name], lambda inner: self.signal(inner, block))
        if name == "pi":
            return {"": math.pi}
        if name == "dt":
            return {"": self.period(block)}
        if name in self.numbers:
            return {"": self.number_called(name)}
        return {"cut" if name == self.cut else name: 1.0}

    def before(self, name: str, block: str) -> dict[str, float]:
        """The same signal in the tick before; of an impulse that runs with the block what it gave in its last run."""
        now = self.signal(name, block)
        then = {}
        for part, coefficient in now.items():
            if part:
                source = self.owner(part.split()[-1])
                pulse = self.blocks.get(source, {}).get("type") == "impulse" and not part.endswith(".sum")
                together = (
                    pulse and block and (self.every(source), self.phase(source)) == (self.every(block), self.phase(block))
                )
                self.remembered.add((part, source if together else ""))
                then[f"@{'last' if together else 'before'} {part}"] = coefficient
            else:
                then[""] = coefficient
        return then

    def into(self, block: str, port: str) -> dict[str, float]:
        """What a wire gives to a port, in a tick."""
        return self.read_form(_whole(self.wires[f"{block}.{port}"]), block)

    def owner(self, name: str) -> str:
        return name.rpartition(".")[0]

    # Plants

    def is_plant(self, name: str) -> bool:
        kind = self.blocks[name]["type"]
        return kind in PLANTS and not self.word(name, "discrete", False)

    def plant(self, name: str):
        """(inputs, outputs, A, B, C, D) of a plant."""
        kind = self.blocks[name]["type"]
        if kind in {"mass", "inertia"}:
            mass = self.value(name, kind)
            damping = self.value(name, "damping", 0.0)
            stiffness = self.value(name, "stiffness", 0.0)
            A = np.array([[0, 1], [-stiffness / mass, -damping / mass]])
            return ["f"], ["x", "v"], A, np.array([[0], [1 / mass]]), np.eye(2), np.zeros((2, 1))
        if kind == "spring":
            k = self.value(name, "k")
            d = self.value(name, "d", 0.0)
            D = np.array([[-k, -d, k, d], [k, d, -k, -d]])
            ends = ["x1", "v1", "x2", "v2"]
            return ends, ["f1", "f2"], np.zeros((0, 0)), np.zeros((0, 4)), np.zeros((2, 0)), D
        if kind == "mass_matrix":
            return self.mass_matrix(name)
        if kind in DEVICES:
            return getattr(self, kind.replace("-", "_"))(name)
        if kind == "tf":
            A, B, C, D = filters.transfer(self.list(name, "num"), self.list(name, "den"))
            return ["u"], ["y"], A, B[:, None], C[None, :], np.array([[D]])
        return self.state_space(name)

    def state_space(self, name: str):
        inputs = self.word(name, "inputs", ["u"])
        outputs = self.word(name, "outputs", ["y"])
        states = len(self.word(name, "A", []))
        A = self.matrix(name, "A", states, states)
        B = self.matrix(name, "B", states, len(inputs))
        C = self.matrix(name, "C", len(outputs), states)
        D = self.matrix(name, "D", len(outputs), len(inputs))
        return inputs, outputs, A, B, C, D

    def mass_matrix(self, name: str):
        axes = self.word(name, "axes", ["x", "y"])
        through = self.word(name, "through", [])
        coordinates = len(through) or len(axes)
        J = self.matrix(name, "through", coordinates, len(axes)) if through else np.eye(len(axes))
        parts = {}
        for key in ("mass", "damping", "stiffness"):
            given = self.word(name, key, [])
            rows = 1 if len(given) == 1 else coordinates
            part = self.matrix(name, key, rows, coordinates)
            parts[key] = J.T @ (np.diag(part[0]) if len(given) == 1 else part) @ J
        return self.body(axes, parts["mass"], parts["damping"], parts["stiffness"])

    def five_bar(self, name: str):
        """The device in its pose: what the motions of motors and links for a motion of the hand store and take.

        Motors are at (+-base/2, 0), elbows outwards.
        """
        default = {
            "x": 0.0, "y": 0.15, "base": 0.06, "l1": 0.1, "l2": 0.13, "motor_inertia": 2e-5, "m1": 0.05, "m2": 0.04,
            "handle": 0.03, "damping": 5e-4,
        }  # fmt: skip
        of = {key: self.value(name, key, given) for key, given in default.items()}
        inner, outer = self.links(name, of)
        mass, damping, stiffness = self.hand(name, of, "xy")
        for side in (-1, 1):
            reach = np.array([of["x"] - side * of["base"] / 2, of["y"]])
            motor, link, middle = two_links(reach, -side, of["l1"], of["l2"], outer[1])
            mass = mass + (of["motor_inertia"] + inner[2] + inner[0] * inner[1] ** 2) * np.outer(motor, motor)
            mass = mass + outer[0] * middle.T @ middle + outer[2] * np.outer(link, link)
            damping = damping + of["damping"] * np.outer(motor, motor)
        return self.body(["x", "y"], mass, damping, stiffness)

    def pantograph(self, name: str):
        """Both motors at (0, 0): the first turns the inner link, the second the outer one, whose angle is its own."""
        default = {
            "x": 0.05, "y": 0.17, "l1": 0.12, "l2": 0.14, "motor1": 4e-5, "motor2": 4e-5, "m1": 0.06, "m2": 0.05,
            "handle": 0.03, "damping1": 5e-4, "damping2": 5e-4,
        }  # fmt: skip
        of = {key: self.value(name, key, given) for key, given in default.items()}
        inner, outer = self.links(name, of)
        mass, damping, stiffness = self.hand(name, of, "xy")
        first, second, middle = two_links(np.array([of["x"], of["y"]]), -1, of["l1"], of["l2"], outer[1])
        mass = mass + (of["motor1"] + inner[2] + inner[0] * inner[1] ** 2) * np.outer(first, first)
        mass = mass + outer[0] * middle.T @ middle + (of["motor2"] + outer[2]) * np.outer(second, second)
        damping = damping + of["damping1"] * np.outer(first, first) + of["damping2"] * np.outer(second, second)
        return self.body(["x", "y"], mass, damping, stiffness)

    def delta(self, name: str):
        """Motors at `base` from the centre, 120 degrees apart, whose arms swing in planes through the axis z, elbows outwards.

        The rods are thin and alike all along: of ends with velocities a and b they have the energy m (aa + ab + bb)/6.
        """
        default = {
            "x": 0.0, "y": 0.0, "z": 0.13, "base": 0.05, "platform": 0.025, "l1": 0.07, "l2": 0.14, "motor_inertia": 2e-5,
            "m1": 0.03, "m2": 0.02, "handle": 0.06, "damping": 3e-4,
        }  # fmt: skip
        of = {key: self.value(name, key, given) for key, given in default.items()}
        l1, m1 = of["l1"], of["m1"]
        c1 = self.value(name, "c1", l1 / 2)
        I1 = self.value(name, "I1", m1 * l1**2 / 12)
        mass, damping, stiffness = self.hand(name, of, "xyz")
        up = np.array([0.0, 0.0, 1.0])
        for turn in (0, 2 * math.pi / 3, 4 * math.pi / 3):
            away = np.array([math.cos(turn), math.sin(turn), 0.0])
            joint = np.array([of["x"], of["y"], of["z"]]) + (of["platform"] - of["base"]) * away  # from the motor
            ahead = joint @ away
            # |joint - l1 (away cos q + up sin q)| = l2
            half = (joint @ joint + l1**2 - of["l2"] ** 2) / (2 * l1)
            q = math.atan2(of["z"], ahead) - math.acos(half / math.hypot(of["z"], ahead))
            rod = joint - l1 * (math.cos(q) * away + math.sin(q) * up)
            of_q = l1 * (math.cos(q) * up - math.sin(q) * away)
            motor = rod / (rod @ of_q)  # q' for a motion of the hand: a rod keeps its length
            elbow = np.outer(of_q, motor)
            mass = mass + (of["motor_inertia"] + I1 + m1 * c1**2) * np.outer(motor, motor)
            mass = mass + of["m2"] / 3 * (elbow.T @ elbow + (elbow.T + elbow) / 2 + np.eye(3))
            damping = damping + of["damping"] * np.outer(motor, motor)
        return self.body(["x", "y", "z"], mass, damping, stiffness)

    def links(self, name: str, of: dict) -> list[tuple[float, float, float]]:
        """(mass, place of its centre, inertia about that) of the inner and the outer link."""
        found = []
        for which in "12":
            length = of[f"l{which}"]
            mass = of[f"m{which}"]
            centre = self.value(name, f"c{which}", length / 2)
            found.append((mass, centre, self.value(name, f"I{which}", mass * length**2 / 12)))
        return found

    def hand(self, name: str, of: dict, axes: str) -> list[np.ndarray]:
        """Mass, damping and stiffness of the hand, with the handle."""
        parts = []
        for key in ("mass", "damping", "stiffness"):
            parts.append(np.diag([self.value(name, f"hand_{key}_{axis}", 0.0) for axis in axes]))
        parts[0] = parts[0] + of["handle"] * np.eye(len(axes))
        return parts

    def body(self, axes, mass, damping, stiffness):
        """The plant of a matrix of mass."""
        parts = {"damping": damping, "stiffness": stiffness}
        inverse = np.linalg.inv(mass)
        size = len(axes)
        A = np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ parts["stiffness"], -inverse @ parts["damping"]]])
        B = np.vstack([np.zeros((size, size)), inverse])
        outputs = axes + [f"v{axis}" for axis in axes]
        return [f"f{axis}" for axis in axes], outputs, A, B, np.eye(2 * size), np.zeros((2 * size, size))

    def list(self, block: str, key: str) -> list[float]:
        return [self.number(entry, self.period(block)) for entry in self.word(block, key, [])]

    def wire_of_plant(self, block: str, port: str):
        """(what acts continuously, what is sampled in a tick and held, what arrives between ticks)."""
        continuous: dict[str, float] = {}
        held: dict[str, float] = {}
        arriving: dict[str, float] = {}
        text = self.wires.get(f"{block}.{port}")
        if text is None:
            return continuous, held, arriving
        between, sampled = self.parted(block, text)
        for acts, products in ((True, between), (False, sampled)):
            for sign, factors, signal in products:
                factor = sign * math.prod(self.number(each, self.period(block)) for each in factors)
                for name, coefficient in scaled(factor, self.signal(signal, block)).items():
                    owner = self.owner(name)
                    if owner in self.late and self.late[owner][1]:
                        held = form(held, (coefficient, f"{owner} read"))
                        arriving = form(arriving, (coefficient, f"@{owner} arrived"))
                    elif acts and owner in self.plants:
                        continuous = form(continuous, (coefficient, name))
                    else:
                        held = form(held, (coefficient, name))
        return continuous, held, arriving

    def parted(self, block: str, text):
        """The products of a wire to a plant that act continuously, and those that are held.

        A term that reads another plant is continuous; what reads the plant alone is held, but for the near end of such a
        term, which has the same factors and the other sign, `-ks*motor.x` of `ks*link.x - (ks + kp)*motor.x`. In brackets
        it is the same, unless a far end has no near end there: then they are one term.
        """
        between, sampled, halves, alone = [], [], [], []
        for sign, term in terms_of(text, self.signals):
            products = []
            for own, factors, signal in multiplied_out(term, self.signals, {*self.numbers, "pi", "dt"}):
                if signal:
                    products.append((sign * own, factors, signal))
            far = [each for each in products if self.owner(each[2]) in self.plants.keys() - {block}]
            near = [each for each in products if self.owner(each[2]) == block]
            if self.blocks[block]["type"] == "spring":
                between += products
            elif far and near:
                left, unmatched, pairs = self.paired(near, far)
                ends = {each[2].rpartition(".")[2] for each in unmatched}
                if any(each[2].rpartition(".")[2] in ends for each in left):
                    between += products
                    continue
                between += pairs
                halves += unmatched
                alone += left
                sampled += [each for each in products if each not in (*near, *far)]
            elif far:
                halves += products
            else:
                (alone if len(near) == len(products) else sampled).extend(products)
        left, unmatched, pairs = self.paired(alone, halves)
        return between + pairs + unmatched, sampled + left

    def paired(self, near, far):
        """What is left of near ends and of far ends, and those that belong together."""
        pairs = []
        for half in far:
            fits = [each for each in near if each[:2] == (-half[0], half[1]) and each not in pairs]
            fits.sort(key=lambda each: each[2].rpartition(".")[2] != half[2].rpartition(".")[2])
            pairs += [half, *fits[:1]] if fits else []
        return [each for each in near if each not in pairs], [each for each in far if each not in pairs], pairs

    def motion(self) -> dict[str, dict]:
        """The derivatives of all plants' states, over states and what is held: u = L y + h, y = C x + D u."""
        ins = [(name, port) for name, plant in self.plants.items() for port in plant[0]]
        outs = [f"{name}.{port}" for name, plant in self.plants.items() for port in plant[1]]
        states = [f"@{name} x{at}" for name, plant in self.plants.items() for at in range(len(plant[2]))]
        if not states:
            return {}
        A, B, C, D = (_diagonal([plant[place] for plant in self.plants.values()]) for place in (2, 3, 4, 5))
        L = np.zeros((len(ins), len(outs)))
        held: list[dict] = []
        for row, (name, port) in enumerate(ins):
            continuous, sampled, arriving = self.wire_of_plant(name, port)
            for signal, coefficient in continuous.items():
                L[row, outs.index(signal)] += coefficient
            held.append(form(arriving, {f"@into {name}.{port}": 1.0} if sampled else {}))
        closed = np.linalg.inv(np.eye(len(ins)) - L @ D)  # u = closed (L C x + h)
        moved = A + B @ closed @ L @ C
        pushed = B @ closed
        motion = {}
        for row, state in enumerate(states):
            terms = [(moved[row, at], other) for at, other in enumerate(states)]
            forced = [scaled(pushed[row, at], held[at]) for at in range(len(ins))]
            motion[state] = form(*terms, *forced)
        return motion

    def plant_rows(self, equations, writes):
        """Outputs of plants as a tick shows them, and what is held from this tick on."""
        for name, (inputs, outputs, A, _, C, D) in self.plants.items():
            for port in inputs:
                continuous, held, arriving = self.wire_of_plant(name, port)
                equations[f"held into {name}.{port}"] = held
                equations[f"into {name}.{port}"] = form(continuous, arriving, (1.0, f"held into {name}.{port}"))
                if held:
                    writes[f"@into {name}.{port}"] = {f"held into {name}.{port}": 1.0}
            for row, port in enumerate(outputs):
                states = [(float(C[row, at]), f"@{name} x{at}") for at in range(len(A))]
                fed = [(float(D[row, at]), f"into {name}.{into}") for at, into in enumerate(inputs)]
                equations[f"{name}.{port}"] = form(*states, *[pair for pair in fed if pair[0]])

    # Dead times

    def dead_time(self, name: str) -> tuple[int, Fraction]:
        given = self.blocks[name]["seconds"]
        Keys.asked.add("block.delay.seconds")
        if isinstance(given, str) and given in self.numbers and not isinstance(self.numbers[given], str):
            given = self.numbers[given]
        seconds = Fraction(self.number(given)) if isinstance(given, str) else exact(given)
        whole = math.floor(seconds / self.T)
        return whole, seconds - whole * self.T

    def late_rows(self, name, equations, writes):
        """A dead time of `whole` ticks and a `rest`.

        What blocks and hands give is held and arrives `rest` after a tick; what plants do is read
        `rest` before a tick. Blocks read both in their ticks.
        """
        whole, rest = self.late[name]
        seen: dict[str, float] = {}
        given: dict[str, float] = {}
        for sign, node in terms_of(_whole(self.wires[f"{name}.u"])):
            for part, coefficient in self.read_form(node, name).items():
                if self.owner(part) in self.plants:
                    seen = form(seen, (sign * coefficient, part))
                else:
                    given = form(given, (sign * coefficient, part))
        if rest:
            equations[f"{name} read"] = {f"@{name} seen {whole}": 1.0} if seen else {}
            equations[f"{name}.y"] = {f"{name} read": 1.0, f"@{name} arrived": 1.0}
            writes[f"@{name} given 0"] = given
            for at in range(whole):
                writes[f"@{name} given {at + 1}"] = {f"@{name} given {at}": 1.0}
            instant = Instant({}, {f"@{name} arrived": {f"@{name} given {whole}": 1.0}})
            look = Instant({}, {})
            for part in seen:
                plant = self.owner(part)
                _, outputs, A, _, C, _ = self.plants[plant]
                row = outputs.index(part.rpartition(".")[2])
                look.equations[part] = form(*((float(C[row, at]), f"@{plant} x{at}") for at in range(len(A))))
            look.writes[f"@{name} seen 0"] = dict(seen)
            for at in range(whole):
                look.writes[f"@{name} seen {at + 1}"] = {f"@{name} seen {at}": 1.0}
            return [(rest, f"{name} arrives", instant), (self.T - rest, f"{name} looks", look)]
        equations[f"{name} now"] = form(seen, given)
        fifo(equations, writes, name, f"{name} now", [(f"{name}.y", whole)])
        return []

    # Blocks that run in ticks

    def run(self, name, equations, writes):
        """The law of a block in a tick in which it runs."""
        kind = self.blocks[name]["type"]
        law = getattr(self, "run_" + kind.replace("-", "_"))
        law(name, equations, writes)

    def one(self, name, port="u"):
        return self.into(name, port)

    def run_gain(self, name, equations, writes):
        del writes
        equations[f"{name}.y"] = scaled(self.value(name, "k", 1.0), self.one(name))

    def run_hold(self, name, equations, writes):
        del writes
        equations[f"{name}.y"] = self.one(name)

    def run_channel(self, name, equations, writes):
        self.run_hold(name, equations, writes)

    def run_saturation(self, name, equations, writes):
        self.run_hold(name, equations, writes)

    def run_delay(self, name, equations, writes):
        equations[f"{name} now"] = self.one(name)
        taps = self.word(name, "taps", None)
        if taps is None:
            outputs = [(f"{name}.y", self.whole(name, "steps", 1))]
        else:
            outputs = [(f"{name}.y{at + 1}", round(self.number(tap))) for at, tap in enumerate(taps)]
        fifo(equations, writes, name, f"{name} now", outputs)

    def run_impulse(self, name, equations, writes):
        equations[f"{name}.y"] = self.one(name)
        equations[f"{name}.sum"] = {f"@{name} sum": 1.0, f"{name}.y": 1.0}
        writes[f"@{name} sum"] = {f"{name}.sum": 1.0}

    def run_difference(self, name, equations, writes):
        rate = 1 / self.period(name)
        equations[f"{name} now"] = self.one(name)
        equations[f"{name}.y"] = {f"{name} now": rate, f"@{name} u": -rate}
        writes[f"@{name} u"] = {f"{name} now": 1.0}

    def run_integrator(self, name, equations, writes):
        equations[f"{name} now"] = self.one(name)
        self.integral(name, equations, writes, self.word(name, "method", "explicit"), f"{name}.y")

    def integral(self, name, equations, writes, method, out):
        """The integral of variable `NAME now`."""
        step = self.period(name)
        before = f"@{name} integral"
        now = f"{name} now"
        equations[out] = {
            "explicit": {before: 1.0, f"@{name} u": step},
            "implicit": {before: 1.0, now: step},
            "trapezoidal": {before: 1.0, now: step / 2, f"@{name} u": step / 2},
        }[method]
        writes[before] = {out: 1.0}
        writes[f"@{name} u"] = {now: 1.0}

    def run_pi(self, name, equations, writes):
        equations[f"{name} now"] = self.one(name)
        self.integral(name, equations, writes, self.word(name, "method", "implicit"), f"{name} i")
        kp = self.value(name, "kp")
        ki = self.value(name, "ki", 0.0)
        equations[f"{name}.y"] = {f"{name} now": kp, f"{name} i": ki}

    def run_pid(self, name, equations, writes):
        self.run_pi(name, equations, writes)
        tau = self.value(name, "tau", 0.0)
        whole = tau + self.period(name)
        equations[f"{name} d"] = {f"@{name} d": tau / whole, f"{name} now": 1 / whole, f"@{name} u": -1 / whole}
        writes[f"@{name} d"] = {f"{name} d": 1.0}
        equations[f"{name}.y"] = form(equations[f"{name}.y"], (self.value(name, "kd", 0.0), f"{name} d"))

    def run_butterworth(self, name, equations, writes):
        order = self.whole(name, "order")
        cutoff = self.value(name, "cutoff_hz")
        side = self.word(name, "pass", "low")
        sections = filters.butterworth(order, cutoff, 1 / self.period(name), side) if order else []
        equations[f"{name} now"] = self.one(name)
        add_sections(equations, writes, name, sections, f"{name} now", f"{name}.y")

    def run_lowpass(self, name, equations, writes):
        if self.word(name, "a", None) is not None:
            share = self.value(name, "a")
        else:
            w = 2 * math.pi * self.value(name, "cutoff_hz") * self.period(name)
            share = w / (1 + w)
        equations[f"{name}.y"] = form((1 - share, f"@{name} y"), scaled(share, self.one(name)))
        writes[f"@{name} y"] = {f"{name}.y": 1.0}

    def run_lead(self, name, equations, writes):
        zero = 1 / math.tan(math.pi * self.value(name, "zero_hz") * self.period(name))
        pole = 1 / math.tan(math.pi * self.value(name, "pole_hz") * self.period(name))
        # (1 + zero r)/(1 + pole r) with r = (z - 1)/(z + 1)
        model = filters.transfer([1 + zero, 1 - zero], [1 + pole, 1 - pole])
        add_model(equations, writes, name, model, self.one(name), f"{name}.y")

    def run_notch(self, name, equations, writes):
        c = 1 / math.tan(math.pi * self.value(name, "frequency_hz") * self.period(name))
        q = self.value(name, "q")
        depth = self.value(name, "depth", 0.0)
        # s = c r in units of w, r = (z - 1)/(z + 1): c^2 r^2 + c r/q + 1
        top = [c * c + depth * c / q + 1, 2 - 2 * c * c, c * c - depth * c / q + 1]
        bottom = [c * c + c / q + 1, 2 - 2 * c * c, c * c - c / q + 1]
        add_model(equations, writes, name, filters.transfer(top, bottom), self.one(name), f"{name}.y")

    def run_biquad(self, name, equations, writes):
        top = [self.value(name, "b0", 1.0), self.value(name, "b1", 0.0), self.value(name, "b2", 0.0)]
        bottom = [1.0, self.value(name, "a1", 0.0), self.value(name, "a2", 0.0)]
        add_model(equations, writes, name, filters.transfer(top, bottom), self.one(name), f"{name}.y")

    def run_fir(self, name, equations, writes):
        self.weighted(name, equations, writes, self.list(name, "coefficients"))

    def run_mean(self, name, equations, writes):
        count = self.whole(name, "n")
        self.weighted(name, equations, writes, [1 / count] * count)

    def weighted(self, name, equations, writes, weights):
        """The sum of weights times the last inputs, the first one of the newest."""
        equations[f"{name} now"] = self.one(name)
        outputs = [(f"{name} ago {at}", at) for at in range(len(weights))]
        fifo(equations, writes, name, f"{name} now", outputs)
        equations[f"{name}.y"] = form(*((weight, f"{name} ago {at}") for at, weight in enumerate(weights)))

    def run_tf(self, name, equations, writes):
        model = filters.transfer(self.list(name, "num"), self.list(name, "den"))
        add_model(equations, writes, name, model, self.one(name), f"{name}.y")

    def run_ss(self, name, equations, writes):
        inputs, outputs, A, B, C, D = self.state_space(name)
        states = [f"@{name} x{at}" for at in range(len(A))]
        for port in inputs:
            equations[f"into {name}.{port}"] = self.into(name, port)
        fed = [f"into {name}.{port}" for port in inputs]
        for row, port in enumerate(outputs):
            equations[f"{name}.{port}"] = form(_pairs(C[row], states), _pairs(D[row], fed))
        for row, state in enumerate(states):
            writes[state] = form(_pairs(A[row], states), _pairs(B[row], fed))

    def run_wall(self, name, equations, writes):
        """The depth along the normal, and K times it and B times its change."""
        normal = self.normal(name)
        equations[f"{name}.depth"] = form(*(scaled(share, self.into(name, axis)) for axis, share in normal.items()))
        rate = self.value(name, "B", 0.0) / self.period(name)
        K = self.value(name, "K", 100.0)
        equations[f"{name}.made"] = {f"{name}.depth": K + rate, f"@{name} depth": -rate}
        writes[f"@{name} depth"] = {f"{name}.depth": 1.0}

    run_wall_3d = run_wall

    def normal(self, name) -> dict[str, float]:
        axes = "xyz" if self.blocks[name]["type"] == "wall-3d" else "xy"
        return {axis: self.value(name, f"n{axis}", float(axis == "x")) for axis in axes}

    def wall_rows(self, name, equations, writes):
        """Its force comes so many ticks later as `late` says, whether it runs there or not."""
        fifo(equations, writes, name, f"{name}.made", [(f"{name}.force", self.whole(name, "late", 0))])
        for axis, share in self.normal(name).items():
            equations[f"{name}.f{axis}"] = {f"{name}.force": share}

    def run_wave(self, name, equations, writes):
        del writes
        b = self.value(name, "b")
        root = math.sqrt(2 * b)
        come = self.into(name, "in")
        if self.word(name, "gives", "force") == "force":
            speed = self.into(name, "v")
            equations[f"{name}.force"] = form(scaled(b, speed), scaled(-root, come))
            equations[f"{name}.out"] = form(scaled(root, speed), scaled(-1.0, come))
        else:
            force = self.into(name, "f")
            equations[f"{name}.v"] = form(scaled(root / b, come), scaled(-1 / b, force))
            equations[f"{name}.out"] = form(come, scaled(-math.sqrt(2 / b), force))

    def run_avatar(self, name, equations, writes):
        self.moved(name, equations, writes, self.into(name, "f"))

    def run_local_model(self, name, equations, writes):
        force = {f"{name}.x_spring": self.value(name, "K"), f"{name}.v": self.value(name, "B", 0.0)}
        self.moved(name, equations, writes, force)

    def moved(self, name, equations, writes, force):
        """v = (sqrt(2b) in - f)/b, out = in - sqrt(2/b) f, and x from v."""
        b = self.value(name, "b")
        method = self.word(name, "integration", "implicit")
        step = self.period(name)
        come = self.into(name, "in")
        equations[f"{name} f"] = force
        equations[f"{name}.v"] = form(scaled(math.sqrt(2 * b) / b, come), (-1 / b, f"{name} f"))
        equations[f"{name}.out"] = form(come, (-math.sqrt(2 / b), f"{name} f"))
        before = f"@{name} x"
        half = method == "trapezoidal"
        equations[f"{name}.x"] = form((1.0, before), (step / 2 if half else step, f"{name}.v"))
        if half:
            equations[f"{name}.x"] = form(equations[f"{name}.x"], (step / 2, f"@{name} v"))
            writes[f"@{name} v"] = {f"{name}.v": 1.0}
        writes[before] = {f"{name}.x": 1.0}
        equations[f"{name}.x_spring"] = {before: 1.0} if method == "explicit" else {f"{name}.x": 1.0}

    # Time

    def schedule(self) -> Schedule:
        running = [name for name in self.blocks if name not in self.plants and name not in self.late]
        period = math.lcm(1, *(self.every(name) for name in running))
        kinds: dict[object, Instant] = {}
        rank: list[tuple[Fraction, int, object]] = []
        extra: list[tuple[Fraction, str, Instant]] = []
        for tick in range(period):
            active = tuple(name for name in running if (tick - self.phase(name)) % self.every(name) == 0)
            if active not in kinds:
                kinds[active], extra = self.tick(running, active)
            rank.append((tick * self.T, 1, active))
            for later, kind, instant in extra:
                kinds[kind] = instant
                rank.append((tick * self.T + later, 2, kind))
        rank.sort(key=lambda row: row[:2])
        times = []
        ticks = {}
        for at, (time, order, kind) in enumerate(rank):
            if order == 1:
                ticks[at] = len(ticks)
            times.append((time, kind))
        shown = {name: name for name in kinds[active].equations}
        return Schedule(period * self.T, kinds, times, ticks, self.motion(), shown)

    def tick(self, running, active):
        """What happens in a tick in which the blocks `active` run."""
        equations: dict[str, dict] = {}
        writes: dict[str, dict] = {}
        extra = []
        for name in running:
            own: dict[str, dict] = {}
            kept: dict[str, dict] = {}
            self.run(name, own, kept)
            if name in active:
                equations |= own
                writes |= kept
            for out in own:
                if self.owner(out) != name:
                    continue
                if name not in active:
                    holds = self.blocks[name]["type"] != "impulse" or out.endswith(".sum")
                    equations[out] = {f"@held {out}": 1.0} if holds else {}
                writes[f"@held {out}"] = {out: 1.0}
        if self.cut:
            runs = self.owner(self.cut) in active
            equations["cut"] = {self.cut: 1.0, "!cut": 1.0} if runs else {"@held cut": 1.0}
            writes["@held cut"] = {"cut": 1.0}
        for name in running:
            if self.blocks[name]["type"].startswith("wall"):
                self.wall_rows(name, equations, writes)
        for name in self.late:
            extra += self.late_rows(name, equations, writes)
        self.plant_rows(equations, writes)
        for name, text in self.port_signals().items():
            equations[name] = self.read_form(_whole(text), "")
        for name in self.signals:
            equations.setdefault(name, self.read_form(_whole(self.signals[name]), ""))
        for part, source in self.remembered:
            if not source:
                writes[f"@before {part}"] = {part: 1.0}
            elif source in active:
                writes[f"@last {part}"] = {part: 1.0}
        return Instant(equations, writes), extra

    def port_signals(self) -> dict[str, str]:
        """Expressions of [ports], by the names of their outputs; of a hand of several axes the first one's."""
        found = {}
        for name in ("displacement", "reaction"):
            given = self.key(f"ports.hand.{name}")
            if given:
                found[f"hand {name}"] = given if isinstance(given, str) else given[0]
        for name, given in self.key("ports.outputs", {}).items():
            found[f"output {name}"] = given["signal"] if isinstance(given, dict) else given
        return found


def two_links(reach, side, l1, l2, c2):
    """For a motion of the hand at `reach`: the turns of both links, and the motion of a point at c2 of the outer one.

    The hand is at the elbow plus the outer link, so its velocity is that of both links:
    l1 q' (-sin q, cos q) + l2 a' (-sin a, cos a). The elbow lies to the left of the way to the hand if `side` is 1.
    """
    far = np.hypot(*reach)
    q = math.atan2(reach[1], reach[0]) + side * math.acos((l1**2 + far**2 - l2**2) / (2 * l1 * far))
    outer = reach - l1 * np.array([math.cos(q), math.sin(q)])
    a = math.atan2(outer[1], outer[0])
    of_q = np.array([-math.sin(q), math.cos(q)])
    of_a = np.array([-math.sin(a), math.cos(a)])
    inner_turn, outer_turn = np.linalg.inv(np.column_stack([l1 * of_q, l2 * of_a]))
    return inner_turn, outer_turn, l1 * np.outer(of_q, inner_turn) + c2 * np.outer(of_a, outer_turn)


def fifo(equations, writes, name, source, outputs):
    """Each of `outputs`, (variable, runs), is `source` so many runs ago."""
    longest = max(runs for _, runs in outputs)
    for at in range(longest):
        writes[f"@{name} ago {at + 1}"] = {f"@{name} ago {at}": 1.0} if at else {source: 1.0}
    for out, runs in outputs:
        equations[out] = {f"@{name} ago {runs}": 1.0} if runs else {source: 1.0}


def _whole(text):
    """The node of an expression."""
    return ast.parse(str(text).strip(), mode="eval").body


def _pairs(row, names):
    return form(*((float(coefficient), name) for coefficient, name in zip(row, names, strict=True)))


def _diagonal(parts):
    rows = sum(part.shape[0] for part in parts)
    columns = sum(part.shape[1] for part in parts)
    whole = np.zeros((rows, columns))
    row = 0
    column = 0
    for part in parts:
        whole[row : row + part.shape[0], column : column + part.shape[1]] = part
        row += part.shape[0]
        column += part.shape[1]
    return whole
