"""The grid of a sweep: the product of its axes, and its loops in groups of one structure."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct
from wavesweep.haptics.controller_page import keys_of_page, loop_drawing
from wavesweep.program.spec import Axis, Spec

FAST = "rates.fast_hz"
MOST_GRID_ROWS = 1_000_000_000  # combinations, or rows: months of work, and hundreds of gigabytes
# combinations of axes that the loop is drawn anew for, each of which is checked before the work
# begins
MOST_DRAWN_ANEW = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """The combinations of `axes` in their order, the first slowest.

    A combination is a loop, its values on the axes `loop_axes`. The loop reads no other axis, so
    combinations that differ only in the others are the same loop, one slice of the sweep.
    """

    spec: Spec
    axes: tuple[Axis, ...]
    loop_axes: tuple[Axis, ...]
    arrays: Mapping[str, np.ndarray] = field(repr=False)  # path of each axis -> its values

    @property
    def ignored(self) -> tuple[Axis, ...]:
        """Axes that the controller does not read."""
        return tuple(axis for axis in self.axes if axis not in self.loop_axes)

    @property
    def size(self) -> int:
        """Number of combinations."""
        return _count(self.axes)

    @property
    def loops(self) -> int:
        """Number of loops, all of which are computed."""
        return _count(self.loop_axes)

    def loop_values(self, index) -> dict[str, np.ndarray]:
        """Path -> values of the loops `index` (flat, in the order of the loop axes)."""
        digits = _digits(self.loop_axes, index)
        return {
            axis.path: self.arrays[axis.path][digit]
            for axis, digit in zip(self.loop_axes, digits, strict=True)
        }

    def slice_of(self, combination) -> np.ndarray:
        """Number of the slice of each combination (flat indices)."""
        digits = dict(
            zip((axis.path for axis in self.axes), _digits(self.axes, combination), strict=True)
        )
        if not self.loop_axes:
            return np.zeros(np.shape(combination), int)
        shape = tuple(len(axis.values) for axis in self.loop_axes)
        return np.ravel_multi_index([digits[axis.path] for axis in self.loop_axes], shape)

    def axis_columns(self, combination) -> dict[str, np.ndarray]:
        """Name -> value of each combination, the table's leading columns."""
        return {
            axis.name: self.arrays[axis.path][digit]
            for axis, digit in zip(self.axes, _digits(self.axes, combination), strict=True)
        }


def keys_of(spec: Spec) -> frozenset[str]:
    """Paths of the keys that the spec's loop reads."""
    if spec.drawing:
        return frozenset(spec.values) - spec.drawing.of_limits
    return keys_of_page(spec.values)


def make_grid(spec: Spec, axes, along: str | None = None, read=None, *, apart: bool = True) -> Grid:
    """The grid of the axes; `along` (a path) is the axis that intervals lie on, not among `axes`.

    read: the keys that the controller reads, if they are known already. apart: whether slices
    follow each other as their combinations do; if not, those of one drawing follow each other.
    """
    read = keys_of(spec) if read is None else read
    if along is not None and not _is_read(along, read):
        raise UsageError(
            f"intervals along {along}: the controller {spec.kind} does not read it, so stability "
            "cannot depend on it; sweep a key that it reads (wavesweep check names them)"
        )
    _refuse_too_many("combinations", axes, MOST_GRID_ROWS)
    # Responses and radii are those of a frame, also if no part of the controller runs at the slow
    # rate.
    used = [
        axis
        for axis in axes
        if _is_read(axis.path, read) or axis.path in ("rates.ratio", "rates.slow_hz")
    ]
    drawn = [axis for axis in used if not is_plain(spec, axis.path)]
    _refuse_too_many(
        "combinations of the axes that the loop is drawn anew for", drawn, MOST_DRAWN_ANEW
    )
    loop = tuple(used if apart else sorted(used, key=lambda axis: axis not in drawn))
    return Grid(spec, tuple(axes), loop, {axis.path: np.asarray(axis.values) for axis in axes})


def refuse_rows(table: str, rows: int) -> None:
    """Raise UsageError if a table would have too many rows."""
    if rows > MOST_GRID_ROWS:
        raise UsageError(
            f"{table}: expected at most {MOST_GRID_ROWS} rows, found {rows:.3g}; compute fewer values at a time"
        )


