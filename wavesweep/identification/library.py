"""The fit of a device, as a call."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from wavesweep.identification import table
from wavesweep.program.tables.frame import framed

if TYPE_CHECKING:
    from pandas import DataFrame


def identify(log: str | Path, **options: Unpack[table.FitOptions]) -> DataFrame:
    """Mass, damping and more of a device from a log of force and position, as `wavesweep identify` finds them.

    Parameters
    ----------
    log : str or Path
        A CSV file with time (s), force (N), or a current (A), and position (m), or a velocity or an
        acceleration; or torque (N*m) and angle (rad), speed or angular_acceleration.
    **options
        What the log has and what is fitted, see Other Parameters.

    Returns
    -------
    DataFrame
        The rows are the samples. `.attrs["summary"]` has the `parameters` with `value`, `low`,
        `high` and `unit`, whether the log is `explained`, what is `missing`, and the `residual`.

    Other Parameters
    ----------------
    columns, scales : dict, optional
        Names in the file and factors to these units, by name: `columns={"position": "enc"},
        scales={"position": 2e-5}`.
    resolution : float, optional
        Step of the readings (m or rad), by default the one that they show.
    spring, friction : bool, default False
        Fit a spring, fit Coulomb friction.
    two_masses : bool, default False
        Fit a load on a spring.
    delay : float, optional
        In ticks; None to fit it.
    rate_hz : float, optional
        The file is a frequency response, whose force was held at this rate (Hz).
    motor_constant : tuple of float, optional
        Bounds, (low, high), in N/A or N*m/A, for a current.
    axes : list of str, optional
        `["x", "y", "z"]`, or the first two: the log has the forces and positions of all. Columns
        are then given with commas, `columns={"position": "q1,q2"}`.

    Raises
    ------
    UsageError
        For a log that cannot be used.
    """
    return framed(table.identify(str(log), **options))
