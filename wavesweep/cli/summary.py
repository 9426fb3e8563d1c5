"""What a user wants to know of a table before opening it, in a few lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.cli.simulation_summary import simulated_response, simulation

Line = tuple[str, bool]


def summary(kind: str, columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Iterator[Line]:
    """Give lines, each with whether it is a warning."""
    yield from ((str(notice), False) for notice in facts.get("notices", ()))
    match kind:
        case "bode":
            yield from _bode(columns)
        case "simulate":
            yield from simulation(columns, facts)
        case "simulate-response":
            yield from simulated_response(columns)
        case _:
            yield from _intervals(columns, facts)


def _intervals(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Iterator[Line]:
    slices, along = facts["slices"], columns["along"][0] if len(columns["along"]) else "?"
    rows = columns["intervals"] > 0
    # A slice has one row numbered 0, whatever it holds.
    split = int(((columns["intervals"] > 1) & (columns["interval"] == 0)).sum())
    skipped = f" ({slices['skipped']} skipped)" if slices["skipped"] else ""
    holes = f", {_count(split, 'slice')} with a hole" if split else ""
    yield f"{_count(slices['computed'], 'slice')}{skipped}: {_count(int(rows.sum()), 'stable interval')}{holes}", False
    yield _largest(columns, along) if rows.any() else (f"no stable {along} anywhere in the swept range", False)
    # Rows and not slices: an uncertified row names the interval that a user should not lean on.
    doubtful, every = int((~columns["certified"]).sum()), _count(len(columns["certified"]), "row")
    if doubtful:
        yield f"{doubtful} of {every} not certified: see the columns certified and residual", True
    else:
        yield f"all {every} certified", False


def _largest(columns: Mapping[str, np.ndarray], along: str) -> Line:
    row = int(np.nanargmax(columns["high"]))
    axes = list(columns)[: list(columns).index("along")]
    place = ", ".join(f"{axis} = {columns[axis][row]:g}" for axis in axes)
    ended = ", where the swept range ends" if np.isnan(columns["high_omega"][row]) else ""
    return f"largest stable {along}: {columns['high'][row]:.6g}{f' at {place}' if place else ''}{ended}", False


def _bode(columns: Mapping[str, np.ndarray]) -> Iterator[Line]:
    frequencies = len(np.unique(columns["frequency_hz"]))
    curves = len(columns["frequency_hz"]) // max(frequencies, 1)
    yield f"{_count(curves, 'curve')} of {frequencies} frequencies", False
    unstable = ~columns["stable"]
    if unstable.any():
        names = ", ".join(sorted(set(columns["spec"][unstable].tolist())))
        yield f"unstable, so no steady response would be seen: curves of {names}", True


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
