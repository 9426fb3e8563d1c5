"""The figure of margins: the Nyquist curve of the loop that is broken at a signal, and what it has to stay away from."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.plots.style import ONE_COLUMN, assumed, figure
from wavesweep.rows import Columns

POINTS = 4000
LETTERS = 60  # of a line of the note
REACH = 2.5  # of the part that is shown, at least; larger loops are cut off
_CURVE, _DISK, _MARK = "#0072B2", "#D55E00", "0.2"


def margins(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `margins` table: L over the frequencies of the frame, the point -1, the circle of the gain 1, and the disk margin.

    The curve is computed from the spec of the table.
    """
    from wavesweep.spec import load
    from wavesweep.sweep.broken_loops import broken_at

    loop = broken_at(load(facts["spec"]), facts["cut"])
    angles = np.concatenate([np.geomspace(1e-6, 1e-2, POINTS // 2, endpoint=False), np.linspace(1e-2, 1.0, POINTS)]) * np.pi
    value, omega = (dict(zip(columns["margin"].tolist(), columns[name].tolist(), strict=True)) for name in ("value", "omega"))
    with figure(ONE_COLUMN, ONE_COLUMN + 0.5) as canvas:
        axis, turn = canvas.subplots(), np.exp(1j * np.linspace(0, 2 * np.pi, 400))
        axis.plot(turn.real, turn.imag, color="0.7", linewidth=0.8, linestyle="--", label="gain 1")
        L = loop.response(angles)
        axis.plot(L.real, L.imag, color=_CURVE, linewidth=1.2, label=f"L at {facts['cut']}")
        axis.plot(L.real, -L.imag, color=_CURVE, linewidth=0.6, linestyle=":")
        axis.plot([-1], [0], "+", color=_MARK, markersize=8)
        if not np.isnan(gain := value["disk_gain"]):
            disk = -(gain + 1 / gain) / 2 + (gain - 1 / gain) / 2 * turn
            axis.fill(disk.real, disk.imag, color=_DISK, alpha=0.25, linewidth=0, label="disk margin")
        for name, mark in (("gain_up", "^"), ("gain_down", "v"), ("phase", "o")):
            if not np.isnan(omega[name]):
                at = complex(loop.response(omega[name] * loop.period))
                axis.plot([at.real], [at.imag], mark, color=_MARK, markersize=4, label=name.replace("_", " "))
        axis.set_xlim(-REACH, REACH)
        axis.set_ylim(-REACH, REACH)
        axis.set_aspect("equal")
        axis.set_ylabel("imaginary part of L")
        canvas.legend(loc="outside upper center", ncols=3, fontsize=7)
        notes = wrap(f"Assumes: {assumed(facts)}.", LETTERS) if facts.get("assumes") else []
        canvas.supxlabel("\n".join(["real part of L", *notes]), fontsize=8)
    return canvas
