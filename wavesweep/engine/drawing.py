"""Drawn loops: keys and expressions without values, their block types, and what their language allows."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._drawing.block_classes import expanded, numbers_of_blocks
    from wavesweep.engine._drawing.block_types import (
        LONGEST_DELAY,
        MOST_LATE,
        TICK_HZ,
        TYPES,
        without_rule,
    )
    from wavesweep.engine._drawing.conditions import OF_PLANT, faults
    from wavesweep.engine._drawing.drawing import (
        AT,
        ENVIRONMENT,
        RATE,
        SHARES,
        WAVE_ENDS,
        Drawing,
        name_of,
        path_of,
        path_of_port,
        scalars,
    )
    from wavesweep.engine._drawing.drawing_tables import (
        TABLES,
        Surroundings,
        read_drawing,
    )
    from wavesweep.engine._drawing.drawn_block import DELTA, PORT, DrawnBlock, Plant, keys_of_block
    from wavesweep.engine._drawing.gain_at_signal import BLOCK, GAIN
else:
    __getattr__ = on_demand(
        {
            "_drawing.block_classes": ("expanded", "numbers_of_blocks"),
            "_drawing.block_types": (
                "LONGEST_DELAY",
                "MOST_LATE",
                "TICK_HZ",
                "TYPES",
                "without_rule",
            ),
            "_drawing.conditions": ("OF_PLANT", "faults"),
            "_drawing.drawing": (
                "AT",
                "Drawing",
                "ENVIRONMENT",
                "RATE",
                "SHARES",
                "WAVE_ENDS",
                "name_of",
                "path_of",
                "path_of_port",
                "scalars",
            ),
            "_drawing.drawing_tables": ("Surroundings", "TABLES", "read_drawing"),
            "_drawing.drawn_block": ("DELTA", "DrawnBlock", "PORT", "Plant", "keys_of_block"),
            "_drawing.gain_at_signal": ("BLOCK", "GAIN"),
        }
    )
