"""Values of a drawn loop's expressions, for arrays of numbers, real or complex."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import scalars
from wavesweep.engine._drawing.drawn_block import DrawnBlock
from wavesweep.engine._drawing.expressions import (
    SharedParts,
    Tree,
)
from wavesweep.engine._loops.block import numbers

ROUNDED = "(rounded)"  # no number of a spec can have this name


def values_of(tree: Tree, numbers: Mapping[str, Any], shared: SharedParts | None = None) -> Any:
    """Return the value of a tree without signals, correct to a few roundings of itself; the numbers
    are exact.

    numbers: name -> number, or array of numbers. Where digits are lost, as in sums that cancel, the
    value is computed again in ball arithmetic, each element from its own numbers alone. A missing
    value is NaN or infinite. shared: of trees at the same numbers.
    """
    if tree.is_leaf:
        return tree.evaluate(numbers)
    shared = SharedParts() if shared is None else shared

    def watch(node: Tree, *values: Any) -> None:
        lost = np.asarray(node.lost_digits(*values))
        if lost.any():
            shared.lost[id(node)] = lost

    with np.errstate(all="ignore"):
        rough = tree.evaluate(numbers, np, watch, shared)
    without = shared.lost_in(tree)
    if not without:
        return rough
    lost = np.logical_or.reduce(np.broadcast_arrays(*without)) & np.isfinite(rough)
    return _again(tree, numbers, np.array(rough, order="C"), lost)


def rest_of(tree: Tree, value: Any, numbers: Mapping[str, Any]) -> Any:
    """Return the part of the value of a tree that rounding has taken; 0 for a number itself, and
    for complex values."""
    if tree.is_given or np.iscomplexobj(value):
        return 0.0
    return values_of(tree - Tree.name(ROUNDED), {**numbers, ROUNDED: value})


def _again(tree: Tree, numbers: Mapping[str, Any], values: np.ndarray, lost: np.ndarray) -> Any:
    """Return the values, those that have lost digits from ball arithmetic."""

    at = np.flatnonzero(np.broadcast_to(lost, values.shape))
    columns = {}
    for name in tree.names:
        columns[name] = np.broadcast_to(numbers[name], values.shape).reshape(-1)[at].tolist()
    exact_values = []
    for row in range(at.size):
        exact_values.append(tree.exactly({name: column[row] for name, column in columns.items()}))
    exact = np.array(exact_values)
    if values.dtype.kind != "c" and exact.dtype.kind == "c":
        exact = np.where(exact.imag == 0, exact.real, np.nan)
    values.reshape(-1)[at] = exact
    return values if values.shape else values.item()


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
