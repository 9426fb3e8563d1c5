"""A simulation as tables: every tick, and the response that it shows beside that of the linear loop."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite, isnan, log
from typing import Any

import numpy as np

from wavesweep.response.steady import respond
from wavesweep.rows import complex_columns
from wavesweep.simulation import Simulation, Tone, estimate, hand_force, record_path, simulated, table
from wavesweep.simulation.march import FARTHEST, STRONGEST
from wavesweep.simulation.record import own_image
from wavesweep.spec import Spec
from wavesweep.spec.devices import DEVICES
from wavesweep.sweep.assumptions import over_preset
from wavesweep.sweep.drawn_loops import loop_at_hand, ports_of, radii_of, refuse_singular
from wavesweep.sweep.grid import own_loop
from wavesweep.sweep.response_table import doubt_of
from wavesweep.sweep.table import Table, facts_of


def simulation_of(spec: Spec, force=None, **changes: Any) -> Simulation:
    """Run the experiment of a spec's [simulate] table. spec, force, changes: see `analysis.simulation.simulated`.

    Errors: SpecError for a drawn loop without a hand, or with one whose position is none of a plant.
    """
    refuse_what_has_no_hand(spec)
    return simulated(spec, force, **changes)


def refuse_what_has_no_hand(spec: Spec) -> None:
    """Raise SpecError or UsageError for a drawn loop that has no solution, or no hand on a position of a plant."""
    if spec.drawing:
        refuse_singular(spec, spec.drawing)
        ports_of(spec, spec.drawing)


SHOWN = 5  # frequencies that a notice names
SETTLED = 0.01  # of its beginning, what may be left of the slowest mode where a sine is measured


def radius_of(spec: Spec) -> float:
    """Spectral radius per frame of the spec's linear loop, which has none of the effects of [simulate]."""
    return float(radii_of(*own_loop(spec), 1)[0])


def linear_loop(spec: Spec) -> dict[str, Any]:
    """Whether the linear loop of the spec is stable, and its spectral radius per frame, None if it is not known."""
    radius = radius_of(spec)
    return {"stable": radius < 1, "spectral_radius": radius if isfinite(radius) else None}


def seen_response(spec: Spec, simulation: Simulation, tones: Sequence[Tone]) -> dict[str, np.ndarray]:
    """The columns of the table `simulate-response`, a row per tone; see `estimate` for the accuracy.

    If the linear loop is not stable, it has no steady response, and the columns of that response are missing.
    """
    signals = {"f_device": simulation.signals["f_h"], **simulation.signals}  # without a reaction it is that of the whole port
    seen = estimate(signals, tones, spec.tick_hz, simulation.frame)
    # The normalised frequency is that of the slow rate, also for dc, whose frame is one tick.
    ratio = simulation.frame if spec.drawing else spec.values["rates.ratio"]
    seen["omega_Ts"] = 2 * np.pi * seen["frequency_hz"] * ratio / spec.tick_hz
    radius = radius_of(spec)
    stable = radius < 1
    columns = {name: np.full(len(tones), word, dtype=object) for name, word in (("spec", spec.name), ("controller", spec.kind))}
    columns |= seen
    linear, lost = _linear(spec, seen["frequency_hz"])
    columns |= complex_columns("linear_admittance", linear.admittance) | complex_columns("linear_impedance", linear.impedance)
    errors = (linear.admittance_error, linear.impedance_error)
    columns |= {f"linear_{name}_error": error for name, error in zip(("admittance", "impedance"), errors, strict=True)}
    if not stable:
        columns |= {name: np.full(len(tones), np.nan) for name in columns if name.startswith("linear_")}
    # What is beyond double precision is missing.
    columns = {name: part if part.dtype == object else np.where(np.isinf(part), np.nan, part) for name, part in columns.items()}
    return columns | {"doubt": doubt_of(errors, stable, lost | isnan(radius), radius == 1)}


def _linear(spec, frequency):
    """The response of the linear loop, and whether the frame overflows."""
    loop = loop_at_hand(spec)
    return respond(loop, frequency), loop.lost


