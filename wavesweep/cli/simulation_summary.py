"""What a user wants to know of a simulation before opening its tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

Line = tuple[str, bool]


def simulation(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Iterator[Line]:
    """Give lines, each with whether it is a warning."""
    wanted, rows = facts["ticks"]["wanted"], len(columns["tick"])
    rates, options = facts["spec"]["rates"], facts["spec"]["simulate"]
    kind, tick = facts["spec"]["controller"]["kind"], 1 / rates["fast_hz"]
    much = f"{rows}" if rows == wanted else f"{rows} of {wanted}"
    yield f"{kind} under {options['input']}: {much} ticks, {rows * tick:g} s", False
    if rows < wanted:
        yield f"the loop diverges: numbers overflow in tick {rows}, {rows * tick:g} s; the rows end before it", True
    if rows == 0:
        return
    if "wall" in options:
        yield _contact(columns["touching"]), False
    if "max_force" in options:
        cut_off = np.mean(columns["f_m"] != columns["f_device"])
        yield f"motors at their limit of {options['max_force']:g} N for {100 * cut_off:.3g} % of the time", False
    if options["late"] or options["dropped"]:
        results = columns["late"][columns["phase"] == 0]
        late, lost = int((results > 0).sum()), int((results < 0).sum())
        yield f"of {len(results)} slow results {late} came late and {lost} never", False
    yield _energy(columns), False


def _contact(touching: np.ndarray) -> str:
    made = int(np.sum(touching[1:] & ~touching[:-1]) + touching[0])
    times = "once" if made == 1 else f"{made} times"
    return f"contact made {times}, felt for {100 * touching.mean():.3g} % of the time"


def _energy(columns: Mapping[str, np.ndarray]) -> str:
    hand, device, channel = (columns[f"energy_{name}"] for name in ("hand", "device", "channel"))
    line = f"energy: the hand gave {hand[-1]:.4g} J, the motors took {device[-1]:.4g} J"
    if np.isnan(channel[-1]):
        return line
    return f"{line}, the wave channel kept {channel[-1]:.4g} J (at least {channel.min():.4g} J at any time)"


def simulated_response(columns: Mapping[str, np.ndarray]) -> Iterator[Line]:
    """Give the line that says how far what was seen is from what the linear loop has."""
    count = len(columns["frequency_hz"])
    off = [_off(columns, name) for name in ("admittance", "impedance")]
    what = f"response at {count} frequenc{'y' if count == 1 else 'ies'}"
    yield (
        f"{what}: off the linear loop's by at most {off[0]:.2g} (admittance), {off[1]:.2g} (impedance), relative",
        False,
    )


def _off(columns: Mapping[str, np.ndarray], name: str) -> float:
    """Give the largest relative difference; NaN where nothing is known."""
    seen, linear = (columns[f"{kind}{name}_re"] + 1j * columns[f"{kind}{name}_im"] for kind in ("", "linear_"))
    off = np.abs(seen - linear) / np.abs(linear)
    return float(np.max(off, initial=0.0, where=np.isfinite(off)))
