"""The files of an exported controller, as text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from wavesweep import __version__
from wavesweep.analysis.simulation import compile_loop, table
from wavesweep.analysis.simulation.avatar import Port
from wavesweep.analysis.simulation.both_loops import SimulatedLoop
from wavesweep.analysis.simulation.wave_control import WaveLaw
from wavesweep.errors import UsageError
from wavesweep.export.drawn import exported_drawn
from wavesweep.export.filters import filter_functions, states_of
from wavesweep.export.text import constants, filled, number, table_of
from wavesweep.spec import Spec
from wavesweep.sweep.simulation_table import simulation_of

FILTERS = {
    "lp1": "LP1, the low-pass before the downsampler",
    "hp": "HP, the high-pass to the local model",
    "lp2": "LP2, the low-pass on the local model's wave",
}
VELOCITY = {
    "exact": "v is the measured velocity",
    "difference": "v is not read: the velocity is (x - x_before) / T",
}
# Columns of the vectors: name in the table of `simulate`, and the expression for it in the check.
_DIRECT = {"f_m": "s.f_m", "touching": "s.touching", "F_s": "computed"}
_WAVES = {
    **{name: f"s.{name}" for name in ("f_m", "touching", "u_m", "v_m", "u_s")},
    "v_s": "s.slow.v",
    "x_s": "s.slow.x",
    "x_dot_s": "s.slow.x_dot",
    "F_s": "s.slow.F",
}
_LOCAL = {name: f"s.{name}" for name in ("u_h", "v_l", "v_2")}


def exported(spec: Spec) -> dict[str, str]:
    """Return the files of the controller of a spec in C: name -> text.

    The vectors are the experiment of the spec's [simulate] table: position, velocity and lateness in each tick, and the
    controller's signals.

    Errors: `UsageError` if the loop cannot be simulated, or if no tick could be, and see `exported_drawn`;
    `IllPosedLoopError` if its wave loop without delay has no solution.
    """
    if spec.drawing:
        return exported_drawn(spec)
    if spec.uneven:
        raise UsageError(f"{spec.name}: export expects rates.fast_hz divided by a whole number; set another slow rate")
    spec = spec.as_simulated()
    loop = compile_loop(spec.values, spec.simulate["wall"])
    columns = table(simulation_of(spec))
    if not len(columns["tick"]):
        raise UsageError("export: expected an experiment with at least one tick for the vectors, found none")
    waves = isinstance(loop.law, WaveLaw)
    flags, values = _flags(spec, loop), _values(spec, loop)
    body = filled("waves.c" if waves else "direct.c", flags, values | {"mail": filled("mail.c", flags, values).rstrip("\n")})
    signals = (_WAVES | (_LOCAL if flags["local"] else {})) if waves else _DIRECT
    return {
        "controller.h": filled("controller.h", flags, values),
        "controller.c": filled("guards.c", flags, values) + body,
        "check.c": filled("check.c", flags | {"direct": not waves}, _check_values(columns, signals, loop)),
        "example.c": filled("example.c", flags, values),
        "vectors.csv": _vectors(columns, signals),
        "Makefile": filled("Makefile", flags, {}),
    }


def _flags(spec: Spec, loop: SimulatedLoop) -> dict[str, bool]:
    """Whether the controller has each part; `wave_loop`: if waves may go round within a tick."""
    law, waves = loop.law, isinstance(loop.law, WaveLaw)
    local = law.local is not None if waves else bool(law.K_LM or law.B_LM)
    local0 = waves and local and law.local_delay == 0
    return {
        "waves": waves,
        "slow": spec.kind != "dc",
        "delay0": law.delay == 0,
        "local": local,
        "local_waves": waves and local,
        "local0": local0,
        "wave_loop": local0 or (waves and law.delay == 0),
        "difference": loop.velocity == "difference",
        **{name: waves and bool(getattr(law, name)) for name in FILTERS},
    }


def _values(spec: Spec, loop: SimulatedLoop) -> dict[str, Any]:
    """The texts for the templates' names."""
    keys, law, surface = spec.values, loop.law, spec.simulate["wall"]
    mass, damping = (keys[f"device.{name}"] + keys[f"operator.{name}"] for name in ("mass", "damping"))
    device = f"{mass:g} kg, {damping:g} N s/m, {keys['operator.stiffness']:g} N/m"
    numbers = {
        "fast_hz": keys["rates.fast_hz"],
        "T": loop.T,
        "K_VE": keys["environment.K_VE"],
        "B_VE": keys["environment.B_VE"],
        "position": surface or 0.0,
        **dict(zip(("px", "pv", "pf", "vx", "vv", "vf"), loop.plant, strict=True)),
    }
    texts = {
        "title": f"The controller {spec.kind}",
        "version": __version__,
        "name": spec.name.replace("*/", "* /"),
        "digest": spec.sha256,
        "tick_ms": f"{1e3 * loop.T:g}",
        "velocity": VELOCITY[loop.velocity],
        "ratio": law.ratio,
        "delay": law.delay,
        "one_sided": int(surface is not None),
        "device": device,
    }
    special = _wave_values(keys, law) if isinstance(law, WaveLaw) else ({"K_LM": law.K_LM, "B_LM": law.B_LM}, {})
    return constants(numbers | special[0]) | texts | special[1]


