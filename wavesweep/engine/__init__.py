"""The engine: multirate loops in, arrays out. It knows no files, no specs, no tables and no commands.

Its front is `loop_from_blocks` and `loop_from_drawing`, which make a `ClosedLoop`; see docs/engine.md. Names are loaded when
they are first touched.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wavesweep.engine.closed_loop import (
        ClosedLoop,
        ClosedLoopPoles,
        ExtremeGain,
        InputResponse,
        LiftedStateSpace,
        StableIntervals,
    )
    from wavesweep.engine.loop_sources import StateSpaceBlock, loop_from_blocks, loop_from_drawing

__all__ = [
    "ClosedLoop",
    "ClosedLoopPoles",
    "ExtremeGain",
    "InputResponse",
    "LiftedStateSpace",
    "StableIntervals",
    "StateSpaceBlock",
    "loop_from_blocks",
    "loop_from_drawing",
]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    source = "loop_sources" if name in ("StateSpaceBlock", "loop_from_blocks", "loop_from_drawing") else "closed_loop"
    return getattr(import_module(f"wavesweep.engine.{source}"), name)
