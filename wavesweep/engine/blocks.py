"""Loops compiled to blocks on a common tick: their equations with numbers put in, and the names of signals."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._loops.block import Block
    from wavesweep.engine._loops.definitions import Rows, continuous, running
    from wavesweep.engine._loops.device import impulse_and_step, motion
    from wavesweep.engine._loops.from_drawing import (
        BESIDE,
        FACTOR,
        OUTPUT,
        POSITION,
        PRODUCT,
        REACTION,
        Ports,
    )
    from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock
    from wavesweep.engine._monodromy.interconnect import all_sums, connect
else:
    __getattr__ = on_demand(
        {
            "_loops.block": ("Block",),
            "_loops.definitions": ("Rows", "continuous", "running"),
            "_loops.device": ("impulse_and_step", "motion"),
            "_loops.from_drawing": (
                "BESIDE",
                "FACTOR",
                "OUTPUT",
                "POSITION",
                "PRODUCT",
                "Ports",
                "REACTION",
            ),
            "_loops.multirate": ("MultirateLoop", "ScheduledBlock"),
            "_monodromy.interconnect": ("all_sums", "connect"),
        }
    )
