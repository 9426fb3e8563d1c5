"""Flat values of a spec: the paper's, and random ones of every kind."""

from pathlib import Path

import numpy as np

from support.missing import MISSING
from wavesweep.engine.errors import SpecError
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.spec import load

DEFAULTS = {
    "rates.fast_hz": 1000.0, "rates.ratio": 20,
    "device.mass": 0.1, "device.damping": 1.5, "device.velocity": "exact",
    "operator.mass": 0.0, "operator.damping": 0.0, "operator.stiffness": 0.0,
    "environment.K_VE": 500.0, "environment.B_VE": 1.0, "environment.integration": "implicit", "environment.delay": 0,
    "controller.kind": "pmw-lm", "controller.b": 25.0, "controller.Kp": 0.0,
    "controller.K_VC": 1000.0, "controller.B_VC": 5.0,
    "filters.lp1.order": 1, "filters.lp1.cutoff_hz": 10.0,
    "filters.hp.order": 1, "filters.hp.cutoff_hz": 10.0,
    "filters.lp2.order": 2, "filters.lp2.cutoff_hz": 20.0,
    "local_model.K_LM": 500.0, "local_model.B_LM": 0.0, "local_model.integration": "implicit", "local_model.delay": 1,
}  # fmt: skip
KINDS = tuple(CONTROLLERS)
ROOT = Path(__file__).parents[2]
INTEGRATIONS = ("explicit", "implicit", "trapezoidal")
_SHORT = {path.split(".", 1)[1]: path for path in DEFAULTS}
_SHORT |= {"delay": "environment.delay", "integration": "environment.integration", "kind": "controller.kind"}
_SHORT |= {"fast_hz": "rates.fast_hz", "ratio": "rates.ratio", "stiffness": "operator.stiffness"}
_SHORT |= {f"{f}_{part}": f"filters.{f}.{part}" for f in ("lp1", "hp", "lp2") for part in ("order", "cutoff_hz")}
_SHORT |= {"mass": "device.mass", "damping": "device.damping"}


def values_of(kind, **changes):
    """The paper's loop under the controller `kind`, with some keys changed: `values_of("pmw", b=9.0, lp1_order=2)`.

    Short names mean the device's mass and damping, the operator's stiffness, the environment's delay and integration.
    """
    named = {_SHORT.get(name.replace("__", "."), name.replace("__", ".")): value for name, value in changes.items()}
    assert named.keys() <= DEFAULTS.keys(), named.keys() - DEFAULTS.keys()
    return {**DEFAULTS, "controller.kind": kind, **named}


def random_values(seed, kind=None):
    """A loop that somebody might build: every kind, rate ratio, filter up to 4th order, spring in the hand or none."""
    r = np.random.default_rng(seed)

    def spread(low, high):
        return float(np.exp(r.uniform(np.log(low), np.log(high))))

    def maybe(number, never):
        return 0.0 if r.random() < never else number

    ratio, fast = int(r.choice([1, 2, 3, 5, 10, 20, 50])), float(r.choice([500.0, 1000.0, 2000.0, 5000.0]))
    filters = {
        f"filters.{name}.{key}": value
        for name in ("lp1", "hp", "lp2")
        for key, value in (("order", int(r.integers(0, 5))), ("cutoff_hz", spread(0.002 * fast, 0.1 * fast)))
    }
    return filters | {
        "rates.fast_hz": fast, "rates.ratio": ratio,
        "device.mass": spread(0.02, 2), "device.damping": spread(0.05, 3),
        "device.velocity": str(r.choice(["exact", "difference"])),
        "operator.mass": maybe(spread(0.05, 0.5), 0.6), "operator.damping": maybe(spread(0.1, 10), 0.6),
        "operator.stiffness": maybe(spread(10, 1000), 0.7),
        "environment.K_VE": spread(10, 2000), "environment.B_VE": spread(0.1, 10),
        "environment.integration": str(r.choice(INTEGRATIONS)),
        "environment.delay": int(r.choice([0, min(1, ratio), ratio // 2, ratio])),
        "controller.kind": kind or str(r.choice(["dc", "dc-slow", "dc-lm", "pmw", "pmw", "pmw-lm", "pmw-lm"])),
        "controller.b": spread(5, 80), "controller.Kp": maybe(spread(1, 60), 0.5),
        "local_model.K_LM": maybe(spread(10, 3000), 0.2), "local_model.B_LM": maybe(spread(0.1, 5), 0.4),
        "local_model.integration": str(r.choice(INTEGRATIONS)), "local_model.delay": int(r.integers(0, 2)),
        "controller.K_VC": spread(50, 5000), "controller.B_VC": spread(0.5, 50),
    }  # fmt: skip


def nested(values):
    """Flat values as the tables that a spec is."""
    tables = {}
    for path, value in values.items():
        *parents, last = path.split(".")
        table = tables
        for parent in parents:
            table = table.setdefault(parent, {})
        table[last] = value
    return tables


def shipped():
    """The specs of the project; if capabilities are taken away, without those that ask for one of them."""
    found = sorted(ROOT.glob("sweeps/**/*.toml"))
    return [path for path in found if is_readable(path)] if MISSING else found


def is_readable(path):
    """Whether what is there reads a spec."""
    try:
        load(path)
    except SpecError:
        return False
    return True
