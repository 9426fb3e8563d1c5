"""The columns of the tables `simulate` and `simulate-response`."""

from dataclasses import replace

from wavesweep.program.tables.fields import COLUMNS as OF_CORE
from wavesweep.program.tables.fields import columns_beside

_GROUPS, _BODE = columns_beside(__file__), OF_CORE["bode"]
TICKS = _GROUPS["ticks"]
_LINEAR = [
    replace(
        column,
        name=f"linear_{column.name}",
        description=f"{column.description}, of the linear loop",
    )
    for column in (*_BODE[4:12], *_BODE[14:16])
]
COLUMNS = {
    # A drawn loop has those of its hand, if any, and its inputs, outputs and named signals behind
    # the time.
    "simulate": (*TICKS, *_GROUPS["signals"]),
    # As seen in the simulation, beside what the linear analysis says of the same loop.
    "simulate-response": (*_BODE[:12], *_LINEAR, *_GROUPS["simulate-response"]),
}
