"""The engine: multirate loops in, arrays out. It knows no files, no specs, no tables and no commands.

Its front is `loop_from_blocks` and `loop_from_drawing`, which make a `ClosedLoop`; see
docs/engine.md. Modules without an underscore are for everybody, all others for the engine itself.
Names are loaded when they are first touched.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING


def on_demand(sources: Mapping[str, tuple[str, ...]]) -> Callable[[str], object]:
    """The `__getattr__` of a module with names of other modules of the engine, which are loaded when they are first touched.

    sources: module, below `wavesweep.engine` -> its names.
    """
    where = {name: source for source, names in sources.items() for name in names}

    def find(name: str) -> object:
        if name not in where:
            raise AttributeError(f"{name!r} is none of the names {', '.join(where)}")
        from importlib import import_module

        return getattr(import_module(f"wavesweep.engine.{where[name]}"), name)

    return find


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

if not TYPE_CHECKING:
    __getattr__ = on_demand({"closed_loop": tuple(__all__[:6]), "loop_sources": tuple(__all__[6:])})
