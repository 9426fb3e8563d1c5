"""Every key of a spec, with type, default, range, unit and meaning; haptic devices by name, with
the source of each number.

Validation, documents and the units of columns derive from the keys.

Manufacturers publish a force limit, a resolution, and for some devices an apparent mass and a
back-drive friction at the tip in the middle of the workspace. They do not publish viscous damping,
and rarely the direction or the place in the workspace to which a number applies. A number without a
public source is marked as assumed, or it is missing and a spec has to give it.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

from wavesweep.engine.keys import HIGHEST_ORDER, INTEGRATIONS, Key, Names
from wavesweep.haptics.controllers import CONTROLLERS

PAPER = "the paper's section 2, for its analysis (it tests on an Omni)"
OMNI = "PHANTOM Omni data sheet, as commonly quoted; the Geomagic Touch has the same"
DESKTOP = "PHANTOM Desktop data sheet, as commonly quoted; the Geomagic Touch X has the same"
FALCON = "Novint Falcon product sheet, as commonly quoted"
OMEGA = "Force Dimension omega.3 data sheet, as commonly quoted"
CHAI3D = "CHAI3D, github.com/chai3d/chai3d, src/devices/"
PHANTOM_TABLE = f"{CHAI3D}CPhantomDevices.cpp"
DELTA_TABLE = f"{CHAI3D}CDeltaDevices.cpp"


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a device in the unit of its key, with its source; `assumed` if no public
    source is relied on."""

    value: float
    source: str
    assumed: bool = False


@dataclass(frozen=True, slots=True)
class HapticDevice:
    """A device along one direction.

    numbers: path of a key -> its number. wall: stiffness (N/m) and damping (N*s/m) of the stiffest
    wall that CHAI3D recommends at 1 kHz, and the source; None if it has no entry. The wall is no
    key: compare a result with it.
    """

    title: str
    numbers: Mapping[str, Number]
    wall: tuple[float, float, str] | None = None

    def loop(self) -> dict[str, float]:
        """Return the keys of the loop that the device sets, by path."""
        return {
            path: number.value
            for path, number in self.numbers.items()
            if path.startswith("device.")
        }

    def simulation(self) -> dict[str, float]:
        """Return the keys of [simulate] that the device sets, by their last name."""
        prefix = "simulate."
        numbers = self.numbers.items()
        return {
            path.removeprefix(prefix): number.value
            for path, number in numbers
            if path.startswith(prefix)
        }

    def unknown(self) -> tuple[str, ...]:
        """Return the paths of mass and damping if no number is known, so that a spec has to give
        its own."""
        return tuple(path for path in ("device.mass", "device.damping") if path not in self.numbers)


_PHANTOM_LIMIT = Number(3.3, PHANTOM_TABLE)
_FORCE_DIMENSION_LIMIT = Number(12.0, DELTA_TABLE)
_OMNI_NUMBERS = {
    "device.mass": Number(0.045, f"{OMNI}: apparent mass at the tip about 45 g"),
    "device.damping": Number(
        0.5,
        "not published: a third of what the paper's analysis takes for its device",
        assumed=True,
    ),
    "simulate.friction": Number(
        0.26, f"{OMNI}: back-drive friction below 0.26 N, the bound is taken"
    ),
    "simulate.resolution": Number(0.055e-3, f"{OMNI}: about 0.055 mm (450 dpi)"),
    "simulate.max_force": _PHANTOM_LIMIT,
}
_GUESS = "not published: of the size that a three-legged device with geared-down motors has"

