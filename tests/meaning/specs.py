"""Random specs as TOML texts: rates that mostly do not divide, and what is easily read in two ways."""

import json
import math

import numpy as np

KINDS = ("dc", "dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-mean", "pmw-lm")
METHODS = ("explicit", "implicit", "trapezoidal")
SLOW = (60, 72, 90, 144, 400)  # Hz
AXES = {  # of controllers, with the ends of their ranges
    "K_VE": (0.0, 8000.0),
    "B_VE": (0.0, 60.0),
    "b": (1.0, 200.0),
    "Kp": (0.0, 100.0),
    "K_LM": (0.0, 5000.0),
    "device.mass": (0.02, 2.0),
    "device.damping": (0.0, 20.0),
}
PATHS = {
    "K_VE": "environment.K_VE",
    "B_VE": "environment.B_VE",
    "b": "controller.b",
    "Kp": "controller.Kp",
    "K_LM": "local_model.K_LM",
}
READS = {  # kinds that read an axis; all others are of all
    "b": {"pmw", "pmw-mean", "pmw-lm"},
    "Kp": {"pmw", "pmw-mean", "pmw-lm"},
    "K_LM": {"dc-lm", "dc-vc-lm", "pmw-lm"},
}


def toml(tables: dict) -> str:
    """The text of nested tables: a line for each key, its path dotted and quoted."""
    lines = []
    for name, table in tables.items():
        lines.append(f"[{name}]")
        lines += [f"{key} = {_value(value)}" for key, value in _leaves(table)]
    return "\n".join(lines) + "\n"


def _leaves(table, before=""):
    for key, value in table.items():
        path = before + (key if key.replace("_", "").isalnum() else json.dumps(key))
        if isinstance(value, dict) and value:
            yield from _leaves(value, path + ".")
        else:
            yield path, value


def _value(value) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_value(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(inner) for inner in value) + "]"
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    return repr(float(value))


