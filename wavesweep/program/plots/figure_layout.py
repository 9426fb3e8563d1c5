"""The roles of a table's axes in the figure of its intervals, and a note on the values that are
not shown."""

from collections.abc import Collection, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np

from wavesweep.program.columns import FELT_ALIKE, Columns, whose_column
from wavesweep.program.row_kinds import COMPUTED, row_kinds

# What a person can still read in one figure.
MOST_MEMBERS = 8
MOST_PANELS = 6
MOST_POINTS = 400  # along the figure: more than that is finer than its pixels


@dataclass(frozen=True)
class Layout:
    """The roles of a table's axes.

    x        the axis along the figure; None if no axis is long enough, so that bars are drawn
    points   the values of x that are drawn
    panels   the axis with a panel for each value, None if there is one panel; `panel_values` those drawn
    family   the axis whose values are lines (or bars) of one panel, None if there are none; `members` those drawn
    beside   further axes and their values, if each combination of them and the family is a bar
    fixed    the value at which each remaining axis is held
    left_out note on the values that the figure does not show; empty if it shows all of them
    """

    x: str | None
    points: tuple[float, ...]
    panels: str | None
    panel_values: tuple[float, ...]
    family: str | None
    members: tuple[float, ...]
    beside: Mapping[str, tuple[float, ...]]
    fixed: Mapping[str, float]
    left_out: str

    @property
    def bars(self) -> list[dict[str, float]]:
        """The values of the axes of each bar, or of each line of a family."""
        axes = dict(self.beside)
        if self.family:
            axes = {self.family: self.members, **axes}
        return [dict(zip(axes, values, strict=True)) for values in product(*axes.values())]

    def shows(self, columns: Columns) -> np.ndarray:
        """Flags of the rows that the figure shows."""
        wanted: dict[str, Sequence[float]] = {axis: (value,) for axis, value in self.fixed.items()}
        if self.x is not None:
            wanted[self.x] = self.points
        if self.panels is not None:
            wanted[self.panels] = self.panel_values
        if self.family is not None:
            wanted[self.family] = self.members
        return having(columns, wanted)


def having(columns: Columns, wanted: Mapping[str, Sequence[float]]) -> np.ndarray:
    """Flags of the rows with these values of the axes, or whose loop does not read an axis
    (NaN)."""
    flags = np.ones(len(next(iter(columns.values()))), bool)
    for axis, values in wanted.items():
        flags &= np.isin(columns[axis], values) | np.isnan(columns[axis])
    return flags


