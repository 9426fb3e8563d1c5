"""A study of the open choices: their effect on the stiffest wall of passive multirate wave control."""

from __future__ import annotations

import time
from itertools import product

import numpy as np

from reproduce.specs import load_paper
from wavesweep import Spec
from wavesweep.program.analyses.spec_loops import radius_over
from wavesweep.program.results import Field
from wavesweep.program.spec import KEYS
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.table import Table, facts_of

AXES = {  # column: axis of the spec
    "delay": "environment.delay",
    "b": "b",
    "lp1_order": "filters.lp1.order",
    "lp1_cutoff_hz": "filters.lp1.cutoff_hz",
}
WORDS = ("environment.integration", "device.velocity")  # choices that are no numbers, and so no axes
_UNITS = {"delay": "tick", "b": "N*s/m", "lp1_order": "1", "lp1_cutoff_hz": "Hz"}

FIELDS = (
    Field("integration", "string", "", "how the avatar's velocity is integrated"),
    Field("velocity", "string", "", "how the device's velocity is measured"),
    *(
        Field(name, "integer" if unit in ("tick", "1") else "number", unit, f"as the key {AXES[name]}")
        for name, unit in _UNITS.items()
    ),
    Field("K_at_1", "number", "N/m", "end of the stable K_VE that begin at 0, B_VE = 1; missing where 20000 is stable"),
    Field("K_at_15", "number", "N/m", "the same for B_VE = 15 N*s/m"),
    Field("slope", "number", "1/s", "mean slope of that limit between B_VE = 1 and 15"),
    Field("bend", "number", "N/m", "how far the limit is at most off the straight line between its ends"),
    Field("island", "boolean", "", "beyond the limit there are stable K_VE again, for some B_VE"),
    Field("fig2_stable", "boolean", "", "the loops of Figure 2 are stable with these choices, for all four b"),
    Field("fig6_stable", "boolean", "", "the loops of Figure 6, PMW and PMW+LM, are stable with these choices"),
)


def open_choices() -> Table:
    """Sweep `open-choices.toml` under each integration and each velocity: a row per combination."""
    started, parts, base = time.perf_counter(), [], load_paper("open-choices")
    certified = 0
    for integration, velocity in product(*(KEYS[path].choices for path in WORDS)):
        words = dict(zip(WORDS, (integration, velocity), strict=True))
        run = intervals(base.with_values(words))
        certified += run.facts["slices"]["certified"]
        named = {"integration": integration, "velocity": velocity}
        parts.append({**named, **_limits(run.columns), **_others_stable(base, words)})
    columns = {name: _joined([part[name] for part in parts], [part["K_at_1"].size for part in parts]) for name in parts[0]}
    walls = len(next(axis for axis in base.sweep if axis.name == "B_VE").values)
    counts = {"computed": len(columns["b"]) * walls, "skipped": 0, "certified": certified}
    facts = facts_of(base, run.facts["methods"], counts, {"compute_s": time.perf_counter() - started})
    return Table.of("open-choices", columns, facts, fields=FIELDS)


def _limits(columns) -> dict[str, np.ndarray]:
    """A row per combination of the axes but B_VE, which is the innermost."""
    damping = np.unique(columns["B_VE"])
    first = np.flatnonzero(columns["interval"] == 0)
    begins = (columns["intervals"][first] > 0) & (columns["low"][first] == 0)
    ends = np.where(np.isnan(columns["high_omega"][first]), np.nan, columns["high"][first])
    K = np.where(begins, ends, 0.0).reshape(-1, damping.size)
    islands = (columns["intervals"][first] > 1).reshape(K.shape).any(axis=1)
    slope = (K[:, -1] - K[:, 0]) / (damping[-1] - damping[0])
    line = K[:, :1] + slope[:, None] * (damping - damping[0])
    places = {name: columns[axis][first].reshape(K.shape)[:, 0] for name, axis in AXES.items()}
    found = {"K_at_1": K[:, 0], "K_at_15": K[:, -1], "slope": slope, "bend": np.abs(K - line).max(axis=1)}
    return {**places, **found, "island": islands}


def _others_stable(base: Spec, words: dict[str, str]) -> dict[str, np.ndarray]:
    """Stability of the loops of Figures 2 and 6, each with its own b and with the other choices of a row."""
    axes = [axis for axis in base.sweep if axis.name in AXES.values()]
    shared = tuple(axis for axis in axes if axis.name != "b")
    figure_2 = _stable("fig2", words, shared, load_paper("fig2").bode).all(axis=-1)
    figure_6 = _stable("pmw", words, shared) & _stable("fig6", words, shared)
    shape = tuple(len(axis.values) for axis in axes)
    at_b = [axis.name for axis in axes].index("b")
    return {
        name: np.broadcast_to(np.expand_dims(found, at_b), shape).ravel()
        for name, found in (("fig2_stable", figure_2), ("fig6_stable", figure_6))
    }


def _stable(name: str, words: dict[str, str], axes: tuple, more: tuple = ()) -> np.ndarray:
    """Stability of the loops of a spec, an axis per dimension."""
    radius = radius_over(load_paper(name).with_values(words), (*axes, *more))
    return (radius < 1).reshape([len(axis.values) for axis in (*axes, *more)])


def _joined(parts: list, sizes: list[int]) -> np.ndarray:
    """One column from its parts; a string is repeated for all rows of its part."""
    if isinstance(parts[0], str):
        return np.repeat(np.array(parts, dtype=object), sizes)
    return np.concatenate(parts)
