"""The roles of a table's axes in the figure of its intervals, and a note on values that do not fit."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np

from wavesweep.stability.certificate import FELT_ALIKE

# What a person can still read in one figure.
MOST_MEMBERS = 8
MOST_PANELS = 6
MOST_BARS = 8
MOST_COMBINATIONS = 16  # of several axes, as bars of one panel
_PAIR = 2  # values, which are compared and not joined
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
        axes = ({self.family: self.members} if self.family else {}) | dict(self.beside)
        return [dict(zip(axes, values, strict=True)) for values in product(*axes.values())]

    def shows(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """Flags of the rows that the figure shows."""
        roles = ((self.x, self.points), (self.panels, self.panel_values), (self.family, self.members))
        wanted = {axis: values for axis, values in roles if axis is not None}
        wanted |= {axis: (value,) for axis, value in self.fixed.items()}
        shown = np.ones(len(columns["along"]), dtype=bool)
        for axis, values in wanted.items():
            shown &= np.isin(columns[axis], values)
        return shown


def axes_of(columns: Mapping[str, np.ndarray]) -> dict[str, tuple[float, ...]]:
    """The axes of a table and their values."""
    return {name: tuple(np.unique(columns[name]).tolist()) for name in list(columns)[: list(columns).index("along")]}


def lay_out(
    axes: Mapping[str, Sequence[float]], best: Mapping[str, float], hands: bool = False, smooth: Collection[str] = ()
) -> Layout:
    """Give the axes (name -> values) their roles: along the figure (B_VE or K_VE if possible), a family of lines, panels.

    The family is the first axis that fits into one panel, or the first of all. best: the values of the best design, which the
    figure goes through: values that are left out are chosen about it. hands: the family is that of the hands. smooth: axes
    between whose values the figure computes others; a single one of these is along the figure however few values it has.
    """
    several = {name: tuple(sorted(set(values))) for name, values in axes.items() if len(set(values)) > 1}
    x = along_the_figure(several)
    if x is None and len(several) == 1 and not hands:
        x = next((name for name in several if name in smooth and len(several[name]) > _PAIR), None)
    rest = [name for name in several if name != x]
    fitting = [name for name in rest if len(several[name]) <= MOST_MEMBERS]
    family = None if hands else next(iter([*fitting, *rest]), None)
    panels, *held = [*(name for name in rest if name != family), None]
    points = evenly(several, x, MOST_POINTS, best)
    panel_values = evenly(several, panels, MOST_PANELS, best)
    members = evenly(several, family, MOST_MEMBERS if x else MOST_BARS, best)
    beside = {name: several[name] for name in held if name}
    if x is not None or hands or len(members) * prod(map(len, beside.values())) > MOST_COMBINATIONS:
        beside = {}
    fixed = {name: best.get(name, several[name][len(several[name]) // 2]) for name in held if name and name not in beside}
    shown = ((x, points), (panels, panel_values), (family, members))
    notes = [f"{len(v)} of {len(several[n])} values of {n}" for n, v in shown if n and len(v) < len(several[n])]
    notes += [f"{name} at {value:g} alone, of {len(several[name])} values" for name, value in fixed.items()]
    said = f"Shown: {'; '.join(notes)}." if notes else ""
    return Layout(x, points, panels, panel_values, family, members, beside, fixed, said)


def along_the_figure(several: Mapping[str, Sequence[float]]) -> str | None:
    """Return the axis along the figure, one of the wall's if possible; None if all axes are short."""
    for wall in ("B_VE", "K_VE"):
        if wall in several:
            return wall
    # A handful of values makes bars; a line needs more of them.
    longest = max(several, key=lambda name: len(several[name]), default=None)
    return longest if longest is not None and len(several[longest]) > MOST_BARS else None


def evenly(
    several: Mapping[str, Sequence[float]], name: str | None, most: int, through: Mapping[str, float] | None = None
) -> tuple[float, ...]:
    """Return up to `most` values of the axis `name`, about equally spaced in its list, with both ends and that of `through`."""
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


def best_row(columns: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """The row with the largest stable value or, of walls, with the largest stiffness felt; empty if none is stable."""
    rows = columns["intervals"] > 0
    merit, known = _merit(columns)
    for better in (columns["certified"], known):
        rows = rows & better if (rows & better).any() else rows
    if not rows.any():
        return {}
    merit = np.where(rows, merit, -np.inf)
    most = merit.max()
    row = int(np.argmax(merit >= most - FELT_ALIKE * abs(most)))  # the first of those that are alike but for rounding
    return {name: column[row] for name, column in columns.items()} | {"merit": merit[row], "known": known[row]}


def _merit(columns: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The stiffness felt at the high end of a wall, or the high end itself, and whether it is known."""
    felt = columns.get("felt_high")
    if felt is None or str(columns["along"][0]) != "K_VE":
        return columns["high"], np.ones(len(columns["high"]), bool)
    return np.where(np.isnan(felt), columns["high"], felt), ~np.isnan(felt)


def best_of(found: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The best of some rows, the first of those that are alike but for rounding.

    Certified ones come first, and those with a stiffness felt that is known.
    """
    known = [row for row in found if row]
    for better in ("certified", "known"):
        known = [row for row in known if row[better]] or known
    most = max((row["merit"] for row in known), default=0.0)
    return next((dict(row) for row in known if row["merit"] >= most - FELT_ALIKE * abs(most)), {})


def is_logarithmic(values: np.ndarray) -> bool:
    """Whether an axis is spaced by a constant factor, so that its scale is logarithmic."""
    steps = np.unique(values)
    if len(steps) < 4 or steps[0] <= 0:
        return False
    return bool(np.ptp(np.diff(np.log(steps))) < 1e-6 * np.log(steps[-1] / steps[0]))