def spec_text(number: int, quick: bool = False) -> str:
    """The text of a spec: of two in turn, one with a controller and one with a drawing."""
    return toml(drawing(number // 2) if number % 2 else controller(number // 2, quick))


class Draw:
    """A generator of numbers with few digits, as people write them."""

    def __init__(self, seed):
        self.random = np.random.default_rng(seed)

    def chance(self, share: float) -> bool:
        return bool(self.random.random() < share)

    def of(self, choices):
        return choices[int(self.random.integers(len(choices)))]

    def whole(self, low: int, high: int) -> int:
        return int(self.random.integers(low, high + 1))

    def between(self, low: float, high: float) -> float:
        return float(f"{self.random.uniform(low, high):.3g}")

    def size(self, low: float, high: float) -> float:
        return float(f"{math.exp(self.random.uniform(math.log(low), math.log(high))):.3g}")

    def or_zero(self, low: float, high: float, share: float = 0.25) -> float:
        return 0.0 if self.chance(share) else self.size(low, high)


def controller(seed: int, quick: bool = False) -> dict:
    """The tables of a spec with one of the eight controllers; `quick` ones have short frames."""
    draw = Draw([1, seed])
    kind = KINDS[seed % len(KINDS)]
    fast = draw.of((1000, 1000, 2000)) if quick else draw.of((1000, 1000, 2000, 8000))
    rates: dict[str, float] = {"fast_hz": fast}
    slow = draw.of(SLOW)
    if draw.chance(0.72):
        rates["slow_hz"] = slow
        ratio = fast / slow
    else:
        ratio = draw.whole(1, 25)
        rates["ratio"] = ratio
    if kind == "pmw-mean" and abs(ratio % 1 - 0.5) < 1e-9:
        rates["slow_hz"] = 60  # which whole number is nearest to 2.5?
        ratio = fast / 60
    delay = draw.of(("frame", "frame", 0, 0, 1, draw.whole(0, max(1, int(ratio)))))
    device = {
        "mass": draw.size(0.03, 1.0),
        "damping": draw.or_zero(0.3, 6.0, 0.1),
        "velocity": draw.of(("exact", "difference")),
    }
    if draw.chance(0.3):
        device["delay"] = draw.whole(0, 3)
    if draw.chance(0.25):
        device["dead_time"] = draw.between(0.0, 0.003)
    if draw.chance(0.05):
        device = {"preset": draw.of(("paper", "touch", "falcon"))}
    tables = {
        "rates": rates,
        "device": device,
        "environment": {
            "K_VE": draw.size(20.0, 3000.0),
            "B_VE": draw.or_zero(0.2, 8.0),
            "integration": draw.of(METHODS),
            "delay": delay,
        },
        "controller": {
            "kind": kind,
            "b": draw.size(5.0, 60.0),
            "Kp": draw.or_zero(2.0, 40.0, 0.5),
            "K_VC": draw.size(100.0, 3000.0),
            "B_VC": draw.size(1.0, 10.0),
        },
        "filters": {
            "lp1": low_or_high(draw, fast, "low"),
            "hp": low_or_high(draw, fast, "high"),
            "lp2": low_or_high(draw, fast, "low"),
        },
        "local_model": {
            "K_LM": draw.or_zero(20.0, 2000.0),
            "B_LM": draw.or_zero(0.2, 4.0),
            "integration": draw.of(METHODS),
            "delay": draw.whole(0, 1),
        },
    }
    if draw.chance(0.5):
        tables["operator"] = {
            "mass": draw.or_zero(0.02, 0.5),
            "damping": draw.or_zero(0.5, 8.0),
            "stiffness": draw.or_zero(10.0, 800.0, 0.5),
        }
    for table in ("filters", "local_model"):  # defaults as well
        if draw.chance(0.2):
            del tables[table]
    axes = [axis for axis in AXES if kind in READS.get(axis, {kind})]
    along = "K_VE" if draw.chance(0.6) else draw.of(axes)
    low, high = AXES[along]
    tables["sweep"] = {"along": along, along: {"start": low, "stop": high}}
    rare = Draw([7, seed])  # so that specs without what is rare stay as they are
    if rare.chance(0.3):
        add_rare_of_controller(rare, tables)
    return tables


def add_rare_of_controller(draw: Draw, tables: dict) -> None:
    """Presets beside numbers of the device, and keys that are left out where there is a default."""
    if draw.chance(0.4):
        device = tables["device"]
        device["preset"] = draw.of(("paper", "touch", "omni", "falcon", "desktop", "omega"))
        left_out = draw.of(("mass", "damping", "none"))
        if device["preset"] not in ("desktop", "omega"):
            device.pop(left_out, None)
        elif device["preset"] == "desktop" and left_out == "mass":
            device.pop("mass", None)
        device |= {} if "damping" in device or device["preset"] in ("paper", "touch", "omni", "falcon") else {"damping": 1.0}
        device |= {} if "mass" in device or device["preset"] != "omega" else {"mass": 0.1}
    swept = tables["sweep"]["along"]
    for table, keys in tables.items():
        if table not in ("rates", "device", "sweep"):
            for key in list(keys):
                if key not in ("kind", swept) and draw.chance(0.3):
                    del keys[key]


def low_or_high(draw: Draw, fast: int, side: str) -> dict:
    """A filter: mostly of low order, now and then none, odd, next to half the rate, or by its edges."""
    if draw.chance(0.1):
        inner, outer = sorted((draw.size(4.0, 20.0), draw.size(40.0, 200.0)))
        passing, stopping = (inner, outer) if side == "low" else (outer, inner)
        return {"passband_hz": passing, "stopband_hz": stopping, "passband_db": 3.0, "stopband_db": draw.of((10.0, 20.0))}
    order = draw.of((0, 1, 1, 2, 3, 4, 5, 7))
    cutoff = round(fast * draw.of((0.45, 0.49, 0.499)), 3) if draw.chance(0.2) else draw.size(3.0, 150.0)
    return {"order": order, "cutoff_hz": cutoff}


# Drawn loops

CHAIN = (
    "gain", "saturation", "delay", "taps", "hold", "impulse", "channel", "difference", "integrator", "butterworth",
    "lowpass", "pi", "pid", "lead", "notch", "biquad", "fir", "mean", "tf", "ss",
)  # fmt: skip


class Drawn:
    """One random drawing: a plant, a chain of blocks at several rates, and sometimes waves, dead times, a class."""

    def __init__(self, seed: int):
        self.draw = Draw([2, seed])
        self.tick = self.draw.of((200, 250, 400, 720, 1000))
        self.rates = self.draw.of(((1, 2, 3), (1, 5, 6), (2, 3), (1, 4), (1, 3, 4), (5, 3), (1,)))
        self.tables: dict[str, dict] = {
            "rates": {"tick_hz": self.tick},
            "numbers": {"K": self.draw.size(3.0, 60.0), "D": self.draw.or_zero(0.05, 1.0)},
            "signals": {},
            "block": {},
            "wire": {},
            "ports": {"hand": {"force": "push", "displacement": "arm.x"}},
        }

    def block(self, name, kind, **keys):
        self.tables["block"][name] = {"type": kind, **keys}

    def wire(self, port, text):
        self.tables["wire"][port] = text

    def clock(self) -> dict:
        every = self.draw.of(self.rates)
        keys = {} if every == 1 and self.draw.chance(0.5) else {"every": every}
        if every > 1 and self.draw.chance(0.6):
            keys["phase"] = self.draw.whole(0, every - 1)
        return keys

    def rate_of(self, clock) -> float:
        return self.tick / clock.get("every", 1)


def drawing(seed: int) -> dict:
    """The tables of a spec that draws its loop."""
    made = Drawn(seed)
    draw = made.draw
    made.block(
        "arm", draw.of(("mass", "mass", "inertia")), damping=draw.size(0.5, 4.0), stiffness=draw.or_zero(1.0, 200.0, 0.4)
    )
    arm = made.tables["block"]["arm"]
    arm[arm["type"]] = draw.size(0.05, 0.5)
    force = ["push"]
    end = add_chain(made, draw.whole(1, 3))
    force.append(f"- K*{end}")
    if draw.chance(0.6):
        force.append("- D*arm.v")
    if draw.chance(0.15):
        force.append("- 0.2*prev(arm.v)")
    add_second_plant(made, force)
    add_waves(made, force)
    if draw.chance(0.3):
        add_dead_time(made, force)
    if draw.chance(0.15):
        add_class(made, force)
    if draw.chance(0.15):
        made.tables["signals"]["e"] = "arm.x"
        made.block("aside", "lowpass", cutoff_hz=draw.size(2.0, 30.0), **made.clock())
        made.wire("aside.u", "e + 0.5*dt*arm.v")
        force.append("- 0.3*aside.y")
    rare = Draw([8, seed])  # likewise
    if rare.chance(0.4):
        add_rare(rare, made, force)
    made.wire("arm.f", " ".join(force))
    if draw.chance(0.2):
        made.tables["numbers"]["w"] = "2*pi*sqrt(K)/10"
        arm["damping"] = "w/3"
    tables = made.tables
    if not tables["signals"]:
        del tables["signals"]
    if draw.chance(0.15):
        rate = tables["rates"]["tick_hz"]
        tables["rates"]["tick_hz"] = "1/h"
        tables["numbers"]["h"] = 1 / rate
    text = toml(tables)
    if "D*" not in text:
        del tables["numbers"]["D"]
    tables["sweep"] = {"along": "K", "K": {"start": 0.0, "stop": 500.0}}
    if rare.chance(0.3):
        leave_out_defaults(rare, tables)
    return tables


def add_rare(draw: Draw, made: Drawn, force: list[str]) -> None:
    """What is read in more than one way, or by one key alone: `prev` of an impulse, names of [signals] in plants, D, axes."""
    made.draw, own = draw, made.draw
    ports = made.tables["ports"]
    if draw.chance(0.3):
        ports["hand"]["reaction"] = "3*arm.x + 0.4*arm.v"
    if draw.chance(0.5):
        ports["outputs"] = {"told": "arm.v", "bent": {"signal": "2*arm.x - 0.1*prev(arm.v)", "unit": "m"}}
    if draw.chance(0.3):
        ports["inputs"] = {"load": draw.of(("load", {"signal": "load", "unit": "N"}))}
        force.append("- 0.5*load")
    which = draw.of(("impulse", "names", "direct", "axes", "through", "discrete"))
    signals = made.tables["signals"]
    if which == "impulse":
        clock = made.clock()
        if clock.get("every", 1) == 1:
            clock = {"every": draw.whole(2, 4)}
        made.block("kick", "impulse", **clock)
        made.wire("kick.u", "arm.x")
        reader = dict(clock)
        if draw.chance(0.3):
            made.tables["numbers"]["often"] = clock["every"]
            reader["every"] = draw.of(("often", "2*often/2"))
        elif draw.chance(0.3):
            reader = {"every": 1}
        made.block("after", "hold", **reader)
        signals["kicked"] = "kick.y + 0.5*prev(kick.y)"
        made.wire("after.u", draw.of(("kicked", "kick.y + 0.5*prev(kick.y)", "prev(kick.y) - 0.3*prev(prev(kick.y))")))
        force.append("- 2*after.y + 0*kicked")
    elif which == "names":
        made.block("mate", "mass", mass=draw.size(0.1, 1.0), damping=draw.size(0.5, 3.0))
        pull = f"{draw.size(10.0, 400.0)}*(mate.x - arm.x)"
        signals["pull"] = draw.of((f"{pull} - 3*arm.x", f"({pull} - 0.4*arm.v)*2", pull))
        force.append(draw.of(("+ pull", "+ 0.5*(2*pull)", "- (-pull)")))
        made.wire("mate.f", f"-({pull})")
    elif which == "direct":
        made.block("lossy", "ss", A=[[-8.0]], B=[[3.0]], C=[[1.0]], D=[[draw.size(0.1, 2.0)]], inputs=["u"], outputs=["y"])
        made.wire("lossy.u", "arm.v")
        made.block("shunt", "tf", num=[draw.size(0.1, 1.0), 2.0], den=[1.0, draw.size(3.0, 30.0)])
        made.wire("shunt.u", "arm.x")
        made.block("seen", "hold", **made.clock())
        made.wire("seen.u", "shunt.y")
        force.append("- lossy.y - seen.y")
    elif which in ("axes", "through"):
        axes = ["r", "q"] if which == "axes" else ["x", "y"]
        keys = {
            "axes": axes,
            "mass": [[0.4, 0.7]],
            "damping": [[draw.size(0.5, 4.0), 2.0]],
            "stiffness": [[draw.size(5.0, 60.0), 20.0]],
        }
        if which == "through":
            keys["through"] = [[1.0, draw.between(0.1, 0.9)], [0.0, 1.0]]
        made.block("plate", "mass_matrix", **keys)
        one, two = axes
        made.block("peek", "hold", **made.clock())
        made.wire("peek.u", f"plate.{two} - 0.1*plate.v{one} - 0.3*plate.v{two}")
        made.wire(f"plate.f{one}", "3*peek.y + arm.x")
        made.wire(f"plate.f{two}", "2*arm.x")
        force.append(f"- plate.{one}")
    else:
        made.block("law", "tf", num=[0.4, 0.1], den=[1.0, -0.5], discrete=True, **made.clock())
        made.wire("law.u", "prev(arm.x)")
        force.append("- law.y")
    made.draw = own


DEFAULTS = {  # keys that may be left out, of the types that may leave them
    "mass": ("damping", "stiffness"), "inertia": ("damping", "stiffness"), "gain": ("k",), "delay": ("steps",),
    "spring": ("d",), "pi": ("ki", "method"), "pid": ("ki", "kd", "tau", "method"), "integrator": ("method",),
    "butterworth": ("pass",), "notch": ("depth",), "biquad": ("b0", "b1", "b2", "a1", "a2"), "avatar": ("integration",),
    "local_model": ("B", "integration"), "channel": ("missing",), "mass_matrix": ("damping", "stiffness"), "ss": ("D",),
}  # fmt: skip


def leave_out_defaults(draw: Draw, tables: dict) -> None:
    for name, keys in tables["block"].items():
        for key in DEFAULTS.get(keys["type"], ()):
            wired = keys["type"] == "spring" and f"{name}.v1" in tables["wire"]
            named = isinstance(keys.get(key), str) and keys[key] not in METHODS
            if draw.chance(0.4) and not wired and not named:
                keys.pop(key, None)


def linkage(seed: int, kind: str = "five-bar") -> dict:
    """The tables of a spec with a device of several axes in any pose, in a hand, before a wall of any direction."""
    made = Drawn(seed)
    draw = Draw([3, seed])
    axes = "xyz" if kind == "delta" else "xy"
    reach = {"five-bar": (0.11, 0.19), "pantograph": (0.12, 0.2), "delta": (-0.03, 0.03)}[kind]
    numbers = {
        "x": draw.between(-0.04, 0.04),
        "y": draw.between(*reach),
        "phi": draw.between(0.0, 6.2),
        "K": draw.size(50.0, 500.0),
        "B": draw.or_zero(0.5, 4.0),
    }
    made.tables["numbers"] = numbers
    made.block("device", kind, x="x", y="y", **_parts_of_device(draw, kind, axes))
    keys = {"type": "wall", "nx": "cos(phi)", "ny": "sin(phi)", "K": "K", "B": "B", **made.clock()}
    keys.pop("phase", None)
    if draw.chance(0.4):
        keys["late"] = draw.whole(1, 3 * keys.get("every", 1))
    pushes = {"x": "push", "y": "across"}
    if kind == "delta":
        numbers |= {"z": draw.between(0.1, 0.16), "tilt": draw.between(0.0, 6.2)}
        made.tables["block"]["device"]["z"] = "z"
        keys |= {"type": "wall-3d", "nx": "cos(phi)*cos(tilt)", "ny": "sin(phi)*cos(tilt)", "nz": "sin(tilt)"}
        pushes["z"] = "along"
    made.tables["block"]["wall"] = keys
    for axis, push in pushes.items():
        made.wire(f"wall.{axis}", f"device.{axis}")
        made.wire(f"device.f{axis}", f"{push} - wall.f{axis}")
    rare = Draw([9, seed])
    if rare.chance(0.5):  # the device as the documents have it
        keys = made.tables["block"]["device"]
        for key in list(keys):
            if key not in ("type", "x", "y", "z") and not (key == "l2" and "c2" in keys) and rare.chance(0.4):
                del keys[key]
    del made.tables["signals"]
    hand = {"force": list(pushes.values()), "displacement": [f"device.{axis}" for axis in axes]}
    made.tables["ports"] = {"hand": hand}
    made.tables["sweep"] = {"along": "K", "K": {"start": 0.0, "stop": 20000.0}}
    return made.tables


def conserving(seed: int) -> dict:
    """The tables of a simulation of masses on springs that conserves energy: a slow spring is an impulse once in some ticks."""
    draw = Draw([4, seed])
    bodies = draw.whole(1, 3)
    tables: dict[str, dict] = {"rates": {"tick_hz": draw.of((200, 500, 1000))}, "numbers": {"K": 10.0}, "block": {}, "wire": {}}
    forces = [[f"- {draw.size(20.0, 2000.0)}*prev(x{at}.y)"] for at in range(bodies)]
    for at in range(1, bodies):
        stretch = f"{draw.size(20.0, 2000.0)}*(prev(x{at}.y) - prev(x{at - 1}.y))"
        forces[at].append(f"- {stretch}")
        forces[at - 1].append(f"+ {stretch}")
    end = draw.whole(0, bodies - 1)
    tables["block"]["slow"] = {"type": draw.of(("impulse", "impulse", "hold"))}
    tables["wire"]["slow.u"] = f"K*prev(x{end}.y)"
    if tables["block"]["slow"]["type"] == "impulse":
        tables["block"]["slow"]["every"] = draw.whole(1, 5)
    forces[end].append("- slow.y")
    for at, terms in enumerate(forces):
        tables["block"][f"v{at}"] = {"type": "integrator", "method": "implicit"}
        tables["block"][f"x{at}"] = {"type": "integrator", "method": "implicit"}
        tables["wire"][f"v{at}.u"] = f"({' '.join(terms)})/{draw.size(0.05, 1.0)}"
        tables["wire"][f"x{at}.u"] = f"v{at}.y"
    tables["sweep"] = {"along": "K", "K": {"start": 0.0, "stop": 1e6}}
    return tables


def _parts_of_device(draw: Draw, kind: str, axes: str) -> dict:
    """Lengths, links, hand and friction."""
    keys = {}
    if kind == "delta":
        keys |= {"base": draw.between(0.03, 0.06), "platform": draw.between(0.0, 0.04)}
        keys |= {"l1": draw.between(0.06, 0.08), "l2": draw.between(0.13, 0.16)}
    else:
        keys |= {"l1": draw.between(0.09, 0.12), "l2": draw.between(0.12, 0.15)}
    if kind == "five-bar":
        keys["base"] = draw.between(0.03, 0.08)
    keys |= {"m1": draw.between(0.02, 0.08), "m2": draw.between(0.02, 0.06)}
    motors = ("motor1", "motor2") if kind == "pantograph" else ("motor_inertia",)
    for motor in motors:
        keys[motor] = draw.size(5e-6, 5e-5)
    if draw.chance(0.5):
        keys |= {"c1": draw.between(0.0, 0.06), "I1": draw.size(1e-6, 1e-4)}
        if kind != "delta":
            keys |= {"c2": "0.4*device_l2" if draw.chance(0.5) else 0.05, "I2": draw.size(1e-6, 1e-4)}
    for axis in axes:
        keys[f"hand_damping_{axis}"] = draw.size(0.5, 4.0)
    for key, least, most in (("stiffness", 20.0, 500.0), ("mass", 0.02, 0.3)):
        for axis in axes:
            if draw.chance(0.6):
                keys[f"hand_{key}_{axis}"] = draw.size(least, most)
    for friction in ("damping1", "damping2") if kind == "pantograph" else ("damping",):
        keys[friction] = draw.or_zero(1e-4, 2e-3)
    keys["handle"] = draw.or_zero(0.01, 0.1)
    return keys


def add_chain(made: Drawn, length: int) -> str:
    """Blocks in series from the arm's position; the name of the last output."""
    draw = made.draw
    signal = draw.of(("arm.x", "arm.x", "arm.x + 0.05*arm.v"))
    for number in range(length):
        name = f"c{number}"
        kind = draw.of(CHAIN)
        clock = made.clock()
        rate = made.rate_of(clock)
        out = f"{name}.y"
        keys: dict = {}
        if kind == "gain":
            keys = {"k": draw.between(0.5, 1.5)}
        elif kind == "saturation":
            keys = {"high": 1e12}
        elif kind == "delay":
            keys = {"steps": draw.whole(0, 3)}
        elif kind == "taps":
            kind = "delay"
            keys = {"taps": [draw.whole(0, 1), draw.whole(2, 4)]}
            out = f"0.5*{name}.y1 + 0.5*{name}.y2"
        elif kind == "impulse":
            out = f"{name}.y"
        elif kind == "channel":
            keys = {"missing": draw.of(("held", "zero"))}
        elif kind == "difference":
            out = f"0.05*{name}.y"
        elif kind == "integrator":
            keys = {"method": draw.of(METHODS)}
            out = f"3*{name}.y"
        elif kind == "butterworth":
            side = draw.of(("low", "low", "high"))
            cutoff = draw.of((0.4, 0.49)) * rate if side == "low" and draw.chance(0.4) else draw.size(0.02, 0.3) * rate
            keys = {"order": draw.of((0, 1, 2, 3, 5)), "cutoff_hz": round(cutoff, 4), "pass": side}
        elif kind == "lowpass":
            keys = {"a": draw.between(0.05, 1.0)} if draw.chance(0.5) else {"cutoff_hz": draw.size(1.0, 100.0)}
        elif kind == "pi":
            keys = {"kp": draw.between(0.3, 1.2), "ki": draw.or_zero(0.5, 10.0), "method": draw.of(METHODS)}
        elif kind == "pid":
            keys = {"kp": draw.between(0.3, 1.2), "ki": draw.or_zero(0.5, 10.0), "kd": draw.or_zero(0.005, 0.1)}
            keys |= {"tau": draw.or_zero(0.001, 0.05), "method": draw.of(METHODS)}
        elif kind == "lead":
            keys = {"zero_hz": round(rate * draw.between(0.05, 0.2), 4), "pole_hz": round(rate * draw.between(0.2, 0.45), 4)}
        elif kind == "notch":
            keys = {"frequency_hz": round(rate * draw.between(0.05, 0.45), 4), "q": draw.between(0.5, 5.0)}
            if draw.chance(0.5):
                keys["depth"] = draw.between(0.0, 1.5)
        elif kind == "biquad":
            keys = {"b0": draw.between(0.1, 1.0), "b1": draw.between(-0.3, 0.3), "b2": draw.between(-0.2, 0.2)}
            keys |= {"a1": draw.between(-0.8, 0.3), "a2": draw.between(-0.1, 0.3)}
        elif kind == "fir":
            keys = {"coefficients": [draw.between(-0.3, 0.8) for _ in range(draw.whole(1, 4))]}
        elif kind == "mean":
            keys = {"n": draw.whole(1, 4)}
        elif kind == "tf":
            keys = {"num": [draw.between(0.1, 0.5), draw.between(0.0, 0.3)], "den": [1.0, -0.4, draw.between(-0.2, 0.2)]}
            keys["discrete"] = True
        elif kind == "ss":
            keys = {"A": [["1 - 5*dt"]], "B": [[f"{draw.between(2.0, 6.0)}*dt"]], "C": [[1.0]], "D": [[draw.between(0.0, 0.5)]]}
            keys |= {"inputs": ["u"], "outputs": ["y"], "discrete": True}
        made.block(name, kind, **keys, **clock)
        made.wire(f"{name}.u", signal)
        signal = f"({out})" if "+" in out else out
    return signal


def add_second_plant(made: Drawn, force: list[str]):
    draw = made.draw
    which = draw.of(("none", "none", "spring", "term", "lag", "ss", "matrix"))
    if which in {"spring", "term"}:
        made.block("load", "mass", mass=draw.size(0.1, 1.0), damping=draw.size(0.5, 3.0), stiffness=draw.or_zero(1.0, 50.0))
        k = draw.size(20.0, 2000.0)
        d = draw.or_zero(0.1, 3.0)
        if which == "spring":
            made.block("link", "spring", k=k, d=d)
            for at, body in ((1, "arm"), (2, "load")):
                made.wire(f"link.x{at}", f"{body}.x")
                if d:
                    made.wire(f"link.v{at}", f"{body}.v")
            force.append("+ link.f1")
            made.wire("load.f", "link.f2")
        else:
            made.tables["numbers"]["ks"] = k
            if draw.chance(0.5):
                force.append("+ ks*(load.x - arm.x)")
            else:  # multiplied out, beside a program's own spring
                force.append("+ ks*load.x - (ks + 2)*arm.x")
            made.wire("load.f", "ks*(arm.x - load.x)")
    elif which == "lag":
        made.block("lag", "tf", num=[1.0], den=[draw.size(0.005, 0.1), 1.0])
        made.wire("lag.u", "arm.v")
        force.append(f"- {draw.between(0.1, 1.0)}*lag.y")
    elif which == "ss":
        A = [[0.0, 1.0], [-draw.size(100.0, 3000.0), -draw.size(2.0, 20.0)]]
        made.block("flex", "ss", A=A, B=[[0.0], [1.0]], C=[[draw.size(5.0, 50.0), 0.0]], D=[[0.0]], inputs=["u"], outputs=["y"])
        made.wire("flex.u", "arm.v")
        force.append("- flex.y")
    elif which == "matrix":
        made.block("table", "mass_matrix", mass=[[0.5, 0.1], [0.1, 0.4]], damping=[[draw.size(1.0, 5.0), 1.0]])
        table = made.tables["block"]["table"]
        table["stiffness"] = [[20.0, 3.0], [3.0, draw.size(10.0, 60.0)]]
        made.block("look", "hold", **made.clock())
        made.wire("look.u", "table.y - 0.1*table.vx")
        made.wire("table.fx", "4*look.y + arm.x")
        made.wire("table.fy", "3*arm.x")
        force.append("- 2*table.x")


def add_waves(made: Drawn, force: list[str]):
    draw = made.draw
    if draw.chance(0.65):
        return
    b = draw.size(2.0, 15.0)
    clock = made.clock()
    made.block("end", "wave", b=b)
    made.wire("end.v", "arm.v")
    if draw.chance(0.5):
        made.block("avatar", "avatar", b=b, integration=draw.of(METHODS), **clock)
        made.wire("avatar.in", "end.out")
        made.wire("avatar.f", f"{draw.size(5.0, 60.0)}*avatar.x_spring + {draw.or_zero(0.1, 1.0)}*avatar.v")
        made.block("back", "delay", steps=draw.whole(0, 2), **made.clock())
        made.wire("back.u", "avatar.out")
        made.wire("end.in", "back.y")
    elif draw.chance(0.5):
        made.block(
            "local", "local_model", b=b, K=draw.size(5.0, 60.0), B=draw.or_zero(0.1, 1.0), integration=draw.of(METHODS), **clock
        )
        made.wire("local.in", "end.out")
        made.wire("end.in", "local.out")
    else:  # the line's other end is a velocity into a wall that a program integrates
        made.block("far", "wave", b=b, gives="velocity", **clock)
        made.block("wall", "integrator", method=draw.of(METHODS), **clock)
        made.wire("far.in", "end.out")
        made.wire("far.f", "15*wall.y + 0.4*far.v")
        made.wire("wall.u", "far.v")
        made.block("back", "hold", **made.clock())
        made.wire("back.u", "far.out")
        made.wire("end.in", "back.y")
    force.append("- end.force")


def add_dead_time(made: Drawn, force: list[str]):
    draw = made.draw
    seconds = draw.of((0.0, 1.0, 2.0, draw.between(0.1, 0.9), draw.between(1.1, 2.9))) / made.tick
    made.block("late", "delay", seconds=float(f"{seconds:.4g}"))
    which = draw.of(("command", "measured", "read", "both"))
    if which == "command":
        made.block("far", "hold", **made.clock()) if "far" not in made.tables["block"] else None
        made.wire("late.u", "2*arm.x" if "taps" in made.tables["block"]["c0"] else "c0.y")
        force.append("- 0.7*late.y")
        if made.tables["block"].get("far", {}).get("type") == "hold":
            made.wire("far.u", "arm.x")
            force.append("- 0.1*far.y")
    elif which == "measured":
        made.wire("late.u", "arm.x + 0.02*arm.v")
        force.append("- 3*late.y")
    else:
        made.block("eye", "hold", **made.clock())
        made.wire("eye.u", "late.y")
        made.wire("late.u", "arm.x" if which == "read" else "arm.x + 0.5*push")
        force.append("- 2*eye.y")


def add_class(made: Drawn, force: list[str]):
    draw = made.draw
    made.tables["type.watch"] = {
        "numbers": {"g": draw.between(0.2, 1.0)},
        "block": {
            "far": {"type": "lowpass", "cutoff_hz": draw.size(2.0, 30.0)},
            "near": {"type": "hold", **made.clock()},
        },
        "wire": {"far.u": "seen", "near.u": "g*(far.y - 0.1*seen)"},
        "ports": {"inputs": ["seen"], "outputs": {"told": "near.y"}},
    }
    made.block("one", "watch")
    made.block("two", "watch", g="2*one_g", far={"cutoff_hz": draw.size(2.0, 30.0)})
    made.wire("one.seen", "arm.x")
    made.wire("two.seen", "one.told + arm.x")
    force.append("- two.told")
