"""Expressions of drawn loops as trees, and the parser that reads them."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._drawing.expressions import FUNCTIONS, ONE, Tree, sum_of
    from wavesweep.engine._drawing.parsing import parse
else:
    __getattr__ = on_demand(
        {
            "_drawing.expressions": ("FUNCTIONS", "ONE", "Tree", "sum_of"),
            "_drawing.parsing": ("parse",),
        }
    )
