"""Loops drawn in specs: those with limits known in closed form, and the paper's five controllers written as blocks."""

import re
import tomllib
from math import lcm

import numpy as np
from meaning.reading import machine_of

from wavesweep.checker.reader import with_numbers
from wavesweep.program.reading.keys import FILTERS

# Two springs and masses that do not act on each other, m x'' + d x' + k x = 0, and a filter that only watches.
APART = {
    "rates": {"tick_hz": 500},
    "block": {
        "one": {"type": "mass", "mass": 1.0, "damping": 0.8, "stiffness": 400.0},
        "two": {"type": "mass", "mass": 2.0, "damping": 8.0, "stiffness": 20000.0},
        "watch": {"type": "lowpass", "a": 0.25, "every": 2},
    },
    "wire": {"one.f": "0", "two.f": "0", "watch.u": "one.x"},
}

ARM = """
[rates]
tick_hz = 10000

[numbers]
kp = 240.0
kd = 3.0
c  = { value = 0.0, unit = "N*s/m", description = "gain of the friction compensation" }

[block.arm]
type = "mass"
mass = 0.2
damping = 0.063

[block.net]
type = "delay"
every = 20
phase = 10

[wire]
"net.u" = "arm.x"
"arm.f" = "-kp*net.y - kd*arm.v + c*arm.v + hand"

[ports]
hand = { force = "hand", displacement = "arm.x" }

[sweep]
along = "c"
c  = { start = -1, stop = 20 }
kp = [60, 120, 240]
"""

PD = """
[rates]
tick_hz = 1000
[numbers]
kp = 100.0
kd = 3.0
m = 0.2
[block.m]
type = "mass"
mass = "m"
[wire]
"m.f" = "-kp*m.x - kd*m.v"
[sweep]
"""

# Semi-implicit Euler, kp explicit and kd implicit: v+ = v + h/I (-kp x - kd v+), x+ = x + h v+.
JOINT = """
[rates]
tick_hz = "1/h"
[numbers]
kp = 100.0
kd = 3.0
h = 0.001
I = 0.2
[block.joint]
type = "ss"
discrete = true
A = [["I/(I + h*kd)", "-h*kp/(I + h*kd)"], ["h*I/(I + h*kd)", "1 - h*h*kp/(I + h*kd)"]]
B = [[0], [0]]
C = [[0, 1]]
outputs = ["x"]
[wire]
"joint.u" = 0
[sweep]
along = "kp"
kp = { start = 0, stop = 2e6 }
"""

# Undamped mass, difference velocity, n ticks of delay.
WALL = """
[rates]
tick_hz = 1000
[numbers]
K = 100.0
B = 1.0
n = 3
[block.m]
type = "mass"
mass = 0.1
[block.v]
type = "difference"
[block.late]
type = "delay"
steps = "n"
[wire]
"v.u" = "m.x"
"late.u" = "K*m.x + B*v.y"
"m.f" = "hand - late.y"
[ports]
hand = { force = "hand", displacement = "m.x" }
wall = { stiffness = "K", damping = "B" }
[sweep]
B = { start = 0.5, stop = 20, num = 5 }
"""

# An integrator d x' = f held over h, whose force arrives with the delay r h (k of 20 ticks).
NETWORK = """
[rates]
tick_hz = 1000
[numbers]
K = 10.0
d = 1.5
k = 10
[block.x]
type = "tf"
num = [1]
den = ["d", 0]
[block.sensor]
type = "hold"
every = 20
[block.actuator]
type = "hold"
every = 20
phase = "k"
[wire]
"sensor.u" = "x.y"
"actuator.u" = "-K*sensor.y"
"x.u" = "actuator.y"
[sweep]
along = "K"
K = { start = 0, stop = 400 }
"""

