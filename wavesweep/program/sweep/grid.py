"""The grid of a sweep: the product of its axes, and its loops in groups of one structure."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from wavesweep.engine.drawing import Drawing
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct
from wavesweep.haptics.controller_page import keys_of_page, loop_drawing
from wavesweep.program.spec import Axis, Spec

FAST = "rates.fast_hz"
Group = tuple[np.ndarray, Loops]  # members, and these as loops of one drawing
Changes = Mapping[str, np.ndarray]  # path -> value of each loop
# loops whose numbers are checked before anything is computed; those of more are checked chunk by
# chunk
CHECKED = 100_000
MOST_GRID_ROWS = 1_000_000_000  # combinations, or rows: months of work, and hundreds of gigabytes


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """The combinations of `axes` in their order, the first slowest.

    A combination is a loop, its values on the axes `loop_axes`. The loop reads no other axis, so
    combinations that differ only in the others are the same loop, one slice of the sweep. Along
    `plain` ones floats of one drawing vary; for each combination of the others the spec is resolved
    anew, once, and `resolved` has its values.
    """

    spec: Spec
    axes: tuple[Axis, ...]
    loop_axes: tuple[Axis, ...]
    plain: frozenset[str]  # paths of axes
    size: int  # number of combinations
    loops: int  # number of loops, all of which are computed
    arrays: Mapping[str, np.ndarray] = field(repr=False)  # path of each axis -> its values
    resolved: dict = field(repr=False, default_factory=dict)

    @property
    def ignored(self) -> tuple[Axis, ...]:
        """Axes that the controller does not read."""
        return tuple(axis for axis in self.axes if axis not in self.loop_axes)

    def loop_values(self, index) -> dict[str, np.ndarray]:
        """Path -> values of the loops `index` (flat, in the order of the loop axes)."""
        digits = _digits(self.loop_axes, index)
        return {
            axis.path: self.arrays[axis.path][digit]
            for axis, digit in zip(self.loop_axes, digits, strict=True)
        }

    @property
    def checked(self) -> Sequence[int]:
        """The numbers of all loops or, if they are very many, of CHECKED ones from the first to the
        last."""
        if self.loops <= CHECKED:
            return range(self.loops)
        return np.unique(np.linspace(0, self.loops - 1, CHECKED).astype(int))

    def drawn(self, along: str = "", numbers: Sequence[int] | None = None) -> tuple[Group, ...]:
        """Loops of the grid by their numbers, by default the `checked` ones, in groups of one
        drawing, whose members count from 0 in `numbers`; along: see `drawn_groups`."""
        wanted = self.checked if numbers is None else numbers
        return tuple(_drawn(self.spec, self.groups(wanted), along))

    def groups(self, numbers: Sequence[int]) -> Iterator[tuple[np.ndarray, dict]]:
        """Yield (members, values) of loops of the grid: those of `drawn_groups` as flat values, with
        arrays for those in which they differ."""
        return _alike(self.spec, self.loop_values(numbers), len(numbers), self.plain, self.resolved)

    def resolve_all(self, table: str = "sweep") -> None:
        """Resolve the spec for every combination of the axes for which that is done anew.

        Errors: UsageError if a combination, or numbers of one of the `checked` loops, make no loop.
        """
        axes = [axis for axis in self.loop_axes if axis.path not in self.plain]
        for values in product(*(axis.values for axis in axes)):
            changes = {axis.path: value for axis, value in zip(axes, values, strict=True)}
            try:
                _resolve(self.spec, changes, self.resolved)
            except SpecError as error:
                named = ", ".join(
                    f"{axis.name} = {value!r}" for axis, value in zip(axes, values, strict=True)
                )
                raise UsageError(
                    f"[{table}]: every combination is computed, and {named} makes no loop: {error}"
                ) from error
        for _, values in self.groups(self.checked) if self.spec.drawing else ():
            try:
                Loops(self.spec.drawing, values).refuse_unsuitable()
            except UsageError as error:
                # The place of the axis, if there is only one.
                place = self.loop_axes[0].place.location() if len(self.loop_axes) == 1 else ""
                raise UsageError(f"{place}: {error}" if place else str(error)) from error

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


def make_grid(
    spec: Spec,
    axes,
    along: str | None = None,
    read=None,
    *,
    apart: bool = True,
    rates: bool = True,
) -> Grid:
    """The grid of the axes; `along` (a path) is the axis that intervals lie on, not among `axes`.

    read: the keys that the controller reads, if they are known already. apart: whether slices
    follow each other as their combinations do; if not, those of one drawing follow each other.
    rates: see `drawn_groups`.
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
    plain = plain_paths(spec, [axis.path for axis in used], rates=rates)
    anew = [axis for axis in used if axis.path not in plain]
    # Each combination that the loop is drawn anew for is
    # checked before the work begins
    _refuse_too_many("combinations of the axes that the loop is drawn anew for", anew, 10_000)
    loop = tuple(used if apart else sorted(used, key=lambda axis: axis.path in plain))
    arrays = {axis.path: np.asarray(axis.values) for axis in axes}
    return Grid(spec, tuple(axes), loop, plain, _count(axes), _count(loop), arrays)


