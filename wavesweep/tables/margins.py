"""How far a loop is from instability at one signal, at which it is broken: the table `margins`."""

import time
from collections.abc import Iterator, Mapping
from math import pi
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.errors import UsageError
from wavesweep.spec import Spec
from wavesweep.stability.certificate import words
from wavesweep.tables.kind import Kind, Line, Numbers, Whole, from_spec, plain
from wavesweep.tables.table import Table, facts_of, held

METHOD = (
    "gains from the certified stable interval around 1 of a factor of the signal; crossings of the gain 1 from the pencil of "
    "the level 1/2 of the real part of 1/(1 + L), found to rounding; peaks by level sets; of a lifted signal the certified "
    "stable intervals of its phase, and of complex factors on the rim of a disk"
)
UNITS = {"phase": "deg", "delay": "s", "disk_phase": "deg"}  # of margins that have one
SAID = {
    "gain_up": "gain may grow by a factor up to",
    "gain_down": "gain may fall by a factor down to",
    "phase": "phase margin",
    "delay": "delay margin",
    "disk": "disk margin",
    "disk_gain": "  gain alone within the disk, up or down by a factor of",
    "disk_phase": "  phase alone within the disk",
    "sensitivity": "peak sensitivity Ms",
    "complementary": "peak complementary sensitivity Mt",
}


def margins(spec: Spec, cut: str = "") -> Table:
    """The margins of the spec's own loop, broken at a signal; of the lifted loop if it is made several times in a frame.

    cut: the signal, "block.port"; by default the first of `cuts_of`, an actuator's. Errors: UsageError for a signal
    at which the loop cannot be broken, or a loop that is not known to be stable.
    """
    from wavesweep.analyses.assumptions import over_preset
    from wavesweep.analyses.broken_loops import broken_at, cuts_of
    from wavesweep.passive.lifted_margins import margins_of

    started, cut = time.perf_counter(), cut or next(iter(cuts_of(spec)), "")
    loop = broken_at(spec, cut)
    found, doubt = margins_of(loop)
    if not found:
        reason = f"not known to be ({words([doubt])[0]})" if doubt else "not"
        raise UsageError(f"margins: expected a loop that is stable, found one that is {reason}; wavesweep check judges it")
    doubts = words([each.doubt for each in found])
    columns = {
        "cut": np.full(len(found), cut, object),
        "margin": np.array([each.name for each in found], object),
        "value": np.array([each.value for each in found]),
        "unit": np.array([UNITS.get(each.name, "1") for each in found], object),
        "omega": np.array([each.omega for each in found]),
        "bound": np.array([each.bound for each in found]),
        "certified": doubts == "",
        "doubt": doubts,
        "limited": np.array([each.limited for each in found]),
    }
    counts = {"computed": 1, "skipped": 0, "certified": int(columns["certified"].all())}
    timings = {"compute_s": time.perf_counter() - started}
    notices = [f"{axis.name} is not swept here, {held(spec, axis.path)}" for axis in spec.sweep]
    facts = facts_of(spec, {"margins": METHOD}, counts, timings, [*notices, *over_preset(spec)])
    return Table.of("margins", columns, facts | {"cut": cut, "period_s": loop.period, "times": loop.times})


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    rows = zip(*(columns[name].tolist() for name in ("margin", "value", "unit", "omega", "doubt", "limited")), strict=True)
    return {
        "cut": facts["cut"],
        "period_s": facts["period_s"],
        "times": facts.get("times", 1),
        "margins": {
            name: {"value": plain(value), "unit": unit, "omega": plain(omega), "doubt": doubt, "limited": limited}
            for name, value, unit, omega, doubt, limited in rows
        },
    }


def _lines(found: Numbers) -> Iterator[Line]:
    times, period = found["times"], f"{1e3 * found['period_s']:.6g} ms"
    once = f"broken at {found['cut']}, once in {period}"
    several = (
        f"broken at {found['cut']}, {times} times in {period}: of the lifted loop, one factor on all its samples of a frame"
    )
    yield once if times == 1 else several, False
    for name, margin in found["margins"].items():
        doubt = f"not certified ({margin['doubt']})" if margin["doubt"] else ""
        if margin["value"] is None or not margin["limited"]:
            yield f"{SAID[name]}: {doubt or 'no limit'}", bool(doubt)
            continue
        unit = "" if margin["unit"] == "1" else f" {margin['unit']}"
        at = f"at {margin['omega']:.5g} rad/s ({margin['omega'] / (2 * pi):.4g} Hz)"
        yield f"{SAID[name]} {margin['value']:.6g}{unit}, {at}{doubt and ', '}{doubt}", bool(doubt)


KINDS = (Kind("margins", lambda _: Whole(_numbers), _lines, figure="nyquist.margins", again=from_spec(margins, "cut")),)
