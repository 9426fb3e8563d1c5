"""The rows of a table that its figure shows: all rows of a short table, those at some values of
its axes of a long one."""

from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import accumulate
from math import ceil

import numpy as np

from wavesweep.program.columns import Columns, axes_of, joined
from wavesweep.program.plots.figure_layout import (
    MOST_MEMBERS,
    MOST_POINTS,
    along_the_figure,
    evenly,
    having,
    what_is_shown,
    where,
)

MOST_CURVES = 200  # curves of all specs together: more of them are an area
MOST_PLACES = 2000  # along a curve: more are finer than the pixels
Blocks = Callable[[], Iterable[Columns]]
"""Gives the blocks of a table that need not fit into memory, as often as it is called."""
Values = dict[str, np.ndarray]


def blocks_of(table: Columns | Blocks) -> Blocks:
    """The blocks of a table, which may be its columns."""
    if callable(table):
        return table
    return lambda: (table,)


def rows_where(blocks: Blocks, shown: Callable[[Columns], np.ndarray]) -> Columns:
    """The rows for which `shown` gives true."""
    return joined(where(block, shown(block)) for block in blocks())


def note_values(values: Values, columns: Columns, end: str, *more: str) -> None:
    """Add the values of the axes, which are the columns before `end`, to those of the blocks
    before, each once."""
    for name in (*axes_of(columns, end), *more):
        here = np.unique(columns[name])
        before = values.get(name, here[:0])
        values[name] = np.unique(np.concatenate([before, here]))


def shown_curves(table: Columns | Blocks) -> tuple[Columns, str]:
    """The rows of a table of responses that are shown, and a sentence about the values that are
    not, empty if all are.

    Up to MOST_CURVES curves, of some values of each axis, and up to MOST_PLACES along each.
    """
    blocks = blocks_of(table)
    values: dict[str, Values] = {}  # spec -> axis -> its values
    for block in blocks():
        for spec in dict.fromkeys(block["spec"].tolist()):
            rows = where(block, block["spec"] == spec)
            note_values(values.setdefault(spec, {}), rows, "spec", "frequency_hz")
    longest_axis = _longest(values.values())
    per_axis = max(1, MOST_CURVES // len(values))
    wanted = {spec: _few(axes, longest_axis, per_axis) for spec, axes in values.items()}

    def shown(columns: Columns) -> np.ndarray:
        flags = np.zeros(len(columns["spec"]), bool)
        for spec, axes in wanted.items():
            flags |= having(columns, axes) & (columns["spec"] == spec)
        return flags

    cut = []
    for spec, axes in wanted.items():
        cut += [(name, few, values[spec][name]) for name, few in axes.items()]
    return rows_where(blocks, shown), what_is_shown(cut)


def _longest(values_of_specs: Collection[Values]) -> str:
    """The axis along the figure: the frequency or, if there is a single one, the axis with most
    values."""
    frequencies = np.unique(np.concatenate([axes["frequency_hz"] for axes in values_of_specs]))
    names = [name for name in next(iter(values_of_specs)) if name != "frequency_hz"]
    if frequencies.size > 1 or not names:
        return "frequency_hz"

    def length(name: str) -> int:
        every = np.unique(np.concatenate([axes[name] for axes in values_of_specs]))
        return int(np.sum(~np.isnan(every)))

    return max(names, key=length)


def _few(values: Values, longest_axis: str, most_combinations: int) -> dict[str, tuple[float, ...]]:
    """The values that are shown of each axis with too many: `most_combinations` combinations, in equal shares
    of the axes."""
    few = {}
    combinations_left = most_combinations
    other_axes = sorted(
        (name for name in values if name != longest_axis), key=lambda name: len(values[name])
    )
    for number, name in enumerate(other_axes):
        share = max(1, int(combinations_left ** (1 / (len(other_axes) - number)) + 1e-9))
        if len(values[name]) > share:
            few[name] = evenly(values, name, share)
        combinations_left = max(1, combinations_left // min(len(values[name]), share))
    if len(values[longest_axis]) > MOST_PLACES:
        few[longest_axis] = evenly(values, longest_axis, MOST_PLACES)
    return few


def shown_loops(table: Columns | Blocks) -> tuple[Columns, Mapping[str, tuple[float, ...]], str]:
    """The rows of a `passivity` table that are shown, the roles of its axes, and a sentence about
    the rows that are not.

    The roles are the axis along the figure, the family of lines, and the axes that are held, with
    their values that are shown. They are empty if all axes are short: then each combination is a
    dot.
    """
    blocks = blocks_of(table)
    values: Values = {}
    sizes = []
    for block in blocks():
        note_values(values, block, "channel_norm")
        sizes.append(len(block["channel_norm"]))
    several = {name: tuple(array.tolist()) for name, array in values.items() if len(array) > 1}
    x = along_the_figure(several)
    if (
        x is None
    ):  # axes that have one value, or that are not read, repeat nothing here: a row is a dot
        rows = sum(sizes)
        dots = np.linspace(0, rows - 1, min(rows, 2 * MOST_MEMBERS)).round().astype(int)
        starts = accumulate(sizes, initial=0)

        def is_dot(block: Columns) -> np.ndarray:
            return np.isin(next(starts) + np.arange(len(block["channel_norm"])), dots)

        said = f"Shown: {dots.size} of {rows} combinations." if dots.size < rows else ""
        return rows_where(blocks, is_dot), {}, said
    roles = {x: evenly(several, x, MOST_POINTS)}
    other_axes = [name for name in several if name != x]
    for family in other_axes[:1]:
        roles[family] = evenly(several, family, MOST_MEMBERS)
    for held_axis in other_axes[1:]:
        roles[held_axis] = (several[held_axis][len(several[held_axis]) // 2],)
    said = what_is_shown((name, few, several[name]) for name, few in roles.items())
    return rows_where(blocks, lambda block: having(block, roles)), roles, said


def extremes(
    times: np.ndarray, values: np.ndarray, most_points: int = MOST_PLACES
) -> tuple[np.ndarray, np.ndarray]:
    """Keep the least and the largest value of each of many short stretches, in their order,
    which look the same."""
    size = ceil(len(values) / (most_points // 2))
    if size <= 2:
        return times, values
    complete = len(values) // size * size
    stretches = values[:complete].reshape(-1, size)
    ends = np.stack([stretches.argmin(axis=1), stretches.argmax(axis=1)], axis=1)
    starts = size * np.arange(len(stretches))
    places = (starts[:, None] + np.sort(ends, axis=1)).ravel()
    places = np.append(places, np.arange(complete, len(values)))
    return times[places], values[places]
