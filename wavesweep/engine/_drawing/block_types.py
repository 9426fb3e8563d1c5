"""The blocks that a spec can draw: their keys and ports by type.

Validation and the documents' table derive from this table. `engine._loops.definitions` has the
equations by the same names and keys; words of firmware are transfer functions
(`wavesweep.engine._drawing.drawn_block`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from wavesweep.engine._keys.key import HIGHEST_ORDER, INTEGRATIONS, LONGEST_FRAME, Key

LONGEST_DELAY = 1000  # steps of a delay, each of them a state
MOST_LATE, MOST_LOST = 1000, 100  # of the messages of a channel: ticks, and losses in a row


@dataclass(frozen=True, slots=True)
class BlockType:
    """A type of block: its keys by name, its ports, and its meaning.

    ports: (inputs, outputs), or for each value of the key `by` such a pair; None if keys name them,
    and those of the default if the key `axes` does. plant: whether it is continuous, and so runs in
    every tick in any case; "continuous" if only without `discrete = true`. steps: what it does
    where the steps between its runs vary, run j being h[j] seconds after the one before; empty if
    it has no such rule, and then neither a proof nor a simulation takes it there. below_half: keys
    of frequencies below half the block's own rate, unless its order is 0. body: the key of the
    mass, of a type with a position x and a velocity v. settles: whether it comes to rest by itself,
    whatever its keys are. limits: keys that say what it does beyond limits, within which it is
    linear; only the simulation and C read them. moments: outputs that are not held, each with the
    expression in those that are. either: two keys, of which a block has one. formula: numerator and
    denominator of the transfer function that a block of firmware is, in descending powers of z - 1,
    of a biquad of z; empty of other blocks, and so of each that may be continuous, whatever its
    keys: a formula is taken as that of a run. stepwise: rows of its matrices A and B, then those of C
    and D, in states that mean the same at every period, if its own do not. The names in both are
    explained in `wavesweep.engine._drawing.drawn_block`.
    """

    keys: Mapping[str, Key]
    ports: Any
    description: str
    by: str = ""
    plant: bool | str = False
    steps: str = ""
    body: str = ""
    settles: bool = False
    limits: tuple[str, ...] = ()
    moments: tuple[tuple[str, str], ...] = ()
    below_half: tuple[str, ...] = ()
    either: tuple[str, ...] = ()
    formula: tuple[tuple[str, ...], ...] = ()
    stepwise: tuple[str, ...] = ()

    def ports_of(self, keys: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return input and output ports of a block with these keys."""
        if self.by:
            by_value: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = self.ports
            return by_value[keys[self.by]]
        if "axes" in self.keys:
            names = keys["axes"]
            return tuple(f"f{name}" for name in names), (*names, *(f"v{name}" for name in names))
        return (keys["inputs"], keys["outputs"]) if self.ports is None else self.ports

    def is_plant(self, keys: Mapping[str, object]) -> bool:
        """Return whether a block with these keys runs in every tick in any case."""
        return not keys["discrete"] if self.plant == "continuous" else bool(self.plant)


def _number(
    name: str, unit: str, description: str, default: float | None = None, **ends: Any
) -> Key:
    return Key.number(name, default, unit, description, required=default is None, **ends)


def _positive(name: str, unit: str, description: str) -> Key:
    return Key.positive(name, None, unit, description, required=True)


def _other(name: str, kind: str, description: str, default: Any = None) -> Key:
    return Key(name, kind, default, "", description, required=default is None)


_DISCRETE = _other(
    "discrete",
    "boolean",
    "whether it is a difference equation; otherwise continuous, a plant",
    False,
)
_B = _positive("b", "N*s/m", "wave impedance")
_INTEGRATION = Key.word("integration", "implicit", "how the velocity is integrated", INTEGRATIONS)
_U_Y = (("u",), ("y",))
_SHARE = {"low": 0.0, "high": 1.0}
_INTEGRALS = {
    "explicit": "rectangles from the left: a run adds what the input was in the last one",
    "implicit": "rectangles from the right: a run adds what the input is now",
    "trapezoidal": "trapezia: a run adds the mean of both",
}
_METHOD = Key.word("method", "implicit", "how the integral is computed", _INTEGRALS)
_KP = _number("kp", "", "gain")
_KI = _number("ki", "", "gain of the integral, in the unit of kp over s", 0.0)


