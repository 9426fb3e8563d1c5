"""The summary of a table of elasticities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isclose, isnan, pi
from typing import Any

import numpy as np

from wavesweep.cli.messages import Line, Numbers
from wavesweep.sweep.table import Columns

FIRST = 3  # numbers that are named
LEAST = 5e-4  # an elasticity below which a number does not matter


def why(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """For each end and crossing its mode, the limit and the stiffness felt there, each with the numbers that matter most."""
    names = ("interval", "end", "crossing")
    keys = list(zip(*(columns[name].tolist() for name in names), strict=True))
    ends = []
    for key, line in zip(dict.fromkeys(keys), facts["lines_hz"], strict=True):
        rows = np.array([each == key for each in keys])
        quantities = {"limit": "end", "felt": "felt"}
        limits = {name: _limit(columns, rows & (columns["quantity"] == quantity)) for name, quantity in quantities.items()}
        first = int(np.flatnonzero(rows)[0])
        mode = {name: columns[name][first] for name in ("omega", "damping_ratio", "states", "corner")}
        mode |= {"line_hz": line}
        ends.append(dict(zip(names, key, strict=True)) | {name: _plain(value) for name, value in mode.items()} | limits)
    return {
        "along": dict(facts["along"]),
        "stable_intervals": [list(each.values()) for each in facts["intervals"]],
        "slices": dict(facts["slices"]),
        "doubts": list(facts["doubts"]),
        "ends": ends,
    }


def _limit(columns: Columns, rows: np.ndarray) -> Numbers | None:
    """Value, unit, doubt, and elasticities, the largest first; None if there is no such limit."""
    some = np.flatnonzero(rows)
    if not some.size:
        return None
    elasticity = columns["elasticity"][some]
    known = some[~np.isnan(elasticity)]
    order = known[np.argsort(-np.abs(columns["elasticity"][known]), kind="stable")][:FIRST]
    doubts = [word for word in dict.fromkeys(columns["doubt"][some].tolist()) if word]
    return {
        "value": float(columns["limit"][some[0]]),
        "unit": str(columns["unit"][some[0]]),
        "doubts": doubts,
        "elasticities": {str(columns["number"][row]): float(columns["elasticity"][row]) for row in order},
    }


def _plain(value: Any) -> Any:
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and isnan(value) else value


def why_lines(found: Numbers) -> Iterator[Line]:
    """Yield the lines, each with a flag that is true for a warning."""
    axis, spans = found["along"], found["stable_intervals"]
    name, unit = axis["name"], _unit(axis["unit"])
    searched = f"{axis['from']:g} to {axis['to']:g}{unit}"
    if spans:
        yield f"{name}: stable from {' and '.join(f'{low:.6g} to {high:.6g}' for low, high in spans)}{unit}", False
    elif not found["doubts"]:
        yield f"{name}: no stable interval in {searched}", True
    if found["doubts"]:
        none = "" if spans else f", and no stable interval is known in {searched}"
        yield f"{name}: not certified ({', '.join(found['doubts'])}), so no derivatives are given{none}", True
    if spans and not found["ends"]:
        yield f"stability sets no end of it in the range searched, {searched}", False
    for end in found["ends"]:
        yield from _end_lines(name, end)


def _end_lines(name: str, end: Numbers) -> Iterator[Line]:
    limit, felt = end["limit"], end["felt"]
    corner = f", crossing {end['crossing'] + 1} of a corner" if end["corner"] else ""
    frequency = f"{end['omega']:.5g} rad/s ({end['omega'] / (2 * pi):.4g} Hz)" if end["omega"] else ""
    mode = f"an oscillation of {frequency}" if end["omega"] else "a mode without oscillation from frame to frame"
    mode = "a mode that is not known" if end["omega"] is None else mode
    within = end["omega"] is not None and not isclose(2 * pi * end["line_hz"], end["omega"], rel_tol=1e-6, abs_tol=1e-9)
    if within:
        once = f"once a frame {end['omega'] / (2 * pi):.4g} Hz" if end["omega"] else "none from frame to frame"
        mode = f"an oscillation of {end['line_hz']:.4g} Hz within the frame ({once})"
    beside = " from frame to frame" if within else " beside it"
    damped = "" if end["damping_ratio"] is None else f", damping ratio {end['damping_ratio']:.3g}{beside}"
    yield f"{end['end']} end, {name} = {limit['value']:.6g}{_unit(limit['unit'])}{corner}: set by {mode}{damped}", False
    if end["states"]:
        yield f"  states that take part: {end['states']}", False
    yield _moves(limit)
    if felt is not None:
        line, warning = _moves(felt)
        said = felt["value"] == limit["value"] == 0  # of which a per cent is nothing either
        warning = warning and not said
        yield f"  felt there: {felt['value']:.6g}{_unit(felt['unit'])}{'' if said else ';' + line.removeprefix(' ')}", warning


def _moves(limit: Numbers) -> Line:
    """The sentence about the numbers that matter most."""
    moved = {number: value for number, value in limit["elasticities"].items() if abs(value) >= LEAST}
    if moved:
        parts = [f"{'up' if value > 0 else 'down'} by {abs(value):.3g} %" for value in moved.values()]
        verbs = ["moves it ", *[""] * len(parts)]
        sentences = [f"1 % more {number} {verb}{part}" for number, verb, part in zip(moved, verbs, parts, strict=False)]
        return f"  {', '.join(sentences)}", False
    if limit["doubts"]:
        return f"  no elasticities ({', '.join(limit['doubts'])})", True
    if limit["value"] == 0:
        return "  a per cent of 0 is nothing; the column slope has the derivatives", False
    return "  no number of the loop moves it", False


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" {unit}"
