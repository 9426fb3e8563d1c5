"""Which axis of a table goes where in the figure of its intervals, and what does not fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, product

import numpy as np

MOST_MEMBERS = 8
MOST_PANELS = 9


@dataclass(frozen=True)
class Layout:
    """The roles of a table's axes.

    x        the axis along the figure, None where every axis has a single value (bars are drawn then)
    family   the axis whose values are drawn as lines of one panel, None where there is no second axis
    members  the family's values that are drawn
    panels   a panel each: the values of the remaining axes
    left_out what the figure does not show, in words; empty where it shows everything
    """

    x: str | None
    family: str | None
    members: tuple[float, ...]
    panels: tuple[dict[str, float], ...]
    left_out: str


def lay_out(columns: Mapping[str, np.ndarray]) -> Layout:
    """Give the table's axes their roles. B_VE lies along the figure where it can: the Z-width plane is drawn so."""
    values = {name: np.unique(columns[name]) for name in list(columns)[: list(columns).index("along")]}
    several = [name for name in values if len(values[name]) > 1]
    x = _along_the_figure(several, values)
    rest = [name for name in several if name != x]
    family = rest[0] if rest else None
    members = _evenly(values[family], MOST_MEMBERS) if family else ()
    combinations = product(*(values[name].tolist() for name in rest[1:]))
    panels = tuple(dict(zip(rest[1:], combination, strict=True)) for combination in islice(combinations, MOST_PANELS))
    total = int(np.prod([len(values[name]) for name in rest[1:]])) if rest[1:] else 1
    notes = []
    if family and len(members) < len(values[family]):
        notes.append(f"{len(members)} of {len(values[family])} values of {family}")
    if len(panels) < total:
        notes.append(f"{len(panels)} of {total} combinations of {', '.join(rest[1:])}")
    return Layout(x, family, members, panels, f"Shown: {'; '.join(notes)}." if notes else "")


def _along_the_figure(several: list[str], values: Mapping[str, np.ndarray]) -> str | None:
    if "B_VE" in several:
        return "B_VE"
    # A handful of values makes bars or a family; a line needs more of them.
    longest = max(several, key=lambda name: len(values[name]), default=None)
    return longest if longest is not None and len(values[longest]) > MOST_MEMBERS else None


def _evenly(values: np.ndarray, most: int) -> tuple[float, ...]:
    if len(values) <= most:
        return tuple(values.tolist())
    return tuple(values[np.linspace(0, len(values) - 1, most).round().astype(int)].tolist())
