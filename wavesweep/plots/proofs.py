"""What [for_all] leaves open and what it refutes, in the figures of intervals: hatches and carets beside what is proved."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.style import UNKNOWN

_CARET = {"color": "#D55E00", "markersize": 4, "linestyle": "none", "zorder": 4}
_LEFT, _RIGHT, _UP, _DOWN = 8, 9, 10, 11  # carets whose base is at the point
NOT_KNOWN, REFUTED = "not known", "refuted from here"
_WIDTH = 0.35  # of the distance between two values of x: a hatch about one of them

Span = tuple[float, float]


def draw_beside_bar(axes: Any, place: float, half: float, columns: Columns, span: Span) -> None:
    """Draw what is not known and what is refuted on the bar of the for_all rows, at `place` with `half` of its height.

    span: the part of the swept range that the axes show.
    """
    for _, low, high in _open_parts(columns, span):
        axes.barh(place, high - low, left=low, height=2 * half, **UNKNOWN)
    for name, caret in (("fails_below", _LEFT), ("fails_from", _RIGHT)):
        found = _known(columns[name])
        axes.plot(found, np.full(found.size, place), marker=caret, **_CARET)


def draw_at_places(axes: Any, x: str, columns: Columns, logarithmic: bool, span: Span, shift: float) -> None:
    """The same in a plane over the values of x, at each of which there are for_all rows. shift: that of the bars, points."""
    from matplotlib.transforms import ScaledTranslation

    place = axes.transData + ScaledTranslation(shift / 72, 0, axes.figure.dpi_scale_trans)
    for row, low, high in _open_parts(columns, span):
        left, right = _about(columns[x][row], np.unique(columns[x]), logarithmic)
        axes.bar(left, high - low, width=right - left, bottom=low, align="edge", **UNKNOWN)
    for name, caret in (("fails_below", _DOWN), ("fails_from", _UP)):
        rows = np.isfinite(columns[name])
        axes.plot(columns[x][rows], columns[name][rows], marker=caret, transform=place, **_CARET)


def for_all_handles(columns: Columns) -> list[Any]:
    """Entries of the legend for what the for_all rows leave open and what they refute."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [] if columns["settled"].all() else [Patch(**UNKNOWN, label=NOT_KNOWN)]
    if _known(columns["fails_below"]).size + _known(columns["fails_from"]).size:
        handles.append(Line2D([], [], marker=_RIGHT, **_CARET, label=REFUTED))
    return handles


def _known(values):
    return values[np.isfinite(values)]


def _open_parts(columns: Columns, span: Span) -> Iterator[tuple[int, float, float]]:
    """Yield (row, low, high) of what is neither proved nor refuted next to what is proved, or everywhere if nothing is."""
    for row, stable in enumerate((columns["intervals"] > 0).tolist()):
        parts = [span]
        if stable:
            below, above = columns["fails_below"][row], columns["fails_from"][row]
            parts = [(np.fmax(below, span[0]), columns["low"][row]), (columns["high"][row], np.fmin(above, span[1]))]
        yield from ((row, low, high) for low, high in parts if low < high)


def _about(place: float, places: np.ndarray, logarithmic: bool) -> Span:
    """The ends of a hatch about one of several values of x."""
    position, back = (np.log, np.exp) if logarithmic else (np.asarray, np.asarray)
    half = _WIDTH * np.diff(position(places)).min() / 2
    return float(back(position(place) - half)), float(back(position(place) + half))