# Two loops that share a gain: k < 2 m1/T, and k < 2 sin(pi/10) m2/T with two ticks of delay.
CORNER = """
[rates]
tick_hz = 1000
[numbers]
k = 1.0
m1 = {m1}
m2 = 0.2
[block.a]
type = "mass"
mass = "m1"
[block.c]
type = "mass"
mass = "m2"
[block.late]
type = "delay"
steps = 2
[wire]
"late.u" = "c.v"
"c.f" = "-k*late.y"
"a.f" = "-k*a.v"
"""

NEXT_TO_ONE = {  # eigenvalues 1 - 2^-30 and 1 - 2^-30 beside the one that crosses
    "rates": {"tick_hz": 1.0},
    "numbers": {"p": 670.779015550422},
    "block": {
        "g": {
            "type": "ss",
            "discrete": True,
            "A": [
                [-1.5, -0.125, -2.4999999990686774, 2.4374999990686774],
                [1.0, 0.0, 1.0, -1.0],
                [1.25, 0.75, 2.2499999990686774, -1.7499999990686774],
                [0.0, 1.0, 0.0, 0.0],
            ],
            "B": [[2.0], [0.125], [-2.5], [-1.25]],
            "C": [[0.875, 0.5, 0.875, 0.125]],
            "D": [[0.0]],
            "every": 5,
        },
    },
    "wire": {"g.u": "-p*0.3*g.y"},
}

NUMBERS = {"K_VE": "environment.K_VE", "B_VE": "environment.B_VE", "K_LM": "local_model.K_LM", "B_LM": "local_model.B_LM"}
NUMBERS |= {"b": "controller.b", "Kp": "controller.Kp"}


def as_blocks(values):
    """A loop with a controller, written as blocks: the tables of a spec. values: the flat keys of the other spec."""
    kind, ratio = values["controller.kind"], values["rates.ratio"]
    measured = "m.v" if values["device.velocity"] == "exact" else "v.y"
    total = {name: values[f"device.{name}"] + values[f"operator.{name}"] for name in ("mass", "damping")}
    block = {"m": {"type": "mass", **total, "stiffness": values["operator.stiffness"]}}
    wire = {}
    if measured == "v.y":
        block["v"], wire["v.u"] = {"type": "difference"}, "m.x"
    draw = _with_waves if kind.startswith("pmw") else _direct
    force = draw(values, kind, 1 if kind == "dc" else ratio, measured, block, wire)
    wire["m.f"] = f"f_h - ({force})"
    used = " ".join([*wire.values(), *(str(value) for keys in block.values() for value in keys.values())])
    read = {name: values[path] for name, path in NUMBERS.items() if re.search(rf"\b{name}\b", used)}
    return {
        "rates": {"tick_hz": values["rates.fast_hz"]},
        "numbers": read,
        "block": block,
        "wire": wire,
        "ports": {
            "hand": {"force": "f_h", "displacement": "m.x", "reaction": force},
            "wall": {"stiffness": "K_VE", "damping": "B_VE"},
        },
    }


def _held(values, ratio, signals, block, wire):
    """The signals as the slow side reads them, and as they are in place `delay` ticks later."""
    names = []
    for name, signal in signals.items():
        block[name] = {"type": "hold", "every": ratio}
        wire[f"{name}.u"] = signal
        delay, at = values["environment.delay"], f"{name}.y"
        if delay:
            # A delay of a whole frame is the value of the last run.
            late = {"type": "delay", "every": ratio} if delay == ratio else {"type": "hold", "every": ratio, "phase": delay}
            block[f"late_{name}"], wire[f"late_{name}.u"], at = late, at, f"late_{name}.y"
        names.append(at)
    return names


def _direct(values, kind, ratio, v, block, wire):
    """Direct coupling; the local spring is about the samples of which the held force was computed."""
    law = f"K_VE*m.x + B_VE*{v}"
    if kind == "dc":
        return law
    force, *samples = _held(values, ratio, {"wall": law} | ({"x_s": "m.x", "v_s": v} if kind == "dc-lm" else {}), block, wire)
    return f"{force} + K_LM*(m.x - {samples[0]}) + B_LM*({v} - {samples[1]})" if samples else force


