"""The rows of a table that its figure shows: all rows of a short table, those at some values of its axes of a long one."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.layout import MOST_BARS, MOST_MEMBERS, MOST_POINTS, along_the_figure, evenly, having, what_is_shown, where

KEPT_ROWS = 300_000  # of a table that comes in blocks; a longer table is read a second time
MOST_DRAWN = 200  # curves of all specs together: more of them are an area
MOST_PLACES = 2000  # along a curve: more are finer than the pixels


class Kept:
    """Rows of a table that need not fit into memory: `add` each block, then take those that are shown.

    blocks: returns all blocks again, if there are too many to be kept.
    """

    def __init__(self, blocks: Callable[[], Iterable[Columns]]) -> None:
        self._blocks, self._kept, self.rows = blocks, [], 0

    def add(self, columns: Columns) -> None:
        """Keep a block if all blocks so far are few."""
        self.rows += len(next(iter(columns.values())))
        self._kept = [*self._kept, columns] if self.rows <= KEPT_ROWS else []

    def where(self, shown: Callable[[Columns, int], np.ndarray]) -> dict[str, np.ndarray]:
        """The rows for which `shown`, a function of a block and the number of rows before it, is true."""
        parts, before = [], 0
        for block in self._kept if self.rows <= KEPT_ROWS else self._blocks():
            chosen = shown(block, before)
            before += chosen.size
            parts.append(where(block, chosen))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


class Curves(Kept):
    """The rows of a `bode` table: up to MOST_DRAWN curves, of some values of each axis, and up to MOST_PLACES along each."""

    def __init__(self, blocks: Callable[[], Iterable[Columns]]) -> None:
        super().__init__(blocks)
        self._values: dict[str, dict[str, np.ndarray]] = {}  # spec -> axis or frequency_hz -> its values

    def add(self, columns: Columns) -> None:
        """Take a block."""
        super().add(columns)
        for spec in dict.fromkeys(columns["spec"].tolist()):
            rows = where(columns, columns["spec"] == spec)
            _note_values(self._values.setdefault(spec, {}), rows, "spec", "frequency_hz")

    def chosen(self) -> tuple[dict[str, np.ndarray], str]:
        """The rows that are shown, and a sentence about the values that are not, empty if all are."""
        along, most = self._along(), max(1, MOST_DRAWN // len(self._values))
        wanted = {spec: _few(values, along, most) for spec, values in self._values.items()}

        def shown(columns: Columns, _: int) -> np.ndarray:
            flags = np.zeros(len(columns["spec"]), bool)
            for spec, axes in wanted.items():
                flags |= having(columns, axes) & (columns["spec"] == spec)
            return flags

        return self.where(shown), what_is_shown(
            (name, few, self._values[spec][name]) for spec, axes in wanted.items() for name, few in axes.items()
        )

    def _along(self) -> str:
        """The axis along the curves: frequency or, if there is only one, the axis with most values."""
        names = [*next(iter(self._values.values()))]
        values = {name: np.unique(np.concatenate([axes[name] for axes in self._values.values()])) for name in names}
        if values.pop("frequency_hz").size > 1 or not values:
            return "frequency_hz"
        return max(values, key=lambda name: np.sum(~np.isnan(values[name])))


def _note_values(values: dict[str, np.ndarray], columns: Columns, end: str, *more: str) -> None:
    """Add the values of the axes, which are the columns before `end`, to those of the blocks before, each once."""
    for name in (*list(columns)[: list(columns).index(end)], *more):
        values[name] = np.unique(np.concatenate([values.get(name, columns[name][:0]), np.unique(columns[name])]))


def _few(values: Mapping[str, np.ndarray], along: str, most: int) -> dict[str, tuple[float, ...]]:
    """The values that are shown of each axis with too many: `most` combinations, in equal shares of the axes."""
    few, left = {}, most
    others = sorted((name for name in values if name != along), key=lambda name: len(values[name]))
    for number, name in enumerate(others):
        share = max(1, int(left ** (1 / (len(others) - number)) + 1e-9))
        if len(values[name]) > share:
            few[name] = evenly(values, name, share)
        left = max(1, left // min(len(values[name]), share))
    return few | ({along: evenly(values, along, MOST_PLACES)} if len(values[along]) > MOST_PLACES else {})


class Loops(Kept):
    """The rows of a `passivity` table, whose axes are those before `channel_norm`, and their roles in its figure."""

    def __init__(self, blocks: Callable[[], Iterable[Columns]]) -> None:
        super().__init__(blocks)
        self._axes: dict[str, np.ndarray] = {}

    def add(self, columns: Columns) -> None:
        """Take a block."""
        super().add(columns)
        _note_values(self._axes, columns, "channel_norm")

    @property
    def several(self) -> dict[str, tuple[float, ...]]:
        """The axes with several values."""
        return {name: tuple(values.tolist()) for name, values in self._axes.items() if len(values) > 1}

    @property
    def roles(self) -> dict[str, tuple[float, ...]]:
        """The axis along the figure, the family of lines, and the axes that are held, with their values that are shown.

        Empty if all axes are short: then each combination is a dot.
        """
        several = self.several
        x = along_the_figure(several)
        if x is None:
            return {}
        family, *held = [*(name for name in several if name != x), None]
        middle = {name: (several[name][len(several[name]) // 2],) for name in held if name}
        lines = {family: evenly(several, family, MOST_MEMBERS)} if family else {}
        return {x: evenly(several, x, MOST_POINTS)} | lines | middle

    def chosen(self) -> dict[str, np.ndarray]:
        """The rows that are shown."""
        roles = self.roles
        if roles:
            return self.where(lambda columns, _: having(columns, roles))
        # Axes that have one value, or that are not read, repeat nothing here: a row is a dot.
        dots = np.linspace(0, self.rows - 1, min(self.rows, 2 * MOST_BARS)).round().astype(int)
        return self.where(lambda columns, before: np.isin(before + np.arange(len(columns["channel_norm"])), dots))
