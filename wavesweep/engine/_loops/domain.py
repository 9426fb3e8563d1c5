"""Where a loop that a spec draws is an analytic function of one of its numbers, and which
numbers make no loop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import RATE, Drawing, name_of, scalars
from wavesweep.engine._drawing.expressions import SharedParts, Tree
from wavesweep.engine._keys.checking import computable
from wavesweep.engine._loops.values import numbers_of
from wavesweep.engine.errors import UsageError

if TYPE_CHECKING:
    from wavesweep.engine._drawing.conditions import Condition


def domain(
    drawing: Drawing, values: Mapping[str, Any], path: str, span: tuple[float, float]
) -> tuple[float, float]:
    """The values of a number, about a span, between which all loops are analytic functions of it on
    the real axis.

    values: flat numbers, or arrays over the loops of a sweep, of which up to LOOPS_AT_ONCE are
    examined; see `domains`.
    """
    below = -np.inf
    above = np.inf
    for key, guard, values_of_others, root in _known_guards(drawing, values, path):
        rows, _ = _different(values_of_others, LOOPS_AT_ONCE)
        low, high = _limits(key, guard, root, rows, name_of(path), span)
        below = max(below, low.max())
        above = min(above, high.min())
    return float(below), float(above)


def domains(
    drawing: Drawing, values: Mapping[str, Any], path: str, span: tuple[float, float], size: int
) -> tuple[np.ndarray, np.ndarray]:
    """The values of a number, about a span, between which each loop is an analytic function of it:
    two arrays, `(size,)`.

    values: flat numbers, or arrays over the loops. Divisors, arguments of roots, masses and the
    like must not vanish there, but an argument of a root may at a low end of 0, which is then the
    lowest value (see `bends_at_zero`). Beyond the span their changes of sign are searched for on a
    grid that is finer near the span; half of the way to the nearest one is allowed, and of a cutoff
    all of the way to 0. What holds for a loop does not depend on the others. Errors: UsageError if
    one vanishes within the span.
    """
    name = name_of(path)
    below = np.full(size, -np.inf)
    above = np.full(size, np.inf)
    for key, guard, values_of_others, root in _known_guards(drawing, values, path):
        rows, row = _different(values_of_others)
        lows = []
        highs = []
        for first in range(0, 1 + row.max(initial=0), LOOPS_AT_ONCE):
            block = _rows_of(rows, slice(first, first + LOOPS_AT_ONCE))
            low, high = _limits(key, guard, root, block, name, span)
            lows.append(low)
            highs.append(high)
        below = np.maximum(below, np.concatenate(lows)[row])
        above = np.minimum(above, np.concatenate(highs)[row])
    return below, above


def _known_guards(
    drawing: Drawing, values: Mapping[str, Any], path: str
) -> Iterator[tuple[str, Tree, dict[str, Any], Tree | None]]:
    """Yield the path of a key, a guard that reads the number, the other numbers that it reads,
    and its root; not those of filters of order 0, which are connections."""
    numbers = scalars({**values, path: 0.0})
    unused = set()
    for block in drawing.blocks:
        if block.type == "butterworth" and not int(dict(block.keys)["order"].values(numbers)):
            unused.add(f"block.{block.name}.cutoff_hz")
    for key, guard, read, root in _guards_of(drawing, name_of(path)):
        if key not in unused:
            constants = {name: value for name, value in numbers.items() if name in read}
            yield key, guard, constants, root


def _limits(
    key: str,
    guard: Tree,
    root: Tree | None,
    constants: dict[str, Any],
    name: str,
    span: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and the highest value that a guard allows in each loop, `(loops,)`; known:
    other numbers, `(loops, 1)`."""
    low, high = span
    away = DISTANCES * (high - low)
    within = np.linspace(low, high, POINTS_WITHIN)

    def values_at(tree: Tree, points: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.asarray(tree.values({**constants, name: points})).reshape(-1, points.size)

    value = values_at(guard, within)
    from_root: np.ndarray | bool = False
    nothing = np.zeros(1, bool)
    if root:
        at_low = values_at(root, within[:1])[:, 0]
        shape = max(len(value), at_low.size), within.size
        value = np.array(np.broadcast_to(value, shape))
        nothing = (value == 0).all(-1)  # a root of 0 everywhere is 0
        exponent = np.broadcast_to(root.whole_exponent(constants, name), (shape[0], 1))[:, 0]
        nothing |= exponent >= 0  # a polynomial in its base
        value[nothing] = 1.0
        from_root = (value[:, 0] == 0) & np.isfinite(at_low) & (low == 0)
        value[from_root, 0] = value[from_root, 1]
    bent = _rows_of(constants, ~nothing) if nothing.any() else constants
    touched = not nothing.all() and _touches_zero(guard, bent, name, within)
    if touched or not _keep_sign(value).all():
        raise UsageError(
            f"intervals along {name}: between {low:g} and {high:g} there is a value without a loop, or at which it is not "
            f"smooth, since {key} divides by zero, takes a root of zero or of a negative number, or leaves its range"
        )
    is_cutoff = key.endswith(".cutoff_hz") and guard.operation == "name"
    limits = []
    for direction, end in ((-1, low), (1, high)):
        points = np.concatenate([[end], end + direction * away])
        good = _keep_sign(values_at(guard, points))
        first = np.argmin(good, axis=-1)
        if is_cutoff:  # a filter is smooth at 0 as well
            limit = points[first - 1]
        else:
            limit = (end + points[first]) / 2
        limits.append(np.where(good.all(-1) | nothing, direction * np.inf, limit))
    lowest, highest = limits
    lowest, highest = np.broadcast_arrays(np.where(from_root, low, lowest), highest)
    return lowest, highest


@lru_cache(maxsize=256)
def bends_at_zero(drawing: Drawing, path: str) -> bool:
    """Whether an eigenvalue 1 that a loop has at 0 of a number may not leave it in proportion to
    the number.

    The number is read by a root, or in a power: `2*sqrt(K*m)` is not analytic at 0, and `K**2` has
    a double zero there.
    """
    name = name_of(path)
    if any(root for *_, root in _guards_of(drawing, name)):
        return True
    return any(1 < tree.degree(name) < math.inf for _, tree in drawing.trees())


def guards_at(
    drawing: Drawing, values: Mapping[str, Any], path: str, shape: tuple[int, ...]
) -> np.ndarray:
    """What must not vanish for the loops to be analytic in a number, at values of it, real or
    complex: `(*shape, guards)`."""
    numbers = scalars(values)
    shared = SharedParts()
    guard_values = []
    for _, guard, _, root in _guards_of(drawing, name_of(path)):
        value = np.broadcast_to(guard.values(numbers, shared), shape)
        if root:  # of 0 everywhere is 0
            exponent = root.whole_exponent(numbers, name_of(path))
            value = np.where((value == 0) | (exponent >= 0), 1.0, value)
        guard_values.append(value)
    return np.stack(guard_values, axis=-1) if guard_values else np.ones((*shape, 0))


def _keep_sign(value: np.ndarray) -> np.ndarray:
    """Whether each value has the sign of the first one of its row, and is not 0, `(loops,
    points)`."""
    with np.errstate(all="ignore"):
        sign = np.sign(value)
    return (sign == sign[:, :1]) & (sign != 0) & np.isfinite(sign)


POINTS_WITHIN = 401  # of a span, at which signs are looked at
DISTANCES = np.geomspace(1e-6, 1e3, 400)  # from the ends of a span, in widths of it


def _touches_zero(guard: Tree, constants: dict[str, Any], name: str, points: np.ndarray) -> bool:
    """Whether a tree that keeps its sign vanishes between points nevertheless, as a square does."""
    with np.errstate(all="ignore"):
        size = np.abs(guard.values({**constants, name: points})).reshape(-1, points.size)
        loop, nearest = np.nonzero((size[:, 1:-1] <= size[:, :-2]) & (size[:, 1:-1] < size[:, 2:]))
        if not nearest.size:
            return False
        low = points[nearest]
        high = points[nearest + 2]
        flat = np.ones(nearest.size)
        numbers_at = {
            constant: value[loop] if np.ndim(value) else value
            for constant, value in constants.items()
        }
        for _ in range(12):  # towards a least size, each by a factor of ten
            # The narrowest cell in which a least size is looked for has 40 roundings of the number.
            narrowest = 40 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
            wide = high - low > narrowest
            among = np.linspace(low, high, 21, axis=-1)
            size = np.abs(guard.values({**numbers_at, name: among}))
            flat = np.where(wide, size.min(-1) / size[:, [0, -1]].min(-1), flat)
            best = np.clip(size.argmin(-1), 1, 19)[:, None]
            low = np.take_along_axis(among, best - 1, -1)[:, 0]
            high = np.take_along_axis(among, best + 1, -1)[:, 0]
        # A least size below this share of the size ten steps away counts as 0.
        return bool((flat <= 0.1).any())


LOOPS_AT_ONCE = 1000  # loops that are examined at a time


def _different(
    numbers: dict[str, Any], most_rows: int | None = None
) -> tuple[dict[str, Any], np.ndarray]:
    """The different rows of the arrays among these values, as columns, and the row of each loop.

    most_rows: so many rows at most, spread over all.
    """
    arrays = {name: np.asarray(value) for name, value in numbers.items() if np.ndim(value)}
    if not arrays:
        return numbers, np.zeros(1, int)
    rows, row = np.unique(np.stack(list(arrays.values()), axis=1), axis=0, return_inverse=True)
    if most_rows is not None:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, most_rows).astype(int))]
    return numbers | {name: rows[:, [column]] for column, name in enumerate(arrays)}, row.reshape(
        -1
    )