def _wave_values(keys: Mapping[str, Any], law: WaveLaw) -> tuple[dict[str, float], dict[str, Any]]:
    """The numbers of a wave controller, and its further texts."""
    numbers = {"b": law.b, "Kp": law.Kp, "root_2b": math.sqrt(2 * law.b), "root_2_b": math.sqrt(2 / law.b)}
    local0 = law.local is not None and law.local_delay == 0
    peeked = {"lp1": law.delay == 0, "hp": local0, "lp2": local0}
    names = ("lp1",) if law.local is None else tuple(FILTERS)
    filters = "".join(filter_functions(name, _described(keys, name), getattr(law, name), peeked[name]) for name in names)
    texts = {"filters": filters.rstrip("\n") + "\n", "wall_integration": keys["environment.integration"]}
    texts |= {f"{name}_states": states_of(getattr(law, name)) for name in FILTERS}
    numbers |= _steps("wall", law.wall)
    if law.local is not None:
        numbers |= {"K_LM": law.local.K, "B_LM": law.local.B} | _steps("local", law.local)
        texts["local_integration"] = keys["local_model.integration"]
    return numbers, texts


def _steps(name: str, port: Port) -> dict[str, float]:
    return {f"{name}_{step}": getattr(port, step) for step in ("behind", "ahead", "step")}


def _described(keys: Mapping[str, Any], name: str) -> str:
    order, cutoff = (keys[f"filters.{name}.{part}"] for part in ("order", "cutoff_hz"))
    return f"{FILTERS[name]}: " + (f"Butterworth of order {order}, {cutoff:g} Hz." if order else "none, the order is 0.")


def _check_values(columns: Mapping[str, np.ndarray], signals: Mapping[str, str], loop: SimulatedLoop) -> dict[str, Any]:
    """The texts for the check: its signals, the start, and the number of late results at a time."""
    latest = int(columns["late"].max(initial=0))
    return {
        "count": len(signals),
        "names": ", ".join(f'"{name}"' for name in signals),
        "found": "\n".join(f"        found[{i}] = {found};" for i, found in enumerate(signals.values())),
        "pending": (latest + loop.law.delay) // loop.law.ratio + 2,
        "x_first": number(columns["x_hat"][0]),
    }


def _vectors(columns: Mapping[str, np.ndarray], signals: Iterable[str]) -> str:
    """Rows of the lateness of the frame's result, position and velocity, and the signals."""
    given = {"late": columns["late"], "x": columns["x_hat"], "v": columns["v_hat"]}
    return table_of(given | {name: columns[name].astype(float) for name in signals})
