"""Run time against error, a line per method and a panel per problem."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

import numpy as np

from bench.measuring import measured_on
from wavesweep.program.plots.style import IDEAL, TWO_COLUMNS, distinct_colour, figure

_LEAST = 1e-16  # errors below rounding, 0 among them, stand at the edge
_MARKERS = "osv^D<"
_OWN_MARKERS = "*XpP"
_OURS = "this tool"
_ACROSS = 3
_FIRST = {"linewidth": 0.6, "alpha": 0.7, "zorder": 2.4}  # of the line from a call of a known loop up to a first call


def draw(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Any:
    """Draw the errors of the table of `python benchmarks/bench`: those in stiffness, and those in the response last.

    facts: `titles` maps problems to the titles of their panels; the line below them says where this was measured.
    """
    chosen = np.isin(columns["part"], ("stiffness", "response"))
    rows = {name: column[chosen] for name, column in columns.items()}
    problems, methods = (list(dict.fromkeys(rows[name].tolist())) for name in ("problem", "method"))
    across = min(len(problems), _ACROSS)
    down = -(-len(problems) // across)
    with figure(TWO_COLUMNS, 2.2 * down + 1.5) as canvas:
        grid = canvas.subplots(down, across, squeeze=False).ravel()
        for axes, problem in zip(grid, problems, strict=False):
            here = rows["problem"] == problem
            _panel(axes, {name: column[here] for name, column in rows.items()}, methods)
            axes.set_title(facts["titles"].get(problem, problem))
        for axes in grid[len(problems) :]:
            axes.remove()
        _legend(canvas, rows, methods)
        canvas.suptitle("\n".join(wrap(measured_on(facts), 110)), fontsize="small")
    return canvas


def _panel(axes: Any, rows: Mapping[str, np.ndarray], methods: list[str]) -> None:
    for method in dict.fromkeys(rows["method"].tolist()):
        of = (rows["method"] == method) & np.isfinite(rows["error_max"])
        error, seconds = np.maximum(rows["error_max"][of], _LEAST), rows["seconds"][of]
        missed = rows["found"][of] < rows["there"][of]
        look = _look(method, methods)
        axes.plot(error, seconds, **look)
        axes.vlines(error, seconds, rows["first_seconds"][of], color=look["color"], **_FIRST)
        axes.plot(error[missed], seconds[missed], **{**look, "linestyle": "none", "markerfacecolor": "white"})
    _logarithmic(axes)
    axes.set_xlabel("largest relative error")
    axes.set_ylabel("processor seconds per question")
    axes.grid(visible=True, color="0.9", linewidth=0.5)


def _logarithmic(axes: Any) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(_LEAST / 3, 3)
    axes.xaxis.set_major_locator(LogLocator(numticks=5))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())
    low, high = axes.get_ylim()
    # At least two decades, so that at least two of them are named.
    axes.set_ylim(min(low, high / 200), 1.5 * high)  # with room for the marks at the upper edge


def _look(method: str, methods: list[str]) -> dict[str, Any]:
    mine = method.startswith(_OURS)
    rank = [name for name in methods if name.startswith(_OURS) == mine].index(method)
    if mine:
        # Behind the others, and larger: the nearest of them would be hidden.
        return {"color": IDEAL, "marker": _OWN_MARKERS[rank], "markersize": 7, "zorder": 2.5}
    style, marker = "-" if rank < len(_MARKERS) else "--", _MARKERS[rank % len(_MARKERS)]
    line = {"linestyle": style, "linewidth": 0.9, "zorder": 3}
    return {"color": distinct_colour(rank), "marker": marker, "markersize": 4, **line}


def _legend(canvas: Any, rows: Mapping[str, np.ndarray], methods: list[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **_look(name, methods)) for name in methods]
    names = [f"{name} ({_sizes(rows, name)})" for name in methods]
    handles.append(Line2D([], [], color="0.4", linestyle="none", marker="|", markersize=9))
    handles.append(Line2D([], [], color="0.4", linestyle="none", marker="o", markersize=4, markerfacecolor="white"))
    handles.append(Line2D([], [], linestyle="none"))
    names += ["up to a first call of the loop", "hollow: misses intervals", "(columns, or frequencies, asked for)"]
    canvas.legend(handles, names, loc="outside lower center", ncols=2)


def _sizes(rows: Mapping[str, np.ndarray], method: str) -> str:
    """The sizes of the questions of a method, those of its marks."""
    sizes = rows["size"][rows["method"] == method].astype(int)
    low, high = (f"{end:,}" for end in (sizes.min(), sizes.max()))
    return f"{low} to {high}" if low != high else low