def _with_waves(values, kind, ratio, v, block, wire):
    """Encoder, anti-aliasing filter, avatar with its wall, and the branch of the local model."""
    filters = {
        name: {"order": values[f"filters.{name}.order"], "cutoff_hz": values[f"filters.{name}.cutoff_hz"]} for name in FILTERS
    }
    block |= {
        "end": {"type": "wave", "b": "b"},
        "lp1": {"type": "mean", "n": ratio} if kind == "pmw-mean" else {"type": "butterworth", **filters["lp1"]},
        "avatar": {"type": "avatar", "b": "b", "integration": values["environment.integration"], "every": ratio},
    }
    wire |= {"end.v": v, "lp1.u": "end.out", "avatar.in": "lp1.y", "avatar.f": "K_VE*avatar.x_spring + B_VE*avatar.v"}
    back, place = "avatar.out", "avatar.x"
    if values["environment.delay"]:
        delay = values["environment.delay"]
        late = {"type": "delay", "every": ratio} if delay == ratio else {"type": "hold", "every": ratio, "phase": delay}
        block |= {"wave": late, "place": late}
        wire |= {"wave.u": back, "place.u": place}
        back, place = "wave.y", "place.y"
    if kind == "pmw-lm":
        local = {"type": "local_model", "b": "b", "K": "K_LM", "B": "B_LM", "integration": values["local_model.integration"]}
        block |= {"hp": {"type": "butterworth", **filters["hp"], "pass": "high"}, "local": local}
        block |= {"lp2": {"type": "butterworth", **filters["lp2"]}}
        block |= {"last": {"type": "delay", "steps": values["local_model.delay"]}}
        wire |= {"hp.u": "end.out", "local.in": "hp.y", "lp2.u": "local.out", "last.u": "lp2.y"}
        back += " + last.y"
    wire["end.in"] = f"{back} + Kp*({place} - m.x)"
    return "end.force"


def random_tables(seed):
    """A mass under the feedback of a chain of random blocks at one to three rates, with numbers in wires and keys."""
    r = np.random.default_rng(seed)
    rates = r.choice([1, 2, 3, 4, 5, 6, 10], size=r.integers(1, 4), replace=False).tolist()
    stiffness = float(r.choice([0.0, 50.0]))
    block = {"m": {"type": "mass", "mass": "m0", "damping": float(r.uniform(0, 2)), "stiffness": stiffness}}
    wire, last = {}, "m.x"
    for index in range(int(r.integers(1, 5))):
        every, name = int(r.choice(rates)), f"b{index}"
        keys = RANDOM[int(r.integers(len(RANDOM)))]
        placed = {} if keys["type"] == "tf" else {"every": every, "phase": int(r.integers(every))}
        cutoff = {"cutoff_hz": float(r.uniform(0.02, 0.3) * 1000 / every)} if keys["type"] == "butterworth" else {}
        block[name] = {**keys, **placed, **cutoff}
        scale = "/200" if keys["type"] == "difference" else ""
        wire[f"{name}.u"], last = f"({last} + g*m.x){scale}", f"{name}.y"
    wire["m.f"] = f"h - k*{last} - d*m.v - k0*m.x"
    numbers = {
        "k": r.uniform(1, 30),
        "d": r.uniform(0, 3),
        "k0": r.choice([0.0, 20.0]),
        "g": r.uniform(0.1, 0.9),
        "m0": r.uniform(0.1, 1),
    }
    ports = {"hand": {"force": "h", "displacement": "m.x"}}
    return {"rates": {"tick_hz": 1000.0}, "numbers": numbers, "block": block, "wire": wire, "ports": ports}


