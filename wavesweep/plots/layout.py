"""The roles of a table's axes in the figure of its intervals, and a note on values that do not fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

# What a person can still read in one figure.
MOST_MEMBERS = 6
MOST_PANELS = 9
MOST_BARS = 8
MOST_POINTS = 400  # along the figure: more than that is finer than its pixels


@dataclass(frozen=True)
class Layout:
    """The roles of a table's axes.

    x        the axis along the figure; None if no axis is long enough, so that bars are drawn
    points   the values of x that are drawn
    panels   the axis with a panel for each value, None if there is one panel; `panel_values` those drawn
    family   the axis whose values are lines (or bars) of one panel, None if there are none; `members` those drawn
    fixed    the value at which each remaining axis is held
    left_out note on the values that the figure does not show; empty if it shows all of them
    """

    x: str | None
    points: tuple[float, ...]
    panels: str | None
    panel_values: tuple[float, ...]
    family: str | None
    members: tuple[float, ...]
    fixed: Mapping[str, float]
    left_out: str

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


def lay_out(axes: Mapping[str, Sequence[float]]) -> Layout:
    """Give the axes (name -> values) their roles, in their order: along the figure, panels, a family of lines.

    B_VE or K_VE lies along the figure if possible, since this is how the plane of the wall is usually drawn.
    """
    several = {name: tuple(sorted(set(values))) for name, values in axes.items() if len(set(values)) > 1}
    x = along_the_figure(several)
    rest = [name for name in several if name != x]
    # Bars have their family first, named on the axis across; lines have it in a legend, and panels are easier to read.
    first, second, *_ = [*rest, None, None]
    panels, family = (first, second) if x else (second, first)
    points = evenly(several, x, MOST_POINTS)
    panel_values = evenly(several, panels, MOST_PANELS)
    members = evenly(several, family, MOST_MEMBERS if x else MOST_BARS)
    fixed = {name: several[name][len(several[name]) // 2] for name in rest[2:]}
    shown = ((x, points), (panels, panel_values), (family, members))
    notes = [f"{len(v)} of {len(several[n])} values of {n}" for n, v in shown if n and len(v) < len(several[n])]
    notes += [f"{name} at {value:g} alone, of {len(several[name])} values" for name, value in fixed.items()]
    said = f"Shown: {'; '.join(notes)}." if notes else ""
    return Layout(x, points, panels, panel_values, family, members, fixed, said)


def along_the_figure(several: Mapping[str, Sequence[float]]) -> str | None:
    """Return the axis along the figure, one of the wall's if possible; None if all axes are short."""
    for wall in ("B_VE", "K_VE"):
        if wall in several:
            return wall
    # A handful of values makes bars; a line needs more of them.
    longest = max(several, key=lambda name: len(several[name]), default=None)
    return longest if longest is not None and len(several[longest]) > MOST_BARS else None


def evenly(several: Mapping[str, Sequence[float]], name: str | None, most: int) -> tuple[float, ...]:
    """Return up to `most` values of the axis `name`, equally spaced in its list and with both ends."""
    if name is None:
        return ()
    values = np.asarray(several[name])
    if len(values) <= most:
        return tuple(values.tolist())
    return tuple(values[np.linspace(0, len(values) - 1, most).round().astype(int)].tolist())
