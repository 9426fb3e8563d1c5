"""What white noise comes out with in a spec's own design while frames, or messages, are at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.engine.errors import WavesweepError
from wavesweep.for_all.at_cut import RMS, refused
from wavesweep.for_all.random_ports import RandomPorts
from wavesweep.for_all.rows import ForAllGuarantee, numbers_in_words, own_cases, rms_of
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.claims import Claim, Status
from wavesweep.program.sweep.grid import own_loop

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec

MOST_ROUTES = 30  # of the table
MOST_MOMENTS = 300  # of which each route of the table takes a tenth of a second


def table(spec: Spec, rules: Rules) -> list[dict[str, Any]]:
    """Return for each input and output of [ports] the root mean square of the output under white noise
    of 1 in the input: `from`, `to`, `rms` while all is at random, the largest of all values in [for_all], and
    `in_time` with the spec's own numbers and nothing late or lost. None is not known, as of an output that drifts.

    rules: of what is at random, whose second moments decay.
    """
    drawing = own_loop(spec).drawing
    if not offered("bound") or not rules.drawing:
        return []
    chances = rules.family(own_cases(rules, spec)[0].values, "")
    states = chances.family.kept.size
    if chances.graph.nodes * states * (states + 1) // 2 > MOST_MOMENTS:
        return []
    routes = product([name for name, *_ in drawing.inputs], [name for name, *_ in drawing.outputs])
    rows = []
    for source, signal in list(routes)[:MOST_ROUTES]:
        ends = {"from": source, "to": signal}
        rows.append({**ends, "rms": _largest(spec, rules, ends), "in_time": _in_time(spec, ends)})
    return rows


def claims(spec: Spec, rules: Rules, decays: str) -> list[Claim]:
    """Return the claim about what is required, a root mean square; none without one.

    decays: whether second moments do: "proved", "refuted" or "unknown".
    """
    if not spec.require:
        return []
    rules = replace(rules, require=spec.require)
    guarantee = ForAllGuarantee(rules)
    status = Status.PROVED
    reason = refused(spec.require, rules, at_random=True)
    if reason:
        status = Status.UNKNOWN
    elif decays != "proved":
        status = Status[decays.upper()]
        reason = "second moments grow" if decays == "refuted" else "second moments may grow"
    else:
        try:
            status, reason = _of_cases(spec, rules)
        except WavesweepError as error:
            status = Status.UNKNOWN
            reason = str(error)
    return [Claim(guarantee.what, guarantee.scope(spec), status, reason)]


def _of_cases(spec: Spec, rules: Rules) -> tuple[Status, str]:
    """Whether the root mean square is at most its level in all cases, and what it is if not."""
    bound = rms_of(spec.require)
    status = Status.PROVED
    reason = ""
    for case in own_cases(rules, spec):
        low, high = _of_case(rules, case, bound)
        if low > bound.at_most:
            numbers = numbers_in_words(case.fixed)
            return Status.REFUTED, f"{low:.6g}{' with ' * bool(numbers)}{numbers}"
        if high > bound.at_most:
            status = Status.UNKNOWN
            reason = f"between {low:.6g} and {high:.6g}"
    return status, reason


def _of_case(rules: Rules, case: Any, bound: Any) -> tuple[float, float]:
    """What the root mean square is at least and at most; infinite if it is not known."""
    if case.ranges:
        return 0.0, np.inf
    ports = RandomPorts.of(rules, case.values, "", (0.0, 0.0), bound)
    return offered("bound").root_mean_square(ports)


def _largest(spec: Spec, rules: Rules, ends: Mapping[str, str]) -> float | None:
    """The largest root mean square of all values in [for_all]; None if it is not known."""
    bound = offered("bound").TimeBound(RMS, ends["from"], ends["to"], 1.0)
    try:
        largest = max(_of_case(rules, case, bound)[1] for case in own_cases(rules, spec))
    except WavesweepError:
        return None
    return largest if np.isfinite(largest) else None


def _in_time(spec: Spec, ends: Mapping[str, str]) -> float | None:
    """The root mean square of the spec's own loop."""
    try:
        value = offered("bound").root_mean_square_in_time(own_loop(spec), ends)
    except WavesweepError:
        return None
    return value if np.isfinite(value) else None