def random_feedback(seed):
    """`random_tables` whose feedback is held over the frame: k and d are gains of signals in the same wire."""
    tables = random_tables(seed)
    block, wire = tables["block"], tables["wire"]
    last, *others = (f"{name}.y" for name in reversed(block) if name != "m")
    block["out"] = {"type": "hold", "every": lcm(*(each.get("every", 1) for each in block.values()))}
    return {**tables, "wire": wire | {"out.u": f"k*{last} + 0.1*d*{(*others, 'm.v')[0]}", "m.f": "h - out.y - k0*m.x"}}


RANDOM = (
    {"type": "delay", "steps": 2},
    {"type": "hold"},
    {"type": "butterworth", "order": 2},
    {"type": "butterworth", "order": 1, "pass": "high"},
    {"type": "difference"},
    {"type": "gain", "k": "g"},
    {"type": "integrator", "method": "trapezoidal"},
    {"type": "tf", "num": [1.0], "den": ["g/50", 1.0]},
    {"type": "ss", "discrete": True, "A": [["g/2", 0.1], [0, 0.3]], "B": [[1], [0.5]], "C": [[1, 0]], "D": [[0.2]]},
)


def random_network(seed, count=20, chain=False):
    """A drawing of many blocks at four rates, each of which reads one or several of those before it; chain: always the last."""
    r, tables = np.random.default_rng(seed), random_tables(seed)
    block, wire = {"m": tables["block"]["m"]}, {}
    for index in range(count - 1):
        keys, every, name = RANDOM[int(r.integers(len(RANDOM)))], int(r.choice([1, 2, 5, 10])), f"b{index}"
        placed = {} if keys["type"] == "tf" else {"every": every, "phase": int(r.integers(every))}
        cutoff = {"cutoff_hz": float(r.uniform(0.02, 0.3) * 1000 / every)} if keys["type"] == "butterworth" else {}
        block[name] = {**keys, **placed, **cutoff}
        read = [index - 1] * chain + r.integers(-1, max(index, 1), size=r.integers(1, 3)).tolist() if index else [-1]
        sources = ["m.x" if source < 0 else f"b{source}.y" for source in dict.fromkeys(read)]
        wire[f"{name}.u"] = " + ".join(str(r.choice(["g*", "", "(-k0)*"])) + source for source in sources)
    wire["m.f"] = f"h - k*b{count - 2}.y + d*b{count // 2}.y - (k0 + d)*b{count - 4}.y - d*m.v - k0*m.x"
    return {**tables, "block": block, "wire": wire}


# A motor's speed under a PI controller that runs every 5 ticks from tick 2 on; a disturbance, and a position that drifts.
DRIVE = """
[rates]
tick_hz = 1000
[numbers]
kp = 0.5
ki = 8.0
[block.motor]
type = "inertia"
inertia = 0.02
damping = 0.05
[block.control]
type = "ss"
every = 5
phase = 2
discrete = true
A = [[1]]
B = [[1]]
C = [["ki*0.005"]]
D = [["kp"]]
[signals]
error = "ref - motor.v"
[wire]
"control.u" = "error"
"motor.f" = "control.y - load"
[ports.inputs]
ref = { signal = "ref", unit = "rad/s" }
load = { signal = "load", unit = "N*m" }
[ports.outputs]
speed = { signal = "motor.v", unit = "rad/s" }
angle = { signal = "motor.x", unit = "rad" }
torque = { signal = "control.y", unit = "N*m" }
twice = "2*motor.v + error"
[sweep]
along = "kp"
kp = { start = 0.01, stop = 50 }
"""


def drive(inputs, kp=0.5, ki=8.0):
    """Speed, angle, torque and the sum `twice` of DRIVE in every tick, `(4, ticks)`, by the documents; inputs: ref and load."""
    machine = machine_of(with_numbers(tomllib.loads(DRIVE), {"kp": kp, "ki": ki}))
    names = [f"output {name}" for name in ("speed", "angle", "torque", "twice")]
    runs = [machine.run(np.asarray(push), which, names) for which, push in zip(("ref", "load"), inputs, strict=True)]
    return np.array([sum(run[name] for run in runs) for name in names])
