"""Every key of a spec: its type, default, range, unit and meaning.

Validation, documents and the units of columns derive from this table.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any

from wavesweep.core.controllers import CONTROLLERS
from wavesweep.core.reading.devices import DEVICES

INTEGRATIONS = {
    "explicit": "the spring reads the position before the step; usually the least stable wall",
    "implicit": "the spring reads the position after the step; usually the most stable wall",
    "trapezoidal": "the spring reads the position after a step with the mean of both velocities",
}
AHEAD = {"explicit": 0.0, "implicit": 1.0, "trapezoidal": 0.5}  # share of the new velocity in the position that a spring reads
VELOCITIES = {
    "exact": "the velocity itself, as an ideal sensor measures it",
    "difference": "the last step of the position over the tick, as an encoder gives it",
}
STEPS = {"elapsed": "the time since its last frame, as game engines do", "nominal": "always rates.ratio ticks"}
SCALES = {"linear": "equal steps", "log": "equal factors, as for frequencies"}
FILTERS = ("lp1", "hp", "lp2")
BAND_EDGES = ("passband_hz", "stopband_hz", "passband_db", "stopband_db")
RATIO = "ratio"  # unit of a value without one in a column of units, where a bare 1 would be read as a number
HIGHEST_ORDER = 12
HIGHEST_RATIO = 1000
LONGEST_FRAME = 100_000  # ticks
SMALLEST, LARGEST = 1e-60, 1e60  # sizes of numbers other than 0: what a loop makes of several stays within doubles
VALUE_WORDS = ("nan", "inf", "infinity", "none", "null", "na", "true", "false")  # no names, in any case of letters
FORMULA = ("=", "+", "-", "@")  # how a text begins that a spreadsheet runs
MOST_SEED = 2**53 - 1  # the largest whole number that every reader of JSON keeps
MOST_SLOW_STEPS = 10_000  # slow steps in a frame: doubles distinguish fractions with denominators up to this

SYMBOLS = MappingProxyType(
    {
        "K_VE": "environment.K_VE",
        "B_VE": "environment.B_VE",
        "K_LM": "local_model.K_LM",
        "B_LM": "local_model.B_LM",
        "Kp": "controller.Kp",
        "K_VC": "controller.K_VC",
        "B_VC": "controller.B_VC",
        "b": "controller.b",
    }
)


@dataclass(frozen=True, slots=True)
class Key:
    """One key: `type` is "number", "integer", "string" or "boolean"; `default` None means that the key may be absent.

    Keys of blocks may also be "list" (of numbers), "rows" (lists of numbers) or "ports" (names); in other tables a "list" may
    hold anything.

    Numbers lie in `low`..`high`, without `low` itself if `above_low` is true. If there are `choices`, no other value is
    allowed; `meanings` describes some of them. Limits set by other keys (`environment.delay <= rates.ratio`) are checked
    when a spec is resolved.
    """

    path: str
    type: str
    default: float | int | str | None
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    above_low: bool = False
    choices: tuple = ()
    required: bool = False
    meanings: Mapping = field(default_factory=dict, repr=False)
    instead: str = ""  # what is meant by a fraction that the key does not take, or, in quotes, by another word
    shaping: bool = False  # whether the structure of the loop depends on it although it is a number

    @property
    def numeric(self) -> bool:
        """Whether the key may be an axis of a sweep."""
        return self.type in ("number", "integer")

    @property
    def structural(self) -> bool:
        """Whether a change requires the spec to be resolved again, because other values or limits depend on this one."""
        derived_from = self.path in ("rates.fast_hz", "rates.slow_hz") or self.path.rsplit(".", 1)[-1] in BAND_EDGES
        return self.type != "number" or derived_from or self.shaping


def number(path: str, default: float | None, unit: str, description: str, *, positive: bool = False, **more: Any) -> Key:
    """Return the key of a number, which is above 0 if it is positive. more: `low`, `high`, `required`."""
    more = {"low": 0.0, "above_low": True, **more} if positive else more
    return Key(path, "number", default, unit, description, **more)


def whole(path: str, default: int | None, description: str, low: int, high: int | None, unit: str = "1", **more: Any) -> Key:
    """Return the key of a whole number from `low` to `high`. more: `required`, `instead`."""
    return Key(path, "integer", default, unit, description, low=low, high=high, **more)


def word(path: str, default: str | None, description: str, meanings: Iterable[str] = (), required: bool = False) -> Key:
    """Return the key of a text; one of several words if there are `meanings` of them, or names alone."""
    known = meanings if isinstance(meanings, Mapping) else {}
    return Key(path, "string", default, "", description, choices=tuple(meanings), required=required, meanings=known)


positive = partial(number, positive=True)
gain = partial(number, low=0.0)


def _filter(name: str, order: int, cutoff_hz: float, what: str) -> list[Key]:
    prefix = f"filters.{name}"
    return [
        whole(f"{prefix}.order", order, f"Butterworth order of {what}; 0 for no filter", 0, HIGHEST_ORDER),
        positive(f"{prefix}.cutoff_hz", cutoff_hz, "Hz", f"-3 dB frequency of {what}, below half the fast rate"),
        positive(f"{prefix}.passband_hz", None, "Hz", f"edge of the passband of {what}"),
        positive(f"{prefix}.stopband_hz", None, "Hz", f"edge of the stopband of {what}"),
        # 300 dB is as far below 1 as double precision resolves; it keeps powers of ten from overflowing.
        positive(f"{prefix}.passband_db", None, "dB", f"largest loss in the passband of {what}", high=300.0),
        positive(f"{prefix}.stopband_db", None, "dB", f"least attenuation in the stopband of {what}", high=300.0),
    ]


_LOOP = [
    positive("rates.fast_hz", 1000.0, "Hz", "rate of the haptic loop"),
    whole("rates.ratio", 20, "fast ticks in a frame of the slow environment", 1, HIGHEST_RATIO, instead="rates.slow_hz"),
    positive("rates.slow_hz", None, "Hz", "rate of the slow environment, in place of the ratio; need not divide the fast rate"),
    word(
        "device.preset",
        None,
        "device by name; sets mass, damping and [simulate]'s friction, resolution and max_force if they are not given",
        {name: device.title for name, device in DEVICES.items()},
    ),
    positive("device.mass", 0.1, "kg", "mass of the haptic device"),
    gain("device.damping", 1.5, "N*s/m", "viscous damping of the haptic device"),
    word("device.velocity", "exact", "how velocity is measured: the state, or the position's difference", VELOCITIES),
    whole(
        "device.delay",
        0,
        "fast ticks until the motors exert the control force, as of an amplifier",
        0,
        1000,
        "tick",
        instead="device.dead_time",
    ),
    gain("device.dead_time", 0.0, "s", "further time, of any part of a tick, until the motors exert the control force"),
    gain("operator.mass", 0.0, "kg", "mass of the operator's hand"),
    gain("operator.damping", 0.0, "N*s/m", "damping of the operator's hand"),
    gain("operator.stiffness", 0.0, "N/m", "stiffness of the operator's hand"),
    gain("environment.K_VE", 500.0, "N/m", "stiffness of the virtual environment"),
    gain("environment.B_VE", 1.0, "N*s/m", "damping of the virtual environment"),
    word("environment.integration", "implicit", "how the avatar's velocity is integrated", INTEGRATIONS),
    whole(
        "environment.delay",
        0,
        'fast ticks until the slow result is in place, 0 to the ratio; or "frame": with the next frame, whenever that is',
        0,
        None,
        "tick",
        instead='"frame"',
    ),
    word("environment.step", None, "over what time the slow environment integrates where [for_all] lets frames vary", STEPS),
    replace(
        word("controller.kind", None, "how hand and environment are coupled", required=True),
        choices=CONTROLLERS.keys(),
        meanings={kind: controller.description for kind, controller in CONTROLLERS.items()},
    ),
    positive("controller.b", 25.0, "N*s/m", "wave impedance"),
    gain("controller.Kp", 0.0, "N^(1/2)*m^(-1/2)*s^(-1/2)", "gain of the position correction in the returned wave"),
    positive("controller.K_VC", 1000.0, "N/m", "stiffness of the virtual coupling"),
    positive("controller.B_VC", 5.0, "N*s/m", "damping of the virtual coupling"),
    *_filter("lp1", 1, 10.0, "the anti-aliasing low-pass before the downsampler"),
    *_filter("hp", 1, 10.0, "the high-pass to the local model"),
    *_filter("lp2", 2, 20.0, "the low-pass on the local model's returned wave"),
    gain("local_model.K_LM", 500.0, "N/m", "stiffness of the local model"),
    gain("local_model.B_LM", 0.0, "N*s/m", "damping of the local model"),
    word("local_model.integration", "implicit", "how the local model's velocity is integrated", INTEGRATIONS),
    Key("local_model.delay", "integer", 1, "tick", "fast ticks until the local model's wave is used", choices=(0, 1)),
]

# What a device preset knows beyond the loop's own numbers, for a simulation and for what encoder and motors do to a wall.
_HARDWARE = [
    gain("simulate.resolution", 0.0, "m", "step of the encoder; 0 for none"),
    positive("simulate.max_force", None, "N", "largest force of the motors; absent: no limit"),
    gain("simulate.friction", 0.0, "N", "Coulomb friction of the device"),
]


def by_path(keys: Iterable[Key]) -> Mapping[str, Key]:
    """Return keys by their paths."""
    return MappingProxyType({key.path: key for key in keys})


KEYS, HARDWARE_KEYS = by_path(_LOOP), by_path(_HARDWARE)

# Units at the port of a hand that turns, for those of one that slides.
TURNED = MappingProxyType({"m": "rad", "N": "N*m", "m/s": "rad/s", "m/N": "rad/(N*m)", "N/m": "N*m/rad", "N*s/m": "N*m*s/rad"})

# Keys of [sweep] and [bode], which cannot be axes.
STUDY_KEYS = by_path(
    [
        word("sweep.along", "K_VE", "the axis whose stable intervals are wanted"),
        gain("bode.frequency_hz", None, "Hz", "frequencies of the responses; 0 for the static limit"),
        word("bode.from", None, "input of a drawn loop, from which the responses are wanted; by default all inputs"),
        word(
            "bode.to",
            None,
            "output of a drawn loop to which they lead, or any signal, BLOCK.PORT; by default all outputs",
        ),
    ]
)

# Keys of an axis that is given as a span; `start` and `stop` have type, range and unit of the axis's own key.
AXIS_KEYS = by_path(
    [
        number("start", None, "", "first value of the axis, in the unit of its key"),
        number("stop", None, "", "last value of the axis, in the unit of its key"),
        whole("num", None, "how many values; without it an axis of [sweep] is a span", 1, 1_000_000),
        word("scale", "linear", "how the values are spaced", SCALES),
    ]
)

# Paths that have a value in a resolved spec. The other keys are other ways to give one of these.
VALUE_PATHS = tuple(key.path for key in _LOOP if key.default is not None or key.required)


@dataclass(frozen=True, slots=True)
class Names:
    """The keys of a spec by path, the symbols that are short for a path, and the numbers that follow from others."""

    keys: Mapping[str, Key]
    symbols: Mapping[str, str]
    following: frozenset[str] = frozenset()

    def find(self, name: str) -> Key | None:
        """Return the key of a name, which is a symbol (`B_VE`) or a full path (`device.damping`), or None."""
        return self.keys.get(self.symbols.get(name, name))

    @property
    def numeric(self) -> list[str]:
        """Paths of the keys that may be axes."""
        return [path for path, key in self.keys.items() if key.numeric]


BUILT_IN = Names(KEYS, SYMBOLS)
find_key = BUILT_IN.find


def readable(unit: str) -> str:
    """A unit as people write it: `sqrt(N/(m*s))` for the `N^(1/2)*m^(-1/2)*s^(-1/2)` of tables; others as they are."""
    parts = [re.fullmatch(r"(\w+)\^\((-?)1/2\)", part) for part in unit.split("*")]
    if not all(parts):
        return unit
    over, under = ([part[1] for part in parts if part[2] == sign] for sign in ("", "-"))
    below = f"/({'*'.join(under)})" if len(under) > 1 else f"/{under[0]}" if under else ""
    return f"sqrt({'*'.join(over) or '1'}{below})"
