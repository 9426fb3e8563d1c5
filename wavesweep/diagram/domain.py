"""Where a loop that a spec draws is an analytic function of one of its numbers."""

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from wavesweep.diagram.uneven import Uneven
from wavesweep.errors import UsageError
from wavesweep.spec.drawing import Drawing, scalars
from wavesweep.spec.expressions import degree, evaluate, names_in, singular


def domain(drawing: Drawing, values: Mapping[str, object], path: str, span: tuple[float, float]) -> tuple[float, float]:
    """The values of a number, about a span, between which the loop is an analytic function of it on the real axis.

    values: flat numbers, or arrays over the loops of a sweep. Divisors, arguments of roots, masses and the like must not vanish
    there, but an argument of a root may at a low end of 0, which is then the lowest value (see `bends_at_zero`). Beyond the
    span their changes of sign are searched for on a grid that is finer near the span; half of the way to the nearest one is
    allowed. Errors: UsageError if one vanishes within the span.
    """
    low, high = span
    width, (below, above) = high - low, (-np.inf, np.inf)
    away = np.geomspace(1e-6, 1e3, 400) * width
    name = path.removeprefix("numbers.")
    for key, guard, read, root in _guards_of(drawing, name):
        known = _different({each: value for each, value in scalars({**values, path: 0.0}).items() if each in read})
        within = np.linspace(low, high, 401)
        if root:
            known = _not_nothing(guard, known, name, within)
            if known is None:
                continue
            if low == 0 and _only_roots(guard, root, {**known, name: within[:1]}):
                within, below = within[1:], 0.0
        if not _keeps_sign(guard, known, name, within).all() or _touches_zero(guard, known, name, within):
            raise UsageError(
                f"intervals along {name}: between {low:g} and {high:g} there is a value without a loop, or at which it is not "
                f"smooth, since {key} divides by zero, takes a root of zero or of a negative number, or leaves its range"
            )
        for direction, end in ((-1, low), (1, high)) if below < low else ((1, high),):
            points = np.concatenate([[end], end + direction * away])
            good = _keeps_sign(guard, known, name, points)
            first = int(np.argmin(good.all(0)))
            if not good.all():
                limit = (end + points[first]) / 2
                below, above = (max(below, limit), above) if direction < 0 else (below, min(above, limit))
    return float(below), float(above)


@lru_cache(maxsize=256)
def bends_at_zero(drawing: Drawing | Uneven, path: str) -> bool:
    """Whether an eigenvalue 1 that a loop has at 0 of a number may not leave it in proportion to the number.

    The number is read by a root, or in a power: `2*sqrt(K*m)` is not analytic at 0, and `K**2` has a double zero there.
    """
    name = path.removeprefix("numbers.")
    if isinstance(drawing, Uneven):
        return False
    return any(root for *_, root in _guards_of(drawing, name)) or any(
        1 < degree(tree, name) < math.inf for _, tree in drawing.trees()
    )


def guards_at(drawing: Drawing | Uneven, values: Mapping[str, object], path: str, shape: tuple[int, ...]) -> np.ndarray:
    """What must not vanish for the loops to be analytic in a number, at values of it, real or complex: `(*shape, guards)`."""
    found, name = [], path.removeprefix("numbers.")
    if not isinstance(drawing, Uneven):
        known = scalars(values)
        for _, guard, _, root in _guards_of(drawing, name):
            value = np.broadcast_to(_value(guard, known), shape)
            found.append(np.where(value == 0, 1.0, value) if root else value)  # a root of 0 everywhere is 0
    return np.stack(found, axis=-1) if found else np.ones((*shape, 0))


def _not_nothing(guard, known, name, points):
    """The loops in which a guard is not 0 at all of the points; None if there are none."""
    with np.errstate(all="ignore"):
        value = np.asarray(_value(guard, {**known, name: points})).reshape(-1, points.size)
    some = (value != 0).any(-1)
    if some.all() or not some.any():
        return known if some.all() else None
    return {each: part[some] if np.ndim(part) else part for each, part in known.items()}


def _only_roots(guard, root, known):
    """Whether a guard is 0 and its root or power has a value."""
    with np.errstate(all="ignore"):
        return bool(np.all(_value(guard, known) == 0) and np.isfinite(_value(root, known)).all())


def _value(tree, known):
    return evaluate(tree, known, np.sqrt)


def _keeps_sign(guard, known, name, points):
    """Whether a tree has at each point the sign that it has at the first one, and is not 0, `(loops, points)`."""
    with np.errstate(all="ignore"):
        sign = np.sign(_value(guard, {**known, name: points})).reshape(-1, points.size)
    return (sign == sign[:, :1]) & (sign != 0) & np.isfinite(sign)


ZOOMS = 12  # towards a least size, each by ten
VANISHED = 1e-12  # of the size at the points beside it, up to which a least size is 0


def _touches_zero(guard, known, name, points):
    """Whether a tree that keeps its sign vanishes between points nevertheless, as a square does."""
    with np.errstate(all="ignore"):
        size = np.abs(_value(guard, {**known, name: points})).reshape(-1, points.size)
        loop, at = np.nonzero((size[:, 1:-1] <= size[:, :-2]) & (size[:, 1:-1] < size[:, 2:]))
        near = np.minimum(size[loop, at], size[loop, at + 2])
        low, high = points[at], points[at + 2]
        own = {each: value[loop] if np.ndim(value) else value for each, value in known.items()}
        for _ in range(ZOOMS):
            among = np.linspace(low, high, 21, axis=-1)
            size = np.abs(_value(guard, {**own, name: among}))
            best = np.clip(size.argmin(-1), 1, 19)
            low, high = (np.take_along_axis(among, best[:, None] + step, -1)[:, 0] for step in (-1, 1))
        return bool((size.min(-1, initial=np.inf) <= VANISHED * near).any())


MOST = 1000  # loops of which the range is searched, spread over all


def _different(known):
    """The different rows of the arrays among these values, as columns."""
    arrays = {name: np.asarray(value) for name, value in known.items() if np.ndim(value)}
    if not arrays:
        return known
    rows = np.unique(np.stack(list(arrays.values()), axis=1), axis=0)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST).astype(int))]
    return known | {name: rows[:, [column]] for column, name in enumerate(arrays)}


@lru_cache(maxsize=256)
def _guards_of(drawing, number):
    """The guards that read a number, as path of a key, tree, names of all numbers that it or its root reads, and that root."""
    named = [
        (key, guard, frozenset(name for name, _ in names_in(root or guard)), root) for key, guard, root in _guards(drawing)
    ]
    return tuple(each for each in named if any(name == number for name, _ in names_in(each[1])))


def _guards(drawing):
    """Yield the path of a key, a tree that must not vanish, and the root or power that it is the argument of."""
    for path, tree in drawing.trees():
        yield from ((path, *guard) for guard in singular(tree))
    for block in drawing.blocks:
        keys = dict(block.keys)
        for name in ("mass", "b", "cutoff_hz"):
            if name in keys:
                yield f"block.{block.name}.{name}", keys[name], None
        if block.type == "butterworth":
            twice = ("*", ("number", 2.0, 0), ("*", keys["cutoff_hz"], block.every, 0), 0)
            yield f"block.{block.name}.cutoff_hz", ("-", drawing.tick_hz, twice, 0), None
        if block.type == "tf":
            yield f"block.{block.name}.den", keys["den"][0], None
        if block.type == "local_model":
            yield f"block.{block.name}.K", block.divisor(drawing.tick_hz), None