METHODS = {"simulate": "blocks run tick by tick from rest, plants exact under inputs held over a tick"}
RESPONSE_METHODS = {
    "admittance": "least squares over the settled stretch: a sine and a constant per phase of the frame; mean over the phases",
    "linear_admittance": "resolvent of the frame, component at the force's own frequency",
}


def simulate(spec: Spec) -> list[Table]:
    """The time series of the simulated spec and, for settled sines, the response estimated from it."""
    started = time.perf_counter()
    hand = hand_force(spec)
    simulation = simulation_of(spec, hand.force)
    columns = table(simulation)
    simulated_at, linear = time.perf_counter(), linear_loop(spec)
    seconds = {"march_s": simulated_at - started}
    facts = _facts(spec, METHODS, seconds, [*_unmeasured(spec, hand.tones), *_notices(spec)]) | {"linear_loop": linear}
    rows = len(columns["tick"])
    facts["ticks"] = {"wanted": len(hand.force), "simulated": rows, "stopped": _stopped(simulation, rows, len(hand.force))}
    if spec.drawing:  # whose rate may be an expression
        facts["tick_s"] = 1 / spec.tick_hz
    late = simulation.late
    facts["slow_results"] = {"results": len(late), "late": int((late > 0).sum()), "lost": int((late < 0).sum())}
    facts["limits"] = {"position_m": FARTHEST, "force_N": STRONGEST}
    tables = [Table.of("simulate", columns, facts)]
    tones = [tone for tone in hand.tones if tone.last <= rows]
    if tones:
        response = seen_response(spec, simulation, tones)
        timings = {"estimate_s": time.perf_counter() - simulated_at}
        notices = [*_images(tones, 1 / spec.tick_hz, simulation.frame), *_unsettled(spec, linear, simulation.frame)]
        facts = _facts(spec, RESPONSE_METHODS, timings, notices) | {"linear_loop": linear}
        tables.append(Table.of("simulate-response", response, facts))
    return tables


def _unmeasured(spec, tones):
    """Yield a notice about the sines of which no settled section is within the record."""
    if spec.simulate["input"] in ("sine", "stepped-sine"):
        left = [f"{hz:g}" for hz in spec.simulate["frequency_hz"][len(tones) :]]
        if left:
            named = ", ".join(left if len(left) <= SHOWN else [left[0], "...", left[-1]])
            longer = "a longer simulate.duration_s measures them"
            yield f"not measured at {named} Hz: the input ends before they have settled; {longer}"


def _images(tones, tick, frame):
    """Yield a notice about the tones that are their own image."""
    own = [f"{tone.frequency_hz:g}" for tone in tones if own_image(2 * np.pi * tone.frequency_hz * tick * frame)]
    if own and frame > 1:
        yield (
            f"at {', '.join(own)} Hz, a multiple of half the frame's rate, a sine is its own image: the response seen depends "
            "on its phase"
        )


def _unsettled(spec, linear, frame):
    """Yield a notice if the slowest mode has not died out where the sines are measured; frame: its ticks."""
    radius, settle = linear["spectral_radius"], spec.simulate["settle_s"]
    left = radius ** (settle * spec.tick_hz / frame) if linear["stable"] else 0.0
    if left > SETTLED:
        enough = log(SETTLED / 10) / log(radius) * frame / spec.tick_hz
        yield (
            f"the slowest mode still has {100 * left:.2g} % of its beginning after simulate.settle_s = {settle:g} s, and is "
            f"part of the response seen; {enough:.3g} s leave {10 * SETTLED:g} % of it"
        )


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
    if unread := spec.unread:
        keys = ", ".join(f"simulate.{name}" for name in unread)
        yield f"{keys}: not read, as simulate.input is {options['input']!r}".replace("'", '"')
    limits = DEVICES[spec.preset].simulation().items() if spec.preset else ()
    if spec.preset:
        beyond = [f"{name} = {value:g}" for name, value in limits if value and options[name] == value]
        if beyond:
            yield f"the preset {spec.preset} adds to the linear loop: {', '.join(beyond)}"
        yield from over_preset(spec, {f"simulate.{name}": value for name, value in options.items()})
    if options["resolution"] and spec.values.get("device.velocity") == "exact":
        yield 'device.velocity = "exact" does not see the encoder; "difference" takes its velocity from it'
