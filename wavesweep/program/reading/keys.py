"""Every key of a spec: its type, default, range, unit and meaning.

Validation, documents and the units of columns derive from this table.
"""

import re
from dataclasses import replace
from types import MappingProxyType

from wavesweep.engine.keys.key import HIGHEST_ORDER, INTEGRATIONS, Key, Names
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.reading.devices import DEVICES

VELOCITIES = {
    "exact": "the velocity itself, as an ideal sensor measures it",
    "difference": "the last step of the position over the tick, as an encoder gives it",
}
BAND_EDGES = ("passband_hz", "stopband_hz", "passband_db", "stopband_db")
STEPS = {"elapsed": "the time since its last frame, as game engines do", "nominal": "always rates.ratio ticks"}
SCALES = {"linear": "equal steps", "log": "equal factors, as for frequencies"}
HIGHEST_RATIO = 1000
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


def _filter(name: str, order: int, cutoff_hz: float, what: str) -> list[Key]:
    prefix = f"filters.{name}"
    loss = f"largest loss in the passband of {what}"
    attenuation = f"least attenuation in the stopband of {what}"
    return [
        Key.whole(f"{prefix}.order", order, f"Butterworth order of {what}; 0 for no filter", 0, HIGHEST_ORDER),
        Key.positive(f"{prefix}.cutoff_hz", cutoff_hz, "Hz", f"-3 dB frequency of {what}, below half the fast rate"),
        # Order and cutoff follow from the edges.
        Key.positive(f"{prefix}.passband_hz", None, "Hz", f"edge of the passband of {what}", shaping=True),
        Key.positive(f"{prefix}.stopband_hz", None, "Hz", f"edge of the stopband of {what}", shaping=True),
        # 300 dB is as far below 1 as double precision resolves; it keeps powers of ten from overflowing.
        Key.positive(f"{prefix}.passband_db", None, "dB", loss, high=300.0, shaping=True),
        Key.positive(f"{prefix}.stopband_db", None, "dB", attenuation, high=300.0, shaping=True),
    ]


_LOOP = [
    Key.positive("rates.fast_hz", 1000.0, "Hz", "rate of the haptic loop", shaping=True),
    Key.whole("rates.ratio", 20, "fast ticks in a frame of the slow environment", 1, HIGHEST_RATIO, instead="rates.slow_hz"),
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
    Key.word("device.velocity", "exact", "how velocity is measured: the state, or the position's difference", VELOCITIES),
    Key.whole(
        "device.delay",
        0,
        "fast ticks until the motors exert the control force, as of an amplifier",
        0,
        1000,
        "tick",
        instead="device.dead_time",
    ),
    Key.gain("device.dead_time", 0.0, "s", "further time, of any part of a tick, until the motors exert the control force"),
    Key.gain("operator.mass", 0.0, "kg", "mass of the operator's hand"),
    Key.gain("operator.damping", 0.0, "N*s/m", "damping of the operator's hand"),
    Key.gain("operator.stiffness", 0.0, "N/m", "stiffness of the operator's hand"),
    Key.gain("environment.K_VE", 500.0, "N/m", "stiffness of the virtual environment"),
    Key.gain("environment.B_VE", 1.0, "N*s/m", "damping of the virtual environment"),
    Key.word("environment.integration", "implicit", "how the avatar's velocity is integrated", INTEGRATIONS),
    Key.whole(
        "environment.delay",
        0,
        'fast ticks until the slow result is in place, 0 to the ratio; or "frame": with the next frame, whenever that is',
        0,
        None,
        "tick",
        instead='"frame"',
    ),
    Key.word(
        "environment.step", None, "over what time the slow environment integrates where [for_all] lets frames vary", STEPS
    ),
    replace(
        Key.word("controller.kind", None, "how hand and environment are coupled", required=True),
        choices=CONTROLLERS.keys(),
        meanings={kind: controller.description for kind, controller in CONTROLLERS.items()},
    ),
    Key.positive("controller.b", 25.0, "N*s/m", "wave impedance"),
    Key.gain("controller.Kp", 0.0, "N^(1/2)*m^(-1/2)*s^(-1/2)", "gain of the position correction in the returned wave"),
    Key.positive("controller.K_VC", 1000.0, "N/m", "stiffness of the virtual coupling"),
    Key.positive("controller.B_VC", 5.0, "N*s/m", "damping of the virtual coupling"),
    *_filter("lp1", 1, 10.0, "the anti-aliasing low-pass before the downsampler"),
    *_filter("hp", 1, 10.0, "the high-pass to the local model"),
    *_filter("lp2", 2, 20.0, "the low-pass on the local model's returned wave"),
    Key.gain("local_model.K_LM", 500.0, "N/m", "stiffness of the local model"),
    Key.gain("local_model.B_LM", 0.0, "N*s/m", "damping of the local model"),
    Key.word("local_model.integration", "implicit", "how the local model's velocity is integrated", INTEGRATIONS),
    Key("local_model.delay", "integer", 1, "tick", "fast ticks until the local model's wave is used", choices=(0, 1)),
]

# What a device preset knows beyond the loop's own numbers, for a simulation and for what encoder and motors do to a wall.
_HARDWARE = [
    Key.gain("simulate.resolution", 0.0, "m", "step of the encoder; 0 for none"),
    Key.positive("simulate.max_force", None, "N", "largest force of the motors; absent: no limit"),
    Key.gain("simulate.friction", 0.0, "N", "Coulomb friction of the device"),
]


KEYS, HARDWARE_KEYS = Key.by_path(_LOOP), Key.by_path(_HARDWARE)

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
        Key.gain("bode.frequency_hz", None, "Hz", "frequencies of the responses; 0 for the static limit"),
        Key.word("bode.from", None, "input of a drawn loop, from which the responses are wanted; by default all inputs"),
        Key.word(
            "bode.to", None, "output of a drawn loop to which they lead, or any signal, BLOCK.PORT; by default all outputs"
        ),
    ]
)

# Keys of an axis that is given as a span; `start` and `stop` have type, range and unit of the axis's own key.
AXIS_KEYS = Key.by_path(
    [
        Key.number("start", None, "", "first value of the axis, in the unit of its key"),
        Key.number("stop", None, "", "last value of the axis, in the unit of its key"),
        Key.whole("num", None, "how many values; without it an axis of [sweep] is a span", 1, 1_000_000),
        Key.word("scale", "linear", "how the values are spaced", SCALES),
    ]
)

# Paths that have a value in a resolved spec. The other keys are other ways to give one of these.
VALUE_PATHS = tuple(key.path for key in _LOOP if key.default is not None or key.required)


BUILT_IN = Names(KEYS, SYMBOLS)
find_key = BUILT_IN.find


def readable(unit: str) -> str:
    """A unit as people write it: `sqrt(N/(m*s))` for the `N^(1/2)*m^(-1/2)*s^(-1/2)` of tables; others as they are."""
    factors = [re.fullmatch(r"(\w+)\^\((-?)1/2\)", factor) for factor in unit.split("*")]
    if not all(factors):
        return unit
    over, under = ([factor[1] for factor in factors if factor[2] == sign] for sign in ("", "-"))
    below = f"/({'*'.join(under)})" if len(under) > 1 else f"/{under[0]}" if under else ""
    return f"sqrt({'*'.join(over) or '1'}{below})"
