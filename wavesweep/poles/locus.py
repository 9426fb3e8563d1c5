"""The root locus of a spec over a number: its values, and the ends of stable intervals between them."""

from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.poles.table import LOCUS, over
from wavesweep.program.analyses.asked import axes_asked, key_named
from wavesweep.program.analyses.interval_jobs import job_over
from wavesweep.program.analyses.own_design import searched
from wavesweep.program.analyses.poles import ON_CIRCLE, poles
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import make_grid
from wavesweep.program.sweep.running import in_memory

End = tuple[float, list[float], list[float], float, bool]


def axis_over(spec: Spec, name: str) -> Axis:
    """The values of a root locus: over the range of a number in [sweep], from the least to the largest of a list, or in which
    `check` looks. A number that decides how the loop is built has the values of its list alone. Errors: UsageError."""
    key = key_named(spec, name)
    of_sweep = [axis for axis in spec.sweep if axis.path == key.path]
    listed = of_sweep[0].values if of_sweep else ()
    if listed and of_sweep[0].structural:
        return of_sweep[0]
    ranged = of_sweep and of_sweep[0].start < of_sweep[0].stop
    start, stop = (of_sweep[0].start, of_sweep[0].stop) if ranged else searched(spec, name, key.path)
    spaced = np.geomspace if ranged and of_sweep[0].scale == "log" else np.linspace
    values = spaced(start, stop, LOCUS)
    (axis,) = axes_asked(spec, {name: np.unique(values.round().astype(int)) if key.type == "integer" else values})
    return axis


def ends_on_circle(spec: Spec, axis: Axis) -> list[End]:
    """Ends of stable intervals between the least and the largest value of an axis: the value, real and imaginary parts of the
    poles there that are on the unit circle, the strongest line of their oscillation (Hz), and whether the end is certified.

    None of a number that decides how the loop is built, or without a range.
    """
    if axis.structural or not axis.start < axis.stop:
        return []
    rows, found = in_memory(job_over(make_grid(spec, (), axis.path), replace(axis, values=()))), []
    for end in ("low", "high"):
        columns = (rows[name] for name in (end, f"{end}_omega", f"{end}_hz", "certified"))
        for value, omega, hz, certified in zip(*columns, strict=True):
            if np.isfinite(value) and np.isfinite(omega):  # one that stability sets
                there = poles(spec.with_values({axis.path: float(value)}))
                on = np.abs(there["radius"] - 1) <= ON_CIRCLE
                found.append((float(value), there["z_re"][on].tolist(), there["z_im"][on].tolist(), float(hz), bool(certified)))
    return sorted((each for each in found if each[1]), key=lambda each: each[0])  # what drifts there is left out


def root_locus(spec: Spec, axis: Axis) -> Any:
    """The figure of the poles over the values of an axis."""
    from wavesweep.poles.figure import poles as drawn

    found = over(spec, axis)
    return drawn(found.columns, found.facts)