DEVICES: Mapping[str, HapticDevice] = MappingProxyType(
    {
        "paper": HapticDevice(
            "the device of the paper's analysis",
            {
                "device.mass": Number(0.1, PAPER),
                "device.damping": Number(1.5, PAPER),
                "simulate.friction": Number(0.0, "none, as in the paper's analysis", assumed=True),
                "simulate.resolution": Number(
                    0.0, "no encoder, as in the paper's analysis", assumed=True
                ),
                "simulate.max_force": _PHANTOM_LIMIT,
            },
        ),
        "touch": HapticDevice(
            "3D Systems (Geomagic) Touch", _OMNI_NUMBERS, (400.0, 4.0, PHANTOM_TABLE)
        ),
        "omni": HapticDevice("SensAble PHANTOM Omni", _OMNI_NUMBERS, (700.0, 5.0, PHANTOM_TABLE)),
        "desktop": HapticDevice(
            "SensAble PHANTOM Desktop, Geomagic Touch X",
            {
                "device.mass": Number(0.045, f"{DESKTOP}: apparent mass at the tip about 45 g"),
                "simulate.friction": Number(
                    0.06, f"{DESKTOP}: back-drive friction below 0.06 N, the bound is taken"
                ),
                "simulate.resolution": Number(0.023e-3, f"{DESKTOP}: about 0.023 mm (1100 dpi)"),
                "simulate.max_force": Number(7.9, PHANTOM_TABLE),
            },
            (1000.0, 5.0, PHANTOM_TABLE),
        ),
        "falcon": HapticDevice(
            "Novint Falcon",
            {
                "device.mass": Number(0.2, _GUESS, assumed=True),
                "device.damping": Number(2.0, _GUESS, assumed=True),
                "simulate.friction": Number(0.5, _GUESS, assumed=True),
                "simulate.resolution": Number(
                    0.0635e-3, f"{FALCON}: better than 0.0635 mm (400 dpi)"
                ),
                "simulate.max_force": Number(
                    8.0, f"{DELTA_TABLE}; the product sheet has 8.9 N (2 lbf)"
                ),
            },
            (3000.0, 20.0, DELTA_TABLE),
        ),
        "omega": HapticDevice(
            "Force Dimension omega.3, .6 and .7",
            {
                "simulate.resolution": Number(
                    0.01e-3, f"{OMEGA}: below 0.01 mm, the bound is taken"
                ),
                "simulate.max_force": _FORCE_DIMENSION_LIMIT,
            },
            (5000.0, 30.0, DELTA_TABLE),
        ),
        "sigma": HapticDevice(
            "Force Dimension sigma.7",
            {"simulate.max_force": _FORCE_DIMENSION_LIMIT},
            (4000.0, 30.0, DELTA_TABLE),
        ),
        "lambda": HapticDevice(
            "Force Dimension lambda.7",
            {"simulate.max_force": _FORCE_DIMENSION_LIMIT},
            (8000.0, 30.0, DELTA_TABLE),
        ),
    }
)
"""Devices by the name that `device.preset` takes."""


VELOCITIES = {
    "exact": "the velocity itself, as an ideal sensor measures it",
    "difference": "the last step of the position over the tick, as an encoder gives it",
}
BAND_EDGES = ("passband_hz", "stopband_hz", "passband_db", "stopband_db")
STEPS = {
    "elapsed": "the time since its last frame, as game engines do",
    "nominal": "always rates.ratio ticks",
}
SCALES = {"linear": "equal steps", "log": "equal factors, as for frequencies"}
MOST_VARYING = 64  # values of a number that varies in [for_all]
HIGHEST_RATIO = 1000  # ticks of a frame of the two rates
FILTERS = ("lp1", "hp", "lp2")
MOST_SEED = 2**53 - 1  # the largest whole number that every reader of JSON keeps
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


def _filter(name: str, order: int, cutoff_hz: float, use: str) -> list[Key]:
    prefix = f"filters.{name}"
    loss = f"largest loss in the passband of {use}"
    attenuation = f"least attenuation in the stopband of {use}"
    return [
        Key.whole(
            f"{prefix}.order",
            order,
            f"Butterworth order of {use}; 0 for no filter",
            0,
            HIGHEST_ORDER,
        ),
        Key.positive(
            f"{prefix}.cutoff_hz",
            cutoff_hz,
            "Hz",
            f"-3 dB frequency of {use}, below half the fast rate",
        ),
        # Order and cutoff follow from the edges.
        Key.positive(
            f"{prefix}.passband_hz", None, "Hz", f"edge of the passband of {use}", shaping=True
        ),
        Key.positive(
            f"{prefix}.stopband_hz", None, "Hz", f"edge of the stopband of {use}", shaping=True
        ),
        # 300 dB is as far below 1 as double precision resolves; it keeps powers of ten from
        # overflowing.
        Key.positive(f"{prefix}.passband_db", None, "dB", loss, high=300.0, shaping=True),
        Key.positive(f"{prefix}.stopband_db", None, "dB", attenuation, high=300.0, shaping=True),
    ]


