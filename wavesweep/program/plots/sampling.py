"""The rows of a table that its figure shows: all rows of a short table, those at some values of its axes of a long one."""

from collections.abc import Callable, Iterable, Mapping
from itertools import accumulate

import numpy as np

from wavesweep.program.columns import Columns, axes_of, joined
from wavesweep.program.plots.figure_layout import (
    MOST_BARS,
    MOST_MEMBERS,
    MOST_POINTS,
    along_the_figure,
    evenly,
    having,
    what_is_shown,
    where,
)

MOST_DRAWN = 200  # curves of all specs together: more of them are an area
MOST_PLACES = 2000  # along a curve: more are finer than the pixels
Blocks = Callable[[], Iterable[Columns]]
"""Gives the blocks of a table that need not fit into memory, as often as it is called."""
Values = dict[str, np.ndarray]


def blocks_of(table: Columns | Blocks) -> Blocks:
    """The blocks of a table, which may be its columns."""
    return table if callable(table) else lambda: (table,)


def rows_where(blocks: Blocks, shown: Callable[[Columns], np.ndarray]) -> Columns:
    """The rows for which `shown` gives true."""
    return joined(where(block, shown(block)) for block in blocks())


def note_values(values: Values, columns: Columns, end: str, *more: str) -> None:
    """Add the values of the axes, which are the columns before `end`, to those of the blocks before, each once."""
    for name in (*axes_of(columns, end), *more):
        values[name] = np.unique(np.concatenate([values.get(name, columns[name][:0]), np.unique(columns[name])]))


def shown_curves(table: Columns | Blocks) -> tuple[Columns, str]:
    """The rows of a table of responses that are shown, and a sentence about the values that are not, empty if all are.

    Up to MOST_DRAWN curves, of some values of each axis, and up to MOST_PLACES along each.
    """
    blocks, values = blocks_of(table), {}
    for block in blocks():
        for spec in dict.fromkeys(block["spec"].tolist()):
            note_values(values.setdefault(spec, {}), where(block, block["spec"] == spec), "spec", "frequency_hz")
    first = next(iter(values.values()))
    every = {name: np.unique(np.concatenate([axes[name] for axes in values.values()])) for name in first}
    along = "frequency_hz"
    if every.pop(along).size == 1 and every:  # then the axis with most values
        along = max(every, key=lambda name: np.sum(~np.isnan(every[name])))
    wanted = {spec: _few(axes, along, max(1, MOST_DRAWN // len(values))) for spec, axes in values.items()}

    def shown(columns: Columns) -> np.ndarray:
        return np.any([having(columns, axes) & (columns["spec"] == spec) for spec, axes in wanted.items()], axis=0)

    cut = ((name, few, values[spec][name]) for spec, axes in wanted.items() for name, few in axes.items())
    return rows_where(blocks, shown), what_is_shown(cut)


def _few(values: Values, along: str, most: int) -> dict[str, tuple[float, ...]]:
    """The values that are shown of each axis with too many: `most` combinations, in equal shares of the axes."""
    few, left = {}, most
    other_axes = sorted((name for name in values if name != along), key=lambda name: len(values[name]))
    for number, name in enumerate(other_axes):
        share = max(1, int(left ** (1 / (len(other_axes) - number)) + 1e-9))
        if len(values[name]) > share:
            few[name] = evenly(values, name, share)
        left = max(1, left // min(len(values[name]), share))
    return few | ({along: evenly(values, along, MOST_PLACES)} if len(values[along]) > MOST_PLACES else {})


def shown_loops(table: Columns | Blocks) -> tuple[Columns, Mapping[str, tuple[float, ...]], str]:
    """The rows of a `passivity` table that are shown, the roles of its axes, and a sentence about the rows that are not.

    The roles are the axis along the figure, the family of lines, and the axes that are held, with their values that are shown.
    They are empty if all axes are short: then each combination is a dot.
    """
    blocks, values = blocks_of(table), {}
    sizes = []
    for block in blocks():
        note_values(values, block, "channel_norm")
        sizes.append(len(block["channel_norm"]))
    several = {name: tuple(array.tolist()) for name, array in values.items() if len(array) > 1}
    x = along_the_figure(several)
    if x is None:  # axes that have one value, or that are not read, repeat nothing here: a row is a dot
        rows, before = sum(sizes), accumulate(sizes, initial=0)
        dots = np.linspace(0, rows - 1, min(rows, 2 * MOST_BARS)).round().astype(int)
        columns = rows_where(blocks, lambda block: np.isin(next(before) + np.arange(len(block["channel_norm"])), dots))
        return columns, {}, f"Shown: {dots.size} of {rows} combinations." if dots.size < rows else ""
    family, *held = [*(name for name in several if name != x), None]
    middle = {name: (several[name][len(several[name]) // 2],) for name in held if name}
    lines = {family: evenly(several, family, MOST_MEMBERS)} if family else {}
    roles = {x: evenly(several, x, MOST_POINTS)} | lines | middle
    said = what_is_shown((name, few, several[name]) for name, few in roles.items())
    return rows_where(blocks, lambda block: having(block, roles)), roles, said


POINTS_OF_A_LINE = 1600  # more than it has pixels along


def extremes(times: np.ndarray, values: np.ndarray, most: int = POINTS_OF_A_LINE) -> tuple[np.ndarray, np.ndarray]:
    """Keep the least and the largest value of each of many short stretches, in their order, which look the same."""
    size = -(-len(values) // (most // 2))
    if size <= 2:
        return times, values
    complete = len(values) // size * size
    blocks = values[:complete].reshape(-1, size)
    ends = np.sort(np.stack([blocks.argmin(axis=1), blocks.argmax(axis=1)], axis=1), axis=1)
    places = (ends + size * np.arange(len(blocks))[:, None]).ravel()
    places = np.append(places, np.arange(complete, len(values)))
    return times[places], values[places]