def where(columns: Columns, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Some of the rows, by flags or numbers."""
    return {name: column[rows] for name, column in columns.items()}


def rows_with(columns: Columns, values: Mapping[str, float]) -> dict[str, np.ndarray]:
    """The rows with one value of each of these axes."""
    return where(columns, having(columns, {axis: (value,) for axis, value in values.items()}))


def lay_out(
    axes: Mapping[str, Sequence[float]],
    best: Mapping[str, float],
    hands: bool = False,
    smooth: Collection[str] = (),
    dampings: Sequence[str] = (),
) -> Layout:
    """Give the axes (name -> values) their roles: along the figure (B_VE or K_VE if possible), a
    family of lines, panels.

    The family is the first axis that fits into one panel, or the first of all. best: the values of
    the best design, which the figure always shows. hands: the members are hands or specs, so no
    axis is a family. smooth: axes along which further columns can be computed; a single one of
    these is along the figure however few values it has. dampings: the names of the damping of walls
    in drawn loops.
    """
    several = {
        name: tuple(sorted(set(values))) for name, values in axes.items() if len(set(values)) > 1
    }
    x = along_the_figure(several, dampings)
    family = None
    if not hands:
        x = x or _single_smooth(several, smooth)
        family = _family_of(several, x)
    others = [name for name in several if name not in (x, family)]
    panels = others[0] if others else None
    held = others[1:]
    points = evenly(several, x, MOST_POINTS, best)
    panel_values = evenly(several, panels, MOST_PANELS, best)
    members = evenly(several, family, MOST_MEMBERS, best)
    beside = {name: several[name] for name in held}
    combinations = len(members) * prod(map(len, beside.values()))
    # Combinations of several axes, as bars of one panel.
    if x is not None or hands or combinations > 16:
        beside = {}
    fixed = {}
    for name in held:
        if name not in beside:
            middle = several[name][len(several[name]) // 2]
            fixed[name] = best.get(name, middle)
    roles = [(x, points), (panels, panel_values), (family, members)]
    drawn = [(name, values, several[name]) for name, values in roles if name]
    drawn += [(name, (value,), several[name]) for name, value in fixed.items()]
    left_out = what_is_shown(drawn)
    return Layout(x, points, panels, panel_values, family, members, beside, fixed, left_out)


def _single_smooth(several: Mapping[str, Sequence[float]], smooth: Collection[str]) -> str | None:
    """The single axis, if further columns can be computed along it and it has more than a pair
    of values."""
    if len(several) != 1:
        return None
    (name,) = several
    if name in smooth and len(several[name]) > 2:  # two values are compared and not joined
        return name
    return None


def _family_of(several: Mapping[str, Sequence[float]], x: str | None) -> str | None:
    """The first axis beside x that fits into one panel, or the first of all."""
    rest = [name for name in several if name != x]
    fitting = [name for name in rest if len(several[name]) <= MOST_MEMBERS]
    return next(iter([*fitting, *rest]), None)


def what_is_shown(axes: Iterable[tuple[str, Sequence[float], Sized]]) -> str:
    """A sentence on axes some values of which are not shown, empty without any.

    axes: name, values that are shown, and all.
    """
    sentences: dict[str, None] = {}
    for name, shown, every in axes:
        if len(shown) == len(every):
            continue
        if len(shown) == 1:
            sentences[f"{name} at {shown[0]:g} alone, of {len(every)} values"] = None
        else:
            sentences[f"{len(shown)} of {len(every)} values of {name}"] = None
    if sentences:
        return f"Shown: {'; '.join(sentences)}."
    return ""


def along_the_figure(
    several: Mapping[str, Sequence[float]], dampings: Sequence[str] = ()
) -> str | None:
    """Return the axis along the figure, one of the wall's if possible; None if all axes are short.

    dampings: of drawn walls.
    """
    for wall in ("B_VE", "K_VE", *dampings):
        if wall in several:
            return wall
    # A handful of values makes bars; a line needs more of them.
    longest = max(several, key=lambda name: len(several[name]), default=None)
    if longest is not None and len(several[longest]) > MOST_MEMBERS:
        return longest
    return None


def evenly(
    several: Mapping[str, Sequence[float]],
    name: str | None,
    most: int,
    through: Mapping[str, float] | None = None,
) -> tuple[float, ...]:
    """Return up to `most` values of an axis, about equally spaced in its list.

    Both ends are among them, and the value in `through`.
    """
    if name is None:
        return ()
    values = np.asarray(several[name])
    if len(values) <= most:
        return tuple(values.tolist())
    chosen = np.linspace(0, len(values) - 1, most).round().astype(int)
    if through and name in through:
        at = int(np.argmin(np.abs(values - through[name])))
        if at not in (0, len(values) - 1):
            inner = np.arange(1, most - 1)
            chosen[inner[np.argmin(np.abs(chosen[inner] - at))]] = at
    return tuple(values[chosen].tolist())


def best_row(columns: Columns) -> dict[str, Any]:
    """The row with the largest stable value or, of walls, with the largest stiffness felt.

    Empty if none is stable. If there are any, rows of what is promised, for all numbers or for
    hands, come first, then certified ones, then those with a known stiffness felt. Besides its
    columns it has `value`, the end of the interval that is the best one, `merit`, by which it is,
    and `largest`, the largest high end of the rows that are promised and certified alike.
    """
    rows = columns["intervals"] > 0
    if not rows.any():
        return {}
    merit = columns["high"]
    value = columns["high"]
    is_known = np.ones(rows.size, bool)
    if "felt_high" in columns and str(columns["along"][0]) == "K_VE":
        low = columns["felt_low"]
        high = columns["felt_high"]
        is_known = ~np.isnan(high)
        falls = low > high + FELT_ALIKE * np.abs(high)
        merit = np.where(is_known, np.where(falls, low, high), merit)
        value = np.where(is_known & falls, columns["low"], value)
    promise = _promise(columns)
    ranks = (promise, columns["certified"], is_known)
    rows &= promise == promise[rows].max()
    rows &= columns["certified"] == columns["certified"][rows].max()
    largest = columns["high"][rows].max()
    rows &= is_known == is_known[rows].max()
    merit = np.where(rows, merit, -np.inf)
    most = merit.max()
    alike = merit >= most - FELT_ALIKE * abs(most)  # but for rounding
    row = int(np.argmax(alike))
    best = {name: column[row] for name, column in columns.items()}
    best["value"] = value[row]
    best["merit"] = merit[row]
    best["largest"] = largest
    best["rank"] = tuple(int(rank[row]) for rank in ranks)
    return best


def _promise(columns: Columns) -> np.ndarray:
    """How much each row promises, by its kind: the more, the earlier its kind is listed; 0 of
    what is only computed."""
    whose = whose_column(columns)
    if whose not in ("guarantee", "hand"):
        return np.zeros(len(columns["intervals"]), int)
    kinds = list(row_kinds())
    ranks = {word: len(kinds) - kinds.index(word) for word in kinds if word not in COMPUTED}
    return np.array([ranks.get(word, 0) for word in columns[whose].tolist()])


def best_of(rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The best of the best rows of some blocks, the first of those that are alike but for
    rounding."""
    candidates = [row for row in rows if row]
    if not candidates:
        return {}
    first = max(row["rank"] for row in candidates)
    largest = max(row["largest"] for row in candidates if row["rank"][:2] == first[:2])
    candidates = [row for row in candidates if row["rank"] == first]
    most = max(row["merit"] for row in candidates)
    alike = [row for row in candidates if row["merit"] >= most - FELT_ALIKE * abs(most)]
    return {**alike[0], "largest": largest}