def _refuse_too_many(what, axes, most):
    if _count(axes) > most:
        product = " x ".join(f"{axis.name}[{len(axis.values)}]" for axis in axes)
        raise UsageError(
            f"expected at most {most} {what}, found {product} = {_count(axes):.3g}; sweep fewer values at a time"
        )


def _is_read(path, read):
    """Whether the controller reads the key, or one that is derived from it."""
    if path in read:
        return True
    if path == "rates.slow_hz":
        return "rates.ratio" in read
    return path.startswith("filters.") and f"{path.rsplit('.', 1)[0]}.order" in read


def _count(axes):
    return math.prod(len(axis.values) for axis in axes)


def _digits(axes, index):
    if axes:
        return np.unravel_index(np.asarray(index), tuple(len(axis.values) for axis in axes))
    return ()


def groups(
    spec: Spec, changes: Mapping[str, np.ndarray], size: int, resolved=None, *, rates: bool = False
) -> Iterator[tuple[np.ndarray, dict]]:
    """Yield (members, values): indices into the `size` loops, and flat values with arrays for those
    in which they differ.

    changes: path -> value per loop. Loops of one group differ in floats only. If such a float is
    zero in one of them, it is zero in all, since a zero may take a branch out of the drawing. Whole
    numbers and keys that others derive from go through the spec, once per distinct combination.
    resolved: a dict that remembers these from call to call. rates: whether the loops of a group may
    have different fast rates.
    """
    structural = {
        path: column
        for path, column in changes.items()
        if not is_plain(spec, path, changes if rates else None)
    }
    plain = {path: column for path, column in changes.items() if path not in structural}
    for members, settled in _by_structure(
        spec, structural, size, {} if resolved is None else resolved
    ):
        zeros = [column[members] == 0 for column in plain.values()]
        for alike in distinct(zeros, members.size):
            index = members[alike]
            yield index, {**settled, **{path: column[index] for path, column in plain.items()}}


def drawn_groups(
    spec: Spec,
    changes: Mapping[str, np.ndarray],
    size: int,
    resolved=None,
    *,
    rates: bool = False,
    along: str = "",
) -> Iterator[tuple[np.ndarray, Loops]]:
    """Yield (members, loops): `groups`, each as loops with all numbers of the spec.

    along: path of a number that is varied in every loop in addition to the changes, as that of an
    axis of intervals.
    """
    for members, values in groups(spec, changes, size, resolved, rates=rates):
        drawing = loops_of(spec, values, along).drawing
        yield from Loops(drawing, values).built_alike(members)


def own_loop(spec: Spec, along: str = "") -> Loops:
    """The spec's own loop, with the numbers that it reads; along: see `drawn_groups`."""
    return loops_of(spec, spec.values, along).read


def loops_of(spec: Spec, values: Mapping[str, object], along: str = "") -> Loops:
    """Loops of the spec with these flat values, in its own drawing or that of its controller;
    along: see `drawn_groups`.

    Along a number a drawing has the longest tick that the loops have in common, unless frames are
    composed of its own ticks.
    """
    if spec.drawing and along and not spec.members:
        return Loops(spec.drawing, values).in_common_tick()
    return Loops(spec.drawing or loop_drawing(values, (along,)), values)


def frames_per_clock(spec: Spec, loops: Loops) -> float:
    """How many frames of the loops take the time of the spec's clock: T_s of a controller, a tick
    of a drawn loop.

    A frame is several clocks where rates do not divide, or blocks of a drawn loop run every few
    ticks, and a part of one of a controller of which nothing runs at the slow rate. What is
    required per clock means the same whatever else runs. loops: with all numbers of the spec.
    """
    if spec.drawing:
        return 1 / Loops(spec.drawing, loops.values).drawn().ticks
    return loops.values["rates.ratio"] / loops.drawn().ticks


def is_plain(spec, path, changes: Iterable[str] | None = None) -> bool:
    """Whether the key may have an array of floats in place of its value.

    changes: all paths that have one, if the fast rate may have one too, from which nothing follows
    then.
    """
    if changes is None:
        building = spec.names.find(path).structural
    else:
        building = spec.builds(path, changes)
    return not building and isinstance(spec.values.get(path), float)


def _by_structure(spec, structural, size, resolved):
    for alike in distinct(list(structural.values()), size):
        first = {path: column[alike[0]].item() for path, column in structural.items()}
        key = tuple(first.items())
        if key not in resolved:
            resolved[key] = dict((spec.with_values(first) if first else spec).values)
        yield alike, resolved[key]
