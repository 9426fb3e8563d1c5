"""A simulation as one table, the same columns for every controller."""

from __future__ import annotations

import numpy as np

from wavesweep.analysis.march.experiment import Simulation

_MOTION = ("f_h", "x", "v", "x_hat", "v_hat", "f_m", "f_device")
_WAVES = ("u_m", "v_m", "u_s", "v_s", "x_s", "x_dot_s", "F_s", "u_h", "v_l", "v_2")
_ENERGIES = ("hand", "device", "user", "slow", "local", "channel")


def table(simulation: Simulation) -> dict[str, np.ndarray]:
    """Give the columns of the table `simulate`, a row per fast tick, in SI units.

    The columns do not depend on the controller: what it does not have is NaN throughout. Slow signals hold the last
    update. The rows end before the first tick in which a number leaves the range of doubles.
    """
    signals, frame = simulation.signals, simulation.frame
    ticks = np.arange(len(signals["x"]))
    missing = np.full(len(ticks), np.nan)
    energies = {f"energy_{name}": getattr(simulation.energy, name) for name in _ENERGIES}
    columns = {"tick": ticks, "frame": ticks // frame, "phase": ticks % frame, "time_s": signals["time"]}
    columns |= {name: signals.get(name, missing) for name in _MOTION}
    columns["touching"] = signals.get("touching", np.zeros(0, dtype=bool))  # without a tick nothing was seen at all
    columns["late"] = np.repeat(simulation.late, frame)[: len(ticks)]
    columns |= {name: signals.get(name, missing) for name in _WAVES}
    columns |= {name: missing if column is None else column for name, column in energies.items()}
    whole = _finite_rows([column for column in columns.values() if column is not missing], len(ticks))
    return {name: column[:whole] for name, column in columns.items()}


def _finite_rows(columns: list[np.ndarray], rows: int) -> int:
    """Give how many rows come before the first number that is infinite or none."""
    finite = np.ones(rows, dtype=bool)
    for column in columns:
        finite &= np.isfinite(column)
    return rows if finite.all() else int(finite.argmin())
