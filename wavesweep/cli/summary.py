"""What a user wants to know of a table before opening it, in a few lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.cli.passivity_summary import filter_choices, passivity
from wavesweep.cli.simulation_summary import simulated_response, simulation

Line = tuple[str, bool]


def summary(kind: str, columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Iterator[Line]:
    """Give lines, each with whether it is a warning."""
    yield from ((str(notice), False) for notice in facts.get("notices", ()))
    match kind:
        case "bode":
            yield from _bode(columns)
        case "passivity":
            yield from passivity(columns, facts)
        case "passivity-filters":
            yield from filter_choices(columns)
        case "simulate":
            yield from simulation(columns, facts)
        case "simulate-response":
            yield from simulated_response(columns)


def _bode(columns: Mapping[str, np.ndarray]) -> Iterator[Line]:
    frequencies = len(np.unique(columns["frequency_hz"]))
    curves = len(columns["frequency_hz"]) // max(frequencies, 1)
    yield f"{_count(curves, 'curve')} of {frequencies} frequencies", False
    unstable = ~columns["stable"]
    if unstable.any():
        names = ", ".join(sorted(set(columns["spec"][unstable].tolist())))
        yield f"unstable, so no steady response would be seen: curves of {names}", True
    doubted = np.isin(columns["doubt"], ["", "unstable"], invert=True)
    if doubted.any():
        words = ", ".join(sorted(set(columns["doubt"][doubted].tolist())))
        yield f"not vouched for ({words}): {_count(int(doubted.sum()), 'row')}, see the column doubt", True


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