_LOOP = [
    Key.positive("rates.fast_hz", 1000.0, "Hz", "rate of the haptic loop", shaping=True),
    Key.whole(
        "rates.ratio",
        20,
        "fast ticks in a frame of the slow environment",
        1,
        HIGHEST_RATIO,
        instead="rates.slow_hz",
    ),
    Key.positive(
        "rates.slow_hz",
        None,
        "Hz",
        "rate of the slow environment, in place of the ratio; need not divide the fast rate",
        shaping=True,
    ),
    Key.word(
        "device.preset",
        None,
        "device by name; sets mass, damping and [simulate]'s friction, resolution and max_force if they are not given",
        {name: device.title for name, device in DEVICES.items()},
    ),
    Key.positive("device.mass", 0.1, "kg", "mass of the haptic device"),
    Key.gain("device.damping", 1.5, "N*s/m", "viscous damping of the haptic device"),
    Key.word(
        "device.velocity",
        "exact",
        "how velocity is measured: the state, or the position's difference",
        VELOCITIES,
    ),
    Key.whole(
        "device.delay",
        0,
        "fast ticks until the motors exert the control force, as of an amplifier",
        0,
        1000,
        "tick",
        instead="device.dead_time",
    ),
    Key.gain(
        "device.dead_time",
        0.0,
        "s",
        "further time, of any part of a tick, until the motors exert the control force",
    ),
    Key.gain("operator.mass", 0.0, "kg", "mass of the operator's hand"),
    Key.gain("operator.damping", 0.0, "N*s/m", "damping of the operator's hand"),
    Key.gain("operator.stiffness", 0.0, "N/m", "stiffness of the operator's hand"),
    Key.gain("environment.K_VE", 500.0, "N/m", "stiffness of the virtual environment"),
    Key.gain("environment.B_VE", 1.0, "N*s/m", "damping of the virtual environment"),
    Key.word(
        "environment.integration",
        "implicit",
        "how the avatar's velocity is integrated",
        INTEGRATIONS,
    ),
    Key.whole(
        "environment.delay",
        0,
        "fast ticks until the slow result is in place, 0 to the longest frame; where rates do not divide, from the first "
        'fast tick at or after that time on; or "frame": with the next frame, whenever that is',
        0,
        None,
        "tick",
        instead='"frame"',
    ),
    Key.word(
        "environment.step",
        None,
        "over what time the slow environment integrates where [for_all] lets frames vary; elapsed if nothing is said",
        STEPS,
    ),
    replace(
        Key.word("controller.kind", None, "how hand and environment are coupled", required=True),
        choices=CONTROLLERS.keys(),
        meanings={kind: controller.description for kind, controller in CONTROLLERS.items()},
    ),
    Key.positive("controller.b", 25.0, "N*s/m", "wave impedance"),
    Key.gain(
        "controller.Kp",
        0.0,
        "N^(1/2)*m^(-1/2)*s^(-1/2)",
        "gain of the position correction in the returned wave",
    ),
    Key.positive("controller.K_VC", 1000.0, "N/m", "stiffness of the virtual coupling"),
    Key.positive("controller.B_VC", 5.0, "N*s/m", "damping of the virtual coupling"),
    *_filter("lp1", 1, 10.0, "the anti-aliasing low-pass before the downsampler"),
    *_filter("hp", 1, 10.0, "the high-pass to the local model"),
    *_filter("lp2", 2, 20.0, "the low-pass on the local model's returned wave"),
    Key.gain("local_model.K_LM", 500.0, "N/m", "stiffness of the local model"),
    Key.gain("local_model.B_LM", 0.0, "N*s/m", "damping of the local model"),
    Key.word(
        "local_model.integration",
        "implicit",
        "how the local model's velocity is integrated",
        INTEGRATIONS,
    ),
    Key(
        "local_model.delay",
        "integer",
        1,
        "tick",
        "fast ticks until the local model's wave is used",
        choices=(0, 1),
    ),
]

