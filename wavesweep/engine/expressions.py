"""Expressions of drawn loops as trees: their text, the names in them, their degree and their values."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._drawing.expressions import (
        FUNCTIONS,
        ONE,
        Tree,
        constants_of,
        degree,
        evaluate,
        is_constant,
        linear,
        named,
        names_in,
        sum_of,
        text_of,
        value_of,
        with_trees,
    )
    from wavesweep.engine._drawing.parsing import parse
else:
    __getattr__ = on_demand(
        {
            "_drawing.expressions": (
                "FUNCTIONS",
                "ONE",
                "Tree",
                "constants_of",
                "degree",
                "evaluate",
                "is_constant",
                "linear",
                "named",
                "names_in",
                "sum_of",
                "text_of",
                "value_of",
                "with_trees",
            ),
            "_drawing.parsing": ("parse",),
        }
    )
