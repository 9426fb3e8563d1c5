"""A simulation as tables: every tick, and the response that it shows beside that of the linear loop."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from wavesweep.analysis.response import prepare, respond
from wavesweep.analysis.simulation import Simulation, Tone, estimate, hand_force, record_path, simulated, table
from wavesweep.analysis.simulation.both_loops import FARTHEST, STRONGEST
from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import draw
from wavesweep.lifted import cut_at_wall
from wavesweep.spec import Spec
from wavesweep.spec.devices import DEVICES
from wavesweep.sweep.response_table import doubt_of, parts_of
from wavesweep.sweep.table import Table, facts_of


def radius_of(spec: Spec) -> float:
    """Spectral radius per frame of the spec's linear loop, which has none of the effects of [simulate]."""
    wall = (spec.values["environment.K_VE"], spec.values["environment.B_VE"])
    return float(spectral_radius(cut_at_wall(draw(spec.values)), *wall))


def seen_response(spec: Spec, simulation: Simulation, tones: Sequence[Tone]) -> dict[str, np.ndarray]:
    """The columns of the table `simulate-response`, a row per tone; see `estimate` for the accuracy.

    If the linear loop is not stable, it has no steady response, and the columns of that response are missing.
    """
    values = spec.values
    seen = estimate(simulation.signals, tones, values["rates.fast_hz"], simulation.frame)
    # The normalised frequency is that of the slow rate, also for dc, whose frame is one tick.
    seen["omega_Ts"] = 2 * np.pi * seen["frequency_hz"] * values["rates.ratio"] / values["rates.fast_hz"]
    stable = radius_of(spec) < 1
    loop = prepare(draw(values), values["environment.K_VE"], values["environment.B_VE"])
    named = {"spec": spec.name, "controller": values["controller.kind"]}
    columns = {name: np.full(len(tones), word, dtype=object) for name, word in named.items()} | seen
    linear = respond(loop, seen["frequency_hz"])
    columns |= parts_of("linear_admittance", linear.admittance) | parts_of("linear_impedance", linear.impedance)
    errors = (linear.admittance_error, linear.impedance_error)
    columns |= {f"linear_{name}_error": error for name, error in zip(("admittance", "impedance"), errors, strict=True)}
    if not stable:
        columns |= {name: np.full(len(tones), np.nan) for name in columns if name.startswith("linear_")}
    return columns | {"doubt": doubt_of(errors, stable, loop.lost)}


METHODS = {"simulate": "both loops marched tick by tick from rest, the device exact under forces held over a tick"}
RESPONSE_METHODS = {
    "admittance": "least squares over the settled stretch: the sine, its images about the slow rate, a constant",
    "linear_admittance": "lifted resolvent of both rates, component at the force's own frequency",
}


def simulate(spec: Spec) -> list[Table]:
    """The time series of the simulated spec and, for settled sines, the response estimated from it."""
    started = time.perf_counter()
    hand = hand_force(spec)
    simulation = simulated(spec, hand.force)
    columns = table(simulation)
    simulated_at, radius = time.perf_counter(), radius_of(spec)
    linear = {"stable": radius < 1, "spectral_radius": radius if isfinite(radius) else None}
    facts = _facts(spec, METHODS, {"march_s": simulated_at - started}, list(_notices(spec))) | {"linear_loop": linear}
    rows = len(columns["tick"])
    facts["ticks"] = {"wanted": len(hand.force), "simulated": rows, "stopped": _stopped(simulation, rows, len(hand.force))}
    facts["limits"] = {"position_m": FARTHEST, "force_N": STRONGEST}
    tables = [Table.of("simulate", columns, facts)]
    tones = [tone for tone in hand.tones if tone.last <= rows]
    if tones:
        response = seen_response(spec, simulation, tones)
        timings = {"estimate_s": time.perf_counter() - simulated_at}
        facts = _facts(spec, RESPONSE_METHODS, timings, []) | {"linear_loop": linear}
        tables.append(Table.of("simulate-response", response, facts))
    return tables


def _stopped(simulation: Simulation, rows: int, wanted: int) -> str:
    """Why the rows end before the last tick; empty if they do not."""
    return simulation.stopped or ("numbers overflow" if rows < wanted else "")


def _facts(spec: Spec, methods: Mapping[str, str], timings: Mapping[str, float], notices: list[str]) -> dict[str, Any]:
    facts = facts_of(spec, methods, {"computed": 1, "skipped": 0, "certified": 0}, timings, notices)
    if spec.simulate["input"] == "record":
        # The digest of the spec covers only the name of the record.
        facts["record_sha256"] = hashlib.sha256(record_path(spec).read_bytes()).hexdigest()
    return facts


def _notices(spec: Spec) -> Iterator[str]:
    """Yield notices about values that a user may not expect."""
    options = spec.simulate
    if spec.preset:
        own = {path: number.value for path, number in DEVICES[spec.preset].numbers.items()}
        used = {**spec.values, **{f"simulate.{name}": value for name, value in options.items()}}
        limits = DEVICES[spec.preset].simulation().items()
        beyond = [f"{name} = {value:g}" for name, value in limits if value and options[name] == value]
        if beyond:
            yield f"the preset {spec.preset} adds to the linear loop: {', '.join(beyond)}"
        given = [f"{path} = {used[path]:g} and not {value:g}" for path, value in own.items() if used[path] != value]
        if given:
            yield f"the spec takes precedence over the preset {spec.preset}: {', '.join(given)}"
    if options["resolution"] and spec.values["device.velocity"] == "exact":
        yield 'device.velocity = "exact" does not see the encoder; "difference" takes its velocity from it'