_SAME = "the same in each run, however long the step"
_HIGH = Key.number("high", None, "", "upper limit of y; the loop is linear below it")
_LOW = Key.number("low", None, "", "lower limit of y; by default -high")
_LIMITS = (
    _HIGH,
    _LOW,
    Key.word(
        "anti_windup",
        "none",
        "what the integral does while y is at a limit: back-calculation moves it towards the limit, clamping keeps it while u "
        "drives y on",
        ("none", "back-calculation", "clamping"),
    ),
    Key.positive(
        "tracking_s", None, "s", "time constant of back-calculation, at least the block's period"
    ),
)
_BEYOND = tuple(key.path for key in _LIMITS)

# In formulas, T is the block's own period (s), ahead the share of a period by which an integral
# reads ahead, late the share of the last input in a step, tan(pi f T) the prewarped frequency of
# the bilinear transform. A pid's states are the integral, the last input and the last slope, those
# of the ends of waves the last position and velocity.
_P = "(kp + ki*ahead*T)"
_PID = (
    "1; late*T; 0; (1 - late)*T",
    "0; 0; 0; 1",
    "0; -1/(tau + T); tau/(tau + T); 1/(tau + T)",
    "ki; ki*late*T - kd/(tau + T); kd*tau/(tau + T); kp + ki*ahead*T + kd/(tau + T)",
)
_X, _V = "1; T/2; T/2*r/b; -T/2/b", "0; 0; r/b; -1/b"


def _type(description: str, ports: object, *keys: Key, **more: Any) -> BlockType:
    return BlockType(MappingProxyType({key.path: key for key in keys}), ports, description, **more)


