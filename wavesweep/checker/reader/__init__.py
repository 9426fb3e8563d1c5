"""What a spec means, from its documents alone: the instants of one period of its loop, with their equations.

`loop_of` takes the tables of a spec and an arithmetic (`Arithmetic` in loops.py), in which it computes every coefficient:
doubles, or numbers that are enclosed while others have any value of a range. It shares nothing with the package's own reader.
"""

from wavesweep.checker.reader.controllers import Controller
from wavesweep.checker.reader.drawings import Drawing


def loop_of(tables: dict, arithmetic, cut: str = "") -> Controller | Drawing:
    """The loop of a spec; `schedule()` of it has its instants, `key.asked` the keys that were read.

    cut: in a drawing an output of a block, to which an input "!cut" is added where it is read, whenever the block runs.
    """
    if "controller" in tables:
        return Controller(tables, arithmetic)
    return Drawing(tables, arithmetic, cut)
