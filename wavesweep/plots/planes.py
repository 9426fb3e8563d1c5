"""Stable regions of a plane, drawn from their intervals at the values of x; and regions of several designs side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.plots.style import DOUBTFUL, ONE_COLUMN, TWO_COLUMNS, UNKNOWN, family_colours, figure, incomplete, label


@dataclass(frozen=True, eq=False)
class Plane:
    """One panel: a title, the axis along it, (name, `zwidth` columns) of each design, the top of the axis (N/m).

    mark: a point (x, y) to compare with. note: text in the middle of the panel.
    """

    title: str
    x: str
    designs: Sequence[tuple[str, Mapping[str, np.ndarray]]]
    top: float
    mark: tuple[float, float] | None = None
    note: str = ""


def draw_planes(planes: Sequence[Plane], path: Path) -> None:
    """Draw the panels side by side as PNG: stable regions filled, their boundaries as lines."""
    with figure(path, ONE_COLUMN if len(planes) == 1 else TWO_COLUMNS, 2.8) as canvas:
        grid = np.atleast_1d(canvas.subplots(1, len(planes), sharey=True))
        for axes, plane in zip(grid, planes, strict=True):
            _draw_plane(axes, plane)
        along = str(planes[0].designs[0][1]["along"][0])
        grid[0].set_ylabel(label(along))
        _add_legend(canvas, planes[0])


def _draw_plane(axes: Any, plane: Plane) -> None:
    colours = family_colours(len(plane.designs))
    for colour, (_, columns) in zip(colours, plane.designs, strict=True):
        draw_region(axes, columns, plane.x, colour, alone=False)
    if plane.mark is not None:
        axes.plot(*plane.mark, "x", color="black", markersize=7, zorder=4)
    columns = plane.designs[0][1]
    axes.set_xlim(columns[plane.x].min(), columns[plane.x].max())
    axes.set_ylim(0.0, plane.top)
    axes.set_xlabel(label(plane.x))
    axes.set_title(plane.title)
    axes.text(0.5, 0.5, plane.note, ha="center", va="center", transform=axes.transAxes)


def _add_legend(canvas: Any, plane: Plane) -> None:
    from matplotlib.lines import Line2D

    colours = family_colours(len(plane.designs))
    handles = [Line2D([], [], color=c, label=name) for c, (name, _) in zip(colours, plane.designs, strict=True)]
    canvas.legend(handles=handles, loc="outside lower center", ncols=4)


@dataclass(frozen=True)
class Interval:
    """A stable interval; an end is real unless the swept range ends there."""

    low: float
    high: float
    low_real: bool
    high_real: bool
    certified: bool


# An interval followed over neighbouring values of x: (x, interval) in order of x.
Chain = list[tuple[float, Interval]]


def draw_region(axes: Any, columns: Mapping[str, np.ndarray], x: str, colour: Any, alone: bool) -> None:
    """Fill the stable region and draw its boundary; a region among others of a family is filled faintly."""
    from matplotlib.collections import LineCollection, PolyCollection

    chains = _chains(columns, x)
    # Whole chains and not a polygon from each x to the next: seams between polygons show.
    outlines = [_outline(chain) for chain in chains]
    cells = list(_cells(columns, x))
    for left, right in cells:
        axes.axvspan(left, right, **UNKNOWN)
    if cells:  # no hatching under what is known
        axes.add_collection(PolyCollection(outlines, facecolor="white", linewidth=0, zorder=0.5))
    axes.add_collection(PolyCollection(outlines, facecolor=colour, alpha=0.25 if alone else 0.07, linewidth=0))
    certain = [line for chain in chains for line in _boundary(chain, certified=True)]
    doubtful = [line for chain in chains for line in _boundary(chain, certified=False)]
    axes.add_collection(LineCollection(certain, colors=[colour], linewidths=1.2, capstyle="round"))
    axes.add_collection(LineCollection(doubtful, colors=DOUBTFUL, linewidths=1.2, linestyles="--", zorder=3))


def _cells(columns: Mapping[str, np.ndarray], x: str) -> Iterator[tuple[float, float]]:
    """Give the cells about the partly known values of x, half way to their neighbours."""
    values, which = np.unique(columns[x], return_inverse=True)
    middle = (values[1:] + values[:-1]) / 2
    left, right = np.concatenate([values[:1], middle]), np.concatenate([middle, values[-1:]])
    for index in np.unique(which[incomplete(columns)]).tolist():
        yield float(left[index]), float(right[index])


def _chains(columns: Mapping[str, np.ndarray], x: str) -> list[Chain]:
    """Follow each interval from x to x for as long as it has one partner; a chain without one ends half way.

    If two intervals merge, there is no straight line between them. They are drawn up to half way, so that only computed
    values are shown and a hole remains a hole.
    """
    slices = [(value, _intervals(columns, columns[x] == value)) for value in np.unique(columns[x]).tolist()]
    growing: dict[int, Chain] = {index: [(slices[0][0], each)] for index, each in enumerate(slices[0][1])}
    finished: list[Chain] = []
    for (left, before), (right, after) in pairwise(slices):
        partners, middle = _partners(before, after), (left + right) / 2
        grown = {}
        for index, interval in enumerate(after):
            start = [(middle, interval)] if index not in partners else growing.pop(partners[index])
            grown[index] = [*start, (right, interval)]
        finished += [[*chain, (middle, chain[-1][1])] for chain in growing.values()]
        growing = grown
    return finished + list(growing.values())


def _partners(before: list[Interval], after: list[Interval]) -> dict[int, int]:
    """Index in `after` -> index in `before`, for pairs of intervals that overlap only each other."""
    overlaps = [(i, j) for i, a in enumerate(before) for j, b in enumerate(after) if a.low < b.high and b.low < a.high]
    once_before, once_after = Counter(i for i, _ in overlaps), Counter(j for _, j in overlaps)
    return {j: i for i, j in overlaps if once_before[i] == 1 and once_after[j] == 1}


def _intervals(columns: Mapping[str, np.ndarray], rows: np.ndarray) -> list[Interval]:
    stable = np.flatnonzero(rows & (columns["intervals"] > 0))
    return [
        Interval(
            float(columns["low"][row]),
            float(columns["high"][row]),
            not np.isnan(columns["low_omega"][row]),
            not np.isnan(columns["high_omega"][row]),
            bool(columns["certified"][row]),
        )
        for row in stable.tolist()
    ]


def _outline(chain: Chain) -> list[tuple[float, float]]:
    return [(x, each.high) for x, each in chain] + [(x, each.low) for x, each in reversed(chain)]


def _boundary(chain: Chain, certified: bool) -> Iterator[list[tuple[float, float]]]:
    """Return the lines along both real ends, either the certified ones or the others."""
    yield from _stretches([(x, e.low, e.low_real, e.certified) for x, e in chain], certified)
    yield from _stretches([(x, e.high, e.high_real, e.certified) for x, e in chain], certified)


def _stretches(ends: list[tuple[float, float, bool, bool]], certified: bool) -> Iterator[list[tuple[float, float]]]:
    """Join pieces that touch to one line, for its dashes; a piece is certified if both of its ends are."""
    line: list[tuple[float, float]] = []
    for (x, value, real, sure), (next_x, next_value, next_real, next_sure) in pairwise(ends):
        if real and next_real and (sure and next_sure) == certified:
            line = [*(line or [(x, value)]), (next_x, next_value)]
        elif line:
            yield line
            line = []
    if line:
        yield line
