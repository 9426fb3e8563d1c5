"""The fit of a device, as a call."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from wavesweep.core.tables.frame import framed
from wavesweep.identification import table

if TYPE_CHECKING:
    from pandas import DataFrame


def identify(log: str | Path, **asked: Unpack[table.Asked]) -> DataFrame:
    """Mass, damping and more of a device from a log of force and position, as `wavesweep identify` finds them.

    log: a CSV file with time (s), force (N), or a current (A), and position (m), or a velocity or an acceleration; or torque
    (N*m) and angle (rad), speed or angular_acceleration. columns, scales: names in the file and factors to these units, by
    name: `columns={"position": "enc"}, scales={"position": 2e-5}`. motor_constant: bounds, (low, high), in N/A or N*m/A, for a
    current. resolution: step of the readings, by default the one that they show. spring, friction: fit some. two_masses: fit a
    load on a spring. delay: in ticks, None to fit it.
    rate_hz: the file is a frequency response, whose force was held at this rate.
    The rows are the samples; `.attrs["summary"]` has the `parameters` with `value`, `low`, `high` and `unit`, whether the log
    is `explained`, what is `missing`, and the `residual`. Errors: UsageError for a log that cannot be used.
    """
    return framed(table.identify(str(log), **asked))