TYPES = MappingProxyType(
    {
        "mass": _type(
            "m x'' + d x' + k x = f, continuous: exact",
            (("f",), ("x", "v")),
            _positive("mass", "kg", "mass m, or an inertia (kg*m^2)"),
            _number("damping", "N*s/m", "viscous damping d", 0.0),
            _number("stiffness", "N/m", "stiffness k of a spring to the ground", 0.0),
            plant=True,
            body="mass",
        ),
        "inertia": _type(
            "I x'' + d x' + k x = f, a mass that turns: f is a torque, x an angle; exact",
            (("f",), ("x", "v")),
            _positive("inertia", "kg*m^2", "moment of inertia I"),
            _number("damping", "N*m*s/rad", "viscous damping d", 0.0),
            _number("stiffness", "N*m/rad", "stiffness k of a spring to the ground", 0.0),
            plant=True,
            body="inertia",
        ),
        "mass_matrix": _type(
            "M a + D v + K x = f of several axes, matrices, continuous: exact. With `through`, a row for each of further "
            "coordinates such as joints and links, mass, damping and stiffness are those of these: M = through' mass through",
            (("fx", "fy"), ("x", "y", "vx", "vy")),
            _other("axes", "ports", "names of the axes, at most 3", ("x", "y")),
            _other(
                "mass", "rows", "mass matrix, symmetric, a list of rows; a single row is a diagonal"
            ),
            _other("damping", "rows", "damping matrix; zeros if absent", ()),
            _other(
                "stiffness",
                "rows",
                "stiffness matrix of springs to the ground; zeros if absent",
                (),
            ),
            _other(
                "through",
                "rows",
                "motion of each further coordinate for one of each axis, a row each",
                (),
            ),
            plant=True,
        ),
        "spring": _type(
            "spring and damper between two ends, continuous where these are plants: f1 = k (x2 - x1) + d (v2 - v1), f2 = -f1; "
            "without d, v1 and v2 need no wires; for an end at rest, as at the ground, leave x2 and v2 without wires",
            (("x1", "v1", "x2", "v2"), ("f1", "f2")),
            _number("k", "N/m", "stiffness"),
            _number("d", "N*s/m", "damping", 0.0),
            plant=True,
            settles=True,
        ),
        "ss": _type(
            "state-space model",
            None,
            _other("A", "rows", "state matrix, a list of rows", ()),
            _other("B", "rows", "input matrix", ()),
            _other("C", "rows", "output matrix", ()),
            _other("D", "rows", "direct terms; zeros if absent", ()),
            _other(
                "inputs",
                "ports",
                "names of the input ports; none for a recursion by itself",
                ("u",),
            ),
            _other("outputs", "ports", "names of the output ports", ("y",)),
            _DISCRETE,
            plant="continuous",
            steps=f"if discrete, {_SAME}",
        ),
        "tf": _type(
            "transfer function in s, or in z if discrete",
            _U_Y,
            _other("num", "list", "coefficients of the numerator, descending powers"),
            _other("den", "list", "coefficients of the denominator, descending powers"),
            _DISCRETE,
            plant="continuous",
            steps=f"if discrete, {_SAME}",
        ),
        "gain": _type("y = k u", _U_Y, _number("k", "", "factor", 1.0), steps=_SAME, settles=True),
        "saturation": _type(
            "y = u within limits; intervals and responses are those of the loop within them, simulate and C keep to them",
            _U_Y,
            replace(_HIGH, required=True),
            _LOW,
            steps=_SAME,
            settles=True,
            formula=(("1",), ("1",)),
            limits=("high", "low"),
        ),
        "delay": _type(
            "u as it was some runs of the block ago, or a dead time ago, which may end between two ticks: held signals then "
            "arrive at plants between two ticks, and plants are read between two ticks; with taps it gives y1, y2, ...",
            _U_Y,
            Key.whole("steps", 1, "runs of the block", 0, LONGEST_DELAY),
            Key.number("seconds", None, "s", "in place of steps: dead time", low=0.0),
            Key(
                "taps",
                "list",
                None,
                "",
                "in place of steps: runs of the block, in ascending order, one for each output",
            ),
            steps=_SAME,
            settles=True,
            either=("steps", "seconds"),
        ),
        "hold": _type("u as it was when the block ran last", _U_Y, steps=_SAME, settles=True),
        "impulse": _type(
            "y = u in the tick in which the block runs, 0 in all others: corrects a state once a run; sum adds up all y so far",
            (("u",), ("sum",)),
            moments=(("y", "{name}.sum - prev({name}.sum)"),),
        ),
        "channel": _type(
            "hold whose runs send messages, which may come late, be overtaken and then dropped, or be lost; the loop's own "
            "intervals and responses have all of them in time",
            _U_Y,
            Key.whole(
                "late",
                0,
                "most ticks by which a message comes late, each by its own number from 0 on",
                0,
                MOST_LATE,
                "tick",
            ),
            Key.whole("lost", 0, "most messages in a row that are lost", 0, MOST_LOST),
            Key.word(
                "missing",
                "held",
                "y without a message: the last one, or zero from a run of the block on",
                ("held", "zero"),
            ),
            _number(
                "loss",
                "1",
                "probability that a message is lost, of itself; outside of bursts if there are such",
                0.0,
                **_SHARE,
            ),
            _number(
                "burst",
                "1",
                "probability that a burst of losses begins with a message",
                0.0,
                **_SHARE,
            ),
            _number(
                "burst_end", "1", "probability that a burst ends with a message", 1.0, **_SHARE
            ),
            _number(
                "burst_loss", "1", "probability that a message is lost in a burst", 1.0, **_SHARE
            ),
            settles=True,
        ),
        "difference": _type(
            "change of u since the last run, over the block's own period",
            _U_Y,
            steps="y[j] = (u[j] - u[j-1])/h[j]",
            settles=True,
        ),
        "integrator": _type(
            "integral of u; of a velocity in semi-implicit Euler it is implicit, and an explicit force reads prev(...) of it",
            _U_Y,
            Key.word("method", "explicit", "how the integral is computed", _INTEGRALS),
            *_LIMITS,
            limits=_BEYOND,
            steps="explicit: y[j] = y[j-1] + h[j-1] u[j-1]; implicit: y[j] = y[j-1] + h[j] u[j]; "
            "trapezoidal: y[j] = y[j-1] + h[j] (u[j] + u[j-1])/2",
            stepwise=_PID,
        ),
        "butterworth": _type(
            "digital Butterworth filter at the block's own rate",
            _U_Y,
            Key.whole("order", None, "order; 0 for no filter", 0, HIGHEST_ORDER, required=True),
            _positive("cutoff_hz", "Hz", "-3 dB frequency, below half the block's own rate"),
            Key.word("pass", "low", "which side passes", ("low", "high")),
            below_half=("cutoff_hz",),
            settles=True,
        ),
        "lowpass": _type(
            "y += a (u - y); with cutoff_hz, a = w/(1 + w), w = 2 pi cutoff_hz times the block's period, as firmware has it",
            _U_Y,
            Key.positive("a", None, "1", "share of the difference that a run takes", high=1.0),
            Key.positive("cutoff_hz", None, "Hz", "in place of a: 1/(2 pi time constant)"),
            steps="y[j] = y[j-1] + a (u[j] - y[j-1]); with cutoff_hz, a = w/(1 + w), w = 2 pi cutoff_hz h[j]",
            either=("a", "cutoff_hz"),
            settles=True,
            formula=(("a", "a"), ("1", "a")),
            stepwise=("1 - a; a", "1 - a; a"),
        ),
        "pi": _type(
            "y = kp u + ki integral of u, within limits if high is given",
            _U_Y,
            _KP,
            _KI,
            _METHOD,
            *_LIMITS,
            limits=_BEYOND,
            steps="y[j] = kp u[j] + ki i[j], where i is what an integrator of the same method gives",
            formula=((_P, "ki*T"), ("1", "0")),
            stepwise=_PID,
        ),
        "pid": _type(
            "y = kp u + ki integral of u + kd d, d + tau d' = u' by backward differences, within limits if high is given",
            _U_Y,
            _KP,
            _KI,
            _number("kd", "", "gain of the derivative, in the unit of kp times s", 0.0),
            _number(
                "tau", "s", "time constant of the derivative's filter; 0 for none", 0.0, low=0.0
            ),
            _METHOD,
            *_LIMITS,
            limits=_BEYOND,
            steps="y[j] = kp u[j] + ki i[j] + kd d[j], i as in pi, d[j] = (tau d[j-1] + u[j] - u[j-1])/(tau + h[j])",
            formula=(
                (f"{_P}*(T + tau) + kd", f"{_P}*T + ki*T*(T + tau)", "ki*T**2"),
                ("T + tau", "T", "0"),
            ),
            stepwise=_PID,
        ),
        "lead": _type(
            "(1 + s/(2 pi zero_hz))/(1 + s/(2 pi pole_hz)) by the bilinear transform, each corner prewarped",
            _U_Y,
            _positive("zero_hz", "Hz", "corner of the numerator, below half the block's own rate"),
            _positive(
                "pole_hz", "Hz", "corner of the denominator, below half the block's own rate"
            ),
            below_half=("zero_hz", "pole_hz"),
            settles=True,
            formula=(("1 + 1/tan(pi*zero_hz*T)", "2"), ("1 + 1/tan(pi*pole_hz*T)", "2")),
        ),
        "notch": _type(
            "(s^2 + depth w s/q + w^2)/(s^2 + w s/q + w^2), w = 2 pi frequency_hz, by the bilinear transform prewarped there",
            _U_Y,
            _positive(
                "frequency_hz", "Hz", "frequency that is taken out, below half the block's own rate"
            ),
            _positive("q", "", "quality: the frequency over the width between the -3 dB points"),
            _number("depth", "", "gain that is left at the frequency", 0.0, low=0.0),
            below_half=("frequency_hz",),
            settles=True,
            formula=(
                ("(1 + 1/K**2)/4 + depth/(4*q*K)", "1 + depth/(2*q*K)", "1"),
                ("(1 + 1/K**2)/4 + 1/(4*q*K)", "1 + 1/(2*q*K)", "1"),
            ),
        ),
        "biquad": _type(
            "(b0 + b1/z + b2/z^2)/(1 + a1/z + a2/z^2)",
            _U_Y,
            *(
                _number(name, "", "coefficient of the numerator", float(name == "b0"))
                for name in ("b0", "b1", "b2")
            ),
            *(_number(name, "", "coefficient of the denominator", 0.0) for name in ("a1", "a2")),
            steps=_SAME,
            formula=(("b0", "b1", "b2"), ("1", "a1", "a2")),
        ),
        "fir": _type(
            "sum of c_i times u as it was i runs ago, for coefficients c_0, c_1 and so on",
            _U_Y,
            _other("coefficients", "list", "coefficients, the first one of u itself"),
            steps=_SAME,
            settles=True,
        ),
        "mean": _type(
            "mean of u in the last n runs of the block; an average over an exposure is a plant 1/s before a difference",
            _U_Y,
            Key.whole("n", None, "runs of the block", 1, LONGEST_DELAY, required=True),
            steps=_SAME,
            settles=True,
        ),
        "wave": _type(
            "end of a wave line: force = b v - sqrt(2b) in, out = sqrt(2b) v - in; "
            "or v = (sqrt(2b) in - f)/b, out = in - sqrt(2/b) f",
            {"force": (("v", "in"), ("force", "out")), "velocity": (("f", "in"), ("v", "out"))},
            _B,
            Key.word("gives", "force", "what it gives to its side", ("force", "velocity")),
            by="gives",
            steps=_SAME,
        ),
        "avatar": _type(
            "decoder and avatar of a slow environment; the spring reads x_spring",
            (("in", "f"), ("v", "x", "x_spring", "out")),
            _B,
            _INTEGRATION,
            steps="x[j] = x[j-1] + h[j] v[j], and trapezoidal x[j] = x[j-1] + h[j] (v[j] + v[j-1])/2, h[j] elapsed; "
            "x_spring[j] is x[j], and if explicit x[j-1]",
            stepwise=(_X, _V, _V, _X, _X, "0; 0; 1; -r/b"),
        ),
        "local_model": _type(
            "local model of the interaction with a decoder of its own",
            (("in",), ("out",)),
            _B,
            _number("K", "N/m", "stiffness"),
            _number("B", "N*s/m", "damping", 0.0),
            _INTEGRATION,
            steps="v[j] = (sqrt(2b) in[j] - f[j])/b, f[j] = K x_spring[j] + B v[j], out[j] = in[j] - sqrt(2/b) f[j], x and "
            "x_spring as in avatar",
            stepwise=(
                "1 - T/2*K*g; T/2 - T/2*K*T/2*g; T/2*r*g",
                "-K*g; -K*T/2*g; r*g",
                "-r*K*g; -r*K*T/2*g; r*r*g - 1",
            ),
        ),
    }
)


def without_rule(blocks: Iterable[Any]) -> list[str]:
    """Return names and types of those of some drawn blocks that have no rule for steps that
    vary, see `BlockType.steps`."""
    return [
        f"{block.name} ({block.type})"
        for block in blocks
        if not (TYPES[block.type].steps or block.in_time)
    ]


EVERY = Key.whole(
    "every", 1, "ticks from one run of the block to the next", 1, LONGEST_FRAME, "tick"
)
PHASE = Key.whole("phase", 0, "tick of its first run, below every", 0, LONGEST_FRAME - 1, "tick")
TICK_HZ = _positive("tick_hz", "Hz", "rate of the common tick; each block runs every so many ticks")
