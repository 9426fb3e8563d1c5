"""Values of a drawn loop's expressions, for arrays of numbers, real or complex."""

from collections.abc import Callable, Mapping
from typing import Any

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import scalars
from wavesweep.engine._drawing.drawn_block import DrawnBlock
from wavesweep.engine._drawing.expressions import (
    Tree,
)
from wavesweep.engine._loops.block import numbers


def keys_with(
    block: DrawnBlock, value: Callable[[Tree], Any], count: Callable[[Tree], Any] | None = None
) -> dict[str, Any]:
    """Return the keys of a block with the values of their numbers; value: of a tree; count: of
    one that is a whole number."""
    types = TYPES[block.type].keys

    def with_value(kind: str, entry: Any) -> Any:
        if kind == "number":
            return value(entry)
        if kind == "integer":
            return int((count or value)(entry))
        if kind == "list":
            return [value(tree) for tree in entry]
        if kind == "rows":
            return [[value(tree) for tree in row] for row in entry]
        return entry

    return {name: with_value(types[name].type, entry) for name, entry in block.keys}


def numbers_of(values: Mapping[str, object]) -> dict[str, object]:
    """Return flat values by the names that trees have for them, as numbers to compute with."""
    return {
        name: value if isinstance(value, int) else numbers(value)
        for name, value in scalars(values).items()
    }