def refuse_rows(table: str, rows: int) -> None:
    """Raise UsageError if a table would have too many rows."""
    if rows > MOST_GRID_ROWS:
        raise UsageError(
            f"{table}: expected at most {MOST_GRID_ROWS} rows, found {rows:.3g}; compute fewer values at a time"
        )


def _refuse_too_many(counted, axes, limit):
    if _count(axes) > limit:
        product = " x ".join(f"{axis.name}[{len(axis.values)}]" for axis in axes)
        raise UsageError(
            f"expected at most {limit} {counted}, found {product} = {_count(axes):.3g}; sweep fewer values at a time"
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


def drawn_groups(
    spec: Spec, changes: Changes, size: int, *, rates: bool = False, along: str = ""
) -> Iterator[Group]:
    """Yield (members, loops): indices into the `size` loops, and these in one drawing with all
    numbers of the spec.

    Loops of one group differ in floats only. If such a float is zero in one of them, it is zero in
    all, since a zero may take a branch out of the drawing. Whole numbers and keys that others
    derive from go through the spec, once per distinct combination. rates: whether the loops of a
    group may have different fast rates. along: path of a number that is varied in every loop in
    addition to the changes, as that of an axis of intervals.
    """
    plain = plain_paths(spec, changes, rates=rates)
    return _drawn(spec, _alike(spec, changes, size, plain, {}), along)


def _alike(spec, changes, size, plain, resolved):
    """Yield the groups of loops; plain: paths of the floats that may differ in a group. resolved:
    the spec's values by what goes through the spec, which is filled."""
    through_spec = {path: column for path, column in changes.items() if path not in plain}
    varied = {path: column for path, column in changes.items() if path in plain}
    for members in distinct(list(through_spec.values()), size):
        first = {path: column[members[0]].item() for path, column in through_spec.items()}
        settled = _resolve(spec, first, resolved)
        zeros = [column[members] == 0 for column in varied.values()]
        for alike in distinct(zeros, members.size):
            index = members[alike]
            yield index, {**settled, **{path: column[index] for path, column in varied.items()}}


def _resolve(spec, changes, resolved):
    """The values of the spec with changes that go through it; resolved: those that are known."""
    key = tuple(changes.items())
    if key not in resolved:
        resolved[key] = dict((spec.with_values(changes) if changes else spec).values)
    return resolved[key]


def _drawn(spec, groups, along):
    for members, values in groups:
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


def frames_per_clock(drawing: Drawing | None, loops: Loops) -> float:
    """How many frames of the loops take the time of the spec's clock: T_s of a controller, a tick
    of a drawn loop.

    A frame is several clocks where rates do not divide, or blocks of a drawn loop run every few
    ticks, and a part of one of a controller of which nothing runs at the slow rate. What is
    required per clock means the same whatever else runs. drawing: of a drawn loop as the spec has it.
    loops: with all numbers of the spec.
    """
    if drawing:
        return 1 / Loops(drawing, loops.values).drawn().ticks
    return loops.values["rates.ratio"] / loops.drawn().ticks


def plain_paths(spec: Spec, changes: Iterable[str], *, rates: bool) -> frozenset[str]:
    """Those of the changed paths along which floats of one drawing vary; rates: see `drawn_groups`."""
    return frozenset(path for path in changes if is_plain(spec, path, changes if rates else None))


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