def _rows_of(numbers: dict[str, Any], some: slice | np.ndarray) -> dict[str, Any]:
    return {name: value[some] if np.ndim(value) else value for name, value in numbers.items()}


@lru_cache(maxsize=256)
def _guards_of(drawing: Drawing, number: str) -> tuple[tuple[Any, ...], ...]:
    """The guards that read a number, as path of a key, tree, names of all numbers that it or its
    root reads, and that root."""
    guards = {
        (guard, root): key for key, tree in drawing.trees() for guard, root in tree.singular()
    }
    guards |= {(tree, None): key for key, tree in divisors(drawing)}
    guards_of_number = []
    for (guard, root), key in guards.items():
        if number in guard.names:
            read = frozenset((root or guard).names)
            guards_of_number.append((key, guard, read, root))
    return tuple(guards_of_number)


def divisors(drawing: Drawing) -> Iterator[tuple[str, Tree]]:
    """Yield the path of a key and a tree that the equations of a block divide by, or take a root
    of."""
    yield RATE, drawing.tick_hz
    for block in drawing.blocks:
        keys = dict(block.keys)
        for name, key in TYPES[block.type].keys.items():
            if name in keys and key.above_low:  # what must be positive may be divided by
                yield f"block.{block.name}.{name}", keys[name]
        for name in TYPES[block.type].below_half:
            twice = 2.0 * (keys[name] * block.every)
            yield f"block.{block.name}.{name}", drawing.tick_hz - twice
        if block.type in ("tf", "pid"):
            path = f"block.{block.name}.{'den' if block.type == 'tf' else 'tau'}"
            yield path, dict(block.core(drawing.tick_hz).keys)["den"][0]
        if block.type == "local_model":
            yield f"block.{block.name}.K", block.divisor(drawing.tick_hz)