# What a device preset knows beyond the loop's own numbers, for a simulation and for what encoder
# and motors do to a wall.
_HARDWARE = [
    Key.gain("simulate.resolution", 0.0, "m", "step of the encoder; 0 for none"),
    Key.positive("simulate.max_force", None, "N", "largest force of the motors; absent: no limit"),
    Key.gain("simulate.friction", 0.0, "N", "Coulomb friction of the device"),
]


KEYS, HARDWARE_KEYS = Key.by_path(_LOOP), Key.by_path(_HARDWARE)


class TimeOfModes(NamedTuple):
    """A time in which every mode falls to a share of its size: in [sweep] require and as a wish of
    [design].

    constants: how many time constants it is. share: in words. meaning: of the key. title,
    description: of the wish.
    """

    constants: float
    share: str
    meaning: str
    title: str
    description: str


TIMES_OF_MODES = {
    "settling": TimeOfModes(
        math.log(50),
        "2 %",
        "every mode by itself falls to 2 % of its size in this time, ln(50) = 3.912 time constants",
        "settling time, to 2 %",
        "time in which every mode by itself falls to 2 %: ln(50) = 3.912 time constants of the slowest mode",
    ),
    "time_constant": TimeOfModes(
        1.0,
        "1/e",
        "every mode falls to 1/e of its size in this time",
        "time constant of the slowest mode",
        "time constant of the slowest mode, in which it falls to 1/e",
    ),
}

# Which modes a damping ratio is of: in [sweep] require and as a wish of [design].
ALL_MODES, OSCILLATING = "all", "oscillating"
MODES = {
    ALL_MODES: "also one that changes its sign from frame to frame, a real eigenvalue below 0",
    OSCILLATING: "those with a complex pair of eigenvalues; real ones have to be stable",
}

# Keys of [sweep] and [bode], which cannot be axes.
STUDY_KEYS = Key.by_path(
    [
        Key.word("sweep.along", "K_VE", "the axis whose stable intervals are wanted"),
        Key.gain(
            "bode.frequency_hz", None, "Hz", "frequencies of the responses; 0 for the static limit"
        ),
        Key.word(
            "bode.from",
            None,
            "input of a drawn loop, from which the responses are wanted; by default all inputs",
        ),
        Key.word(
            "bode.to",
            None,
            "output of a drawn loop to which they lead, or any signal, BLOCK.PORT; by default all outputs",
        ),
    ]
)

# Keys of an axis that is given as a span; `start` and `stop` have type, range and unit of the
# axis's own key.
AXIS_KEYS = Key.by_path(
    [
        Key.number("start", None, "", "first value of the axis, in the unit of its key"),
        Key.number("stop", None, "", "last value of the axis, in the unit of its key"),
        Key.whole(
            "num", None, "how many values; without it an axis of [sweep] is a span", 1, 1_000_000
        ),
        Key.word("scale", "linear", "how the values are spaced", SCALES),
    ]
)

# Paths that have a value in a resolved spec. The other keys are other ways to give one of these.
VALUE_PATHS = tuple(key.path for key in _LOOP if key.default is not None or key.required)


BUILT_IN = Names(KEYS, SYMBOLS)
find_key = BUILT_IN.find


def readable(unit: str) -> str:
    """A unit as people write it: `sqrt(N/(m*s))` for the `N^(1/2)*m^(-1/2)*s^(-1/2)` of tables;
    others as they are."""
    factors = [re.fullmatch(r"(\w+)\^\((-?)1/2\)", factor) for factor in unit.split("*")]
    if not all(factors):
        return unit
    over, under = ([factor[1] for factor in factors if factor[2] == sign] for sign in ("", "-"))
    if len(under) > 1:
        below = f"/({'*'.join(under)})"
    elif under:
        below = f"/{under[0]}"
    else:
        below = ""
    return f"sqrt({'*'.join(over) or '1'}{below})"
