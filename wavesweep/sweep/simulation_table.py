"""The simulation of a spec, as tables."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Mapping
from typing import Any

from wavesweep.analysis.simulation import hand_force, record_path, simulated, table
from wavesweep.spec import Spec
from wavesweep.spec.devices import DEVICES
from wavesweep.sweep.run import Table, facts_of
from wavesweep.sweep.seen_response import seen_response

METHODS = {"simulate": "both loops marched tick by tick from rest, the device exact under forces held over a tick"}
RESPONSE_METHODS = {
    "admittance": "least squares over the settled stretch: the sine, its images about the slow rate, a constant",
    "linear_admittance": "lifted resolvent of both rates, component at the force's own frequency",
}


def simulate(spec: Spec) -> list[Table]:
    """Simulate the spec; give its time series and, for settled sines, the response estimated from it."""
    started = time.perf_counter()
    hand = hand_force(spec)
    simulation = simulated(spec, hand.force)
    columns = table(simulation)
    marched = time.perf_counter()
    facts = _facts(spec, METHODS, {"march_s": marched - started}, list(_notices(spec)))
    rows = len(columns["tick"])
    facts["ticks"] = {"wanted": len(hand.force), "simulated": rows}
    tables = [Table.of("simulate", columns, facts)]
    tones = [tone for tone in hand.tones if tone.last <= rows]
    if tones:
        response = seen_response(spec, simulation, tones)
        timings = {"estimate_s": time.perf_counter() - marched}
        tables.append(Table.of("simulate-response", response, _facts(spec, RESPONSE_METHODS, timings, [])))
    return tables


def _facts(spec: Spec, methods: Mapping[str, str], timings: Mapping[str, float], notices: list[str]) -> dict[str, Any]:
    facts = facts_of(spec, methods, {"computed": 1, "skipped": 0, "certified": 0}, timings, notices)
    if spec.simulate["input"] == "record":
        # The digest of the spec knows the record by its name alone.
        facts["record_sha256"] = hashlib.sha256(record_path(spec).read_bytes()).hexdigest()
    return facts


def _notices(spec: Spec) -> Iterator[str]:
    """Yield notices about values that a user may not expect."""
    options, preset = spec.simulate, spec.simulate["preset"]
    if preset:
        own = {**DEVICES[preset].loop(), **DEVICES[preset].beyond_the_model()}
        used = {**spec.values, **options}
        given = [f"{path} = {used[path]:g} and not {value:g}" for path, value in own.items() if used[path] != value]
        if given:
            yield f"the spec takes precedence over the preset {preset}: {', '.join(given)}"
    if options["resolution"] and spec.values["device.velocity"] == "exact":
        yield 'device.velocity = "exact" does not see the encoder; "difference" takes its velocity from it'
