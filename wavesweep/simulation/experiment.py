"""The experiment of a spec's [simulate] table, and the response that it shows next to that of
the linear loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, isnan
from typing import Any

import numpy as np

from wavesweep.engine.response import Lifted, ports_of_batch, respond, transfer
from wavesweep.program.analyses.response_jobs import doubt_of
from wavesweep.program.analyses.spec_loops import loop_at_hand, port_at_hand, refuse_singular
from wavesweep.program.columns import complex_columns
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop
from wavesweep.simulation.from_spec import simulated
from wavesweep.simulation.inputs import Tone
from wavesweep.simulation.keys import entry_of
from wavesweep.simulation.record import Simulation, estimate


def simulation_of(
    spec: Spec, force, records: Mapping[str, np.ndarray] | None = None, **changes: Any
) -> Simulation:
    """Run the experiment of a spec's [simulate] table. spec, force, records, changes: see
    `from_spec.simulated`.

    Errors: SpecError for a drawn loop with a hand whose position no plant has.
    """
    refuse_what_makes_no_loop(spec)
    return simulated(spec, force, records, **changes)


def refuse_what_makes_no_loop(spec: Spec) -> None:
    """Raise SpecError or UsageError for a drawn loop that has no solution, or a hand on no
    position of a plant."""
    if spec.drawing:
        refuse_singular(spec, spec.drawing)
        if spec.drawing.hand:
            port_at_hand(spec)


def settled_values(spec: Spec, linear: Mapping[str, Any]) -> dict[str, float]:
    """Where the outputs of a drawn loop settle after a step of [simulate] in an input, of those for
    which it is known.

    linear: see `linear_loop`; nothing settles of a loop that is not stable.
    """
    drawing = spec.drawing
    size = spec.simulate["amplitude"]
    if drawing is None or not linear["stable"]:
        return {}
    name = next((name for name, signal, _ in drawing.inputs if signal == entry_of(spec)), None)
    if name is None:
        return {}
    settled = {}
    for output, _, _ in drawing.outputs:
        _, port = next(ports_of_batch(own_loop(spec), 1, (name, output)))
        value = transfer(Lifted.of(port), 0.0)[0].item().real
        if isfinite(value):
            settled[output] = size * value
    return settled


def radius_of(spec: Spec) -> float:
    """Spectral radius per frame of the spec's linear loop, which has none of the effects of
    [simulate]."""
    return float(own_loop(spec).radii()[0])


def linear_loop(spec: Spec) -> dict[str, Any]:
    """Whether the linear loop of the spec is stable, and its spectral radius per frame, None if
    it is not known."""
    radius = radius_of(spec)
    return {"stable": radius < 1, "spectral_radius": radius if isfinite(radius) else None}


def seen_response(
    spec: Spec, simulation: Simulation, tones: Sequence[Tone]
) -> dict[str, np.ndarray]:
    """The columns of the table `simulate-response`, a row per tone; see `estimate` for the
    accuracy.

    If the linear loop is not stable, it has no steady response, and the columns of that response
    are missing.
    """
    # Without a reaction the force on the device is that of the whole port.
    signals = {"f_device": simulation.signals["f_h"], **simulation.signals}
    estimated = estimate(signals, tones, spec.tick_hz, simulation.frame)
    # The normalised frequency is that of the slow rate, also for dc, whose frame is one tick.
    ratio = simulation.frame if spec.drawing else spec.values["rates.ratio"]
    estimated["omega_Ts"] = 2 * np.pi * estimated["frequency_hz"] * ratio / spec.tick_hz
    radius = radius_of(spec)
    stable = radius < 1
    columns = {"spec": np.full(len(tones), spec.name, dtype=object)}
    columns["controller"] = np.full(len(tones), spec.kind, dtype=object)
    columns |= estimated
    loop = loop_at_hand(spec)
    linear = respond(loop, estimated["frequency_hz"])
    columns |= complex_columns("linear_admittance", linear.admittance)
    columns |= complex_columns("linear_impedance", linear.impedance)
    errors = (linear.admittance_error, linear.impedance_error)
    columns["linear_admittance_error"], columns["linear_impedance_error"] = errors
    for name in columns if not stable else ():
        if name.startswith("linear_"):
            columns[name] = np.full(len(tones), np.nan)
    # What is beyond double precision is missing.
    columns = {
        name: column if column.dtype == object else np.where(np.isinf(column), np.nan, column)
        for name, column in columns.items()
    }
    return columns | {"doubt": doubt_of(errors, stable, loop.lost | isnan(radius), radius == 1)}