def refuse_unsuitable(drawing: Drawing, values: Mapping[str, Any]) -> None:
    """Raise UsageError if a loop of a batch has a number that a key does not accept. values: as
    for `assembled`."""
    wrong = unsuitable(drawing, values)
    if not wrong.any():
        return
    from wavesweep.engine._drawing.conditions import faults

    first = int(np.flatnonzero(wrong)[0])
    loop = dict(values)
    texts = []
    for path, value in values.items():
        if np.ndim(value):
            loop[path] = float(np.broadcast_to(value, wrong.shape)[first])
            texts.append(f"{name_of(path)} = {loop[path]:g}")
    path, expected, reason = next(faults(drawing, loop), ("a key", "another value", "none"))
    raise UsageError(
        f"{', '.join(texts)} makes no loop: {path}: expected {expected}, found {reason}"
    )


def unsuitable(drawing: Drawing, values: Mapping[str, Any]) -> np.ndarray:
    """Return which loops of a batch have a number that a key does not accept, `(loops,)`.
    values: as for `assembled`; keys that read others, as limits do, are not asked."""
    from wavesweep.engine._drawing.conditions import conditions

    arrays = {path for path, value in values.items() if np.ndim(value)}
    varied = frozenset(map(name_of, arrays))
    single = tuple(item for item in values.items() if item[0] not in arrays)
    size = max((np.size(values[path]) for path in arrays), default=1)
    wrong = np.full(size, _unsuitable_alone(drawing, single, varied))
    if not arrays:
        return wrong
    numbers = numbers_of(values)
    shared = SharedParts()
    with np.errstate(all="ignore"):
        for condition in conditions(drawing):
            if condition.names & varied and condition.names <= numbers.keys():
                wrong |= _broken(condition, numbers, shared)
    return wrong


@lru_cache(maxsize=64)
def _unsuitable_alone(
    drawing: Drawing, items: tuple[tuple[str, float], ...], read_elsewhere: frozenset[str]
) -> bool:
    """Whether keys that read none of the `read_elsewhere` do not accept the numbers of a single loop."""
    from wavesweep.engine._drawing.conditions import conditions

    numbers = numbers_of(dict(items))
    shared = SharedParts()
    with np.errstate(all="ignore"):
        for condition in conditions(drawing):
            alone = condition.names and condition.names <= numbers.keys() - read_elsewhere
            if alone and np.any(_broken(condition, numbers, shared)):
                return True
    return False


def _broken(
    condition: Condition, numbers: Mapping[str, Any], shared: SharedParts
) -> np.ndarray | bool:
    """Whether numbers break a condition, of each loop."""
    values = [tree.values(numbers, shared) for _, tree in condition.reads]
    return np.logical_not(computable(values[0]) & condition.holds(*values))
