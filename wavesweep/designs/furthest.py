"""The end of a search for the largest or the smallest number of a design.

A population leaves its best design where the last generation happened to be. From there all numbers
go on in steps, each of which makes the wanted one better, until none of a share SHORTEST of the
ranges is met. Then all values of that number are known at once, from the certified intervals in
which every wish is required, of every combination that a design has to hold for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.designs.family import Scenario, points_of
from wavesweep.designs.wish_keys import Wish
from wavesweep.designs.wishes import walls_of
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.interval_jobs import at_points
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.tables import TableValue, nested
from wavesweep.program.spec import Spec, load

LONGEST = 0.25  # of a range: the first step
SHORTEST = 2.0**-9  # of a range: the last
CLEARER = 1.05  # how much larger a margin has to be for a step that leaves the number as it is
# shares of an end by which a design lies inside it, the first that meets its wishes as they are measured
INSIDE = (1e-9, 1e-6, 1e-4, 1e-3, 1e-2)


def wanted_number(spec: Spec) -> tuple[Wish, int] | None:
    """The wish for a number that alone has no bound, and the index of that number among those that
    vary; None if another quantity or several have none."""
    free = [wish for wish in spec.design.wishes if wish.bound is None]
    if len(free) != 1 or "number" not in free[0].options:
        return None
    names = [axis.name for axis in spec.design.vary]
    return free[0], names.index(free[0].options["number"])


def _moves(axes: int, number: int, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """Moves of genes, `(moves, axes)`: those that make a number better, alone first, then with another one
    up or down, as far or a sixteenth as far; and those of another one alone."""
    other_axes = np.delete(np.eye(axes), number, axis=0)
    aside = np.concatenate([other_axes, -other_axes])
    ahead = np.concatenate([np.zeros((1, axes)), aside, aside])
    ahead[:, number] = sign
    ahead[axes * 2 - 1 :, number] /= 16  # beside a limit that rises slowly with another number
    return ahead, aside


def climbed(
    spec: Spec,
    judge: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    genes: np.ndarray,
) -> np.ndarray:
    """The genes `(axes,)` of a design with a better number than one that meets all wishes.

    judge: genes `(designs, axes)` to whether each design meets its wishes, and its smallest margin,
    both `(designs,)`. A step makes the number better, and moves at most one of the others; of those
    that meet all wishes the one with the largest margin is taken, and the next step is twice as
    long. If none does, the next is half as long.
    """
    wish, number = wanted_number(spec)
    whole = np.array([1 / len(axis.values) if axis.values else 0.0 for axis in spec.design.vary])
    ahead, aside = _moves(len(whole), number, 1.0 if wish.kind.more else -1.0)
    moves = np.concatenate([ahead, aside])
    length = LONGEST
    clear = 0.0
    while length >= SHORTEST:
        trials = np.clip(genes + moves * np.maximum(length, whole), 0.0, 1.0)
        if trials[0, number] == genes[number]:
            break
        meets, margin = judge(trials)
        margin = np.where(meets, margin, -np.inf)
        best = int(np.argmax(margin[: len(ahead)]))
        longer = meets[best]
        if not longer:
            best = int(np.argmax(margin))
        if longer or margin[best] > CLEARER * clear:
            genes = trials[best]
            clear = margin[best]
        else:
            length /= 2
        if longer:
            length = min(2 * length, LONGEST)
    return genes


def furthest(
    spec: Spec, design: Mapping[str, float], scenarios: Sequence[Scenario]
) -> list[dict[str, float]]:
    """The wanted number by its path at or just inside the last value with which a design meets all
    wishes in all scenarios, the best first; design: its numbers by path.

    Errors: WavesweepError if a wish cannot be required along the number.
    """
    wish, number = wanted_number(spec)
    axis = spec.design.vary[number]
    if axis.values:
        return [{axis.path: float(value)} for value in axis.values]
    here = design[axis.path]
    axis = replace(axis, start=here) if wish.kind.more else replace(axis, stop=here)
    if axis.start == axis.stop:
        return []
    fixed_numbers = {path: np.array([value]) for path, value in design.items() if path != axis.path}
    intervals: list[np.ndarray] = []
    for walls, require in _required(spec, axis):
        points = points_of({axis.path: np.array([here]), **fixed_numbers}, scenarios, walls)
        rows = at_points(spec, axis, points.changes, require, felt=False)
        for point in range(points.size):
            of_point = (rows["slice"] == point) & (rows["intervals"] > 0)
            intervals.append(np.stack([rows["low"][of_point], rows["high"][of_point]]))
    towards = 1.0 if wish.kind.more else -1.0
    ends = np.concatenate(intervals, axis=1)[1 if wish.kind.more else 0]
    for end in sorted(ends.tolist(), reverse=wish.kind.more):
        if all(((low <= end) & (end <= high)).any() for low, high in intervals):
            inside = end - towards * np.array(INSIDE) * abs(end)
            return [{axis.path: value} for value in inside.tolist()]
    return []


def _required(spec: Spec, axis: Axis) -> list[tuple[dict[str, Any], TableValue | None]]:
    """What [sweep] requires for all wishes with a bound, each with the walls that it is about."""
    tables = replace(spec, parts=frozenset()).tables()
    tables["sweep"] = {"along": axis.name, axis.name: {"start": axis.start, "stop": axis.stop}}
    required: list[tuple[dict[str, Any], TableValue | None]] = []
    for wish in spec.design.wishes:
        if wish.bound is None or "number" in wish.options:
            required.append((walls_of(spec, wish), None))
            continue
        tables["sweep"]["require"] = nested(_as_required(wish))
        required.append((walls_of(spec, wish), load(tables).require))
    return required


def _as_required(wish: Wish) -> dict[str, Any]:
    """A wish with a bound by the keys of [sweep] require. Errors: UsageError if it has none."""
    options = {name: wish.options[name] for name in wish.kind.own_options if name in wish.options}
    if "cut" in options:
        return {"margins": {**options, wish.word: wish.bound}}
    if "from" in options:
        inside = {**options, wish.kind.bound: wish.bound}
        return {f"{wish.word}.{name}": value for name, value in inside.items()}
    if wish.kind.measure or wish.kind.ports != ():
        raise UsageError(f"{wish.name} cannot be required along a number")
    return {wish.word: wish.bound, **options}
