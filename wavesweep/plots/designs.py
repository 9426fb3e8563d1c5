"""The figure of a design study: the front of two wishes, or the wishes of the best designs, beside the spec's own design."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.plots.style import ONE_COLUMN, TWO_COLUMNS, by_factors, figure, label, note_assumptions, printed, with_unit
from wavesweep.spec.design import WISHES
from wavesweep.tables.columns import fields

NAMES = {
    "z_width": "stiffest wall",
    "felt": "stiffness felt",
    "transparency": "error of the response",
    "channel": "norm of the wave channel",
    "port": "margin of the hand's port",
    "damping_ratio": "damping ratio of the slowest mode",
    "settling": "time constant of the slowest mode",
    "delay_margin": "delay margin",
}
_FRONT = {"marker": "o", "markersize": 4, "color": "#0072B2", "linestyle": "-", "linewidth": 0.8}
_OWN = {"marker": "X", "markersize": 8, "color": "#D55E00", "markeredgecolor": "white", "linestyle": "none"}


def design(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Any:
    """Draw a `design` table: one wish over the other and, below, the varied numbers along the front.

    All values are the worst over what the designs have to hold for. The labels of the axes say which side is better. A single
    wish is a bar for the design that was found, and one for the spec's own.
    """
    from matplotlib.ticker import FixedLocator, MaxNLocator

    wishes = list(facts["spec"]["design"]["wish"])
    free = [name for name in wishes if not {"at_least", "at_most"} & set(facts["spec"]["design"]["wish"][name])]
    x, y = free if len(free) == 2 else [wishes[0], wishes[1] if len(wishes) > 1 else wishes[0]]
    varied = list(facts["spec"]["design"]["vary"])
    kinds = {field.name: field.kind for field in fields("zwidth", varied, facts=facts)}
    down = -(-len(varied) // 3)
    width = TWO_COLUMNS if len(varied) > 1 else ONE_COLUMN
    with figure(width, 2.8 + 1.3 * down) as canvas:
        across = min(3, len(varied))
        grid = canvas.add_gridspec(1 + down, across, height_ratios=[2.2, *[1] * down])
        front = canvas.add_subplot(grid[0, :])
        order = np.argsort(columns[x], kind="stable")
        own = facts.get("own", {})
        if x == y:
            _draw_single(front, columns[x], own.get(x), _label(x, facts))
        else:
            _draw_front(front, columns, order, own, {name: _label(name, facts) for name in (x, y)})
        for place, name in enumerate(varied):
            panel = canvas.add_subplot(grid[1 + place // across, place % across])
            panel.plot(columns[x][order], columns[name][order], **_FRONT | {"markersize": 2.5})
            panel.set_title(label(name, facts), fontsize=7)
            if front.get_xscale() == "log":
                by_factors(panel.xaxis, columns[x].min(), columns[x].max())
            if (columns[name] > 0).all() and columns[name].max() > 5 * columns[name].min():
                by_factors(panel.yaxis, columns[name].min(), columns[name].max())
            if kinds[name] == "integer":
                most = columns[name].max() - columns[name].min()
                panel.yaxis.set_major_locator(MaxNLocator(integer=True) if most else FixedLocator(columns[name][:1]))
                panel.set_ylim(columns[name].min() - 0.5, columns[name].max() + 0.5)
            panel.grid(visible=True, color="0.9", linewidth=0.5)
            panel.tick_params(labelsize=6)
        unknown = [NAMES[name] for name in (x, y) if own.get(name) is None]
        above = f"the spec's own design is not shown: its {' and its '.join(unknown)} is not known, as where it is unstable"
        note_assumptions(canvas, facts, above if own and unknown else "")
    return canvas


def _draw_front(axes: Any, columns: Mapping[str, np.ndarray], order: np.ndarray, own: Mapping[str, Any], labels: dict) -> None:
    """The second of two wishes over the first one, and the spec's own design if both are known of it; labels: of both axes."""
    x, y = labels
    axes.plot(columns[x][order], columns[y][order], label="designs that were found", **_FRONT)
    if own.get(x) is not None and own.get(y) is not None:
        axes.plot(own[x], own[y], label="the spec's own design", **_OWN)
    for name, axis in ((x, axes.xaxis), (y, axes.yaxis)):
        axis.set_label_text(labels[name] if axis is axes.xaxis else labels[name].replace("), ", "),\n"))
        values = columns[name][np.isfinite(columns[name])]
        if values.size and values.min() > 0 and values.max() > 5 * values.min():
            by_factors(axis, values.min(), values.max())
    axes.grid(visible=True, which="both", color="0.9", linewidth=0.5)
    axes.legend(loc="best")


def _draw_single(axes: Any, values: np.ndarray, own: float | None, label: str) -> None:
    """A bar for each design that was found, and one for the spec's own."""
    known = [] if own is None else [own]
    names = [*(["the spec's own design"] if known else []), *(["design that was found"] * len(values))]
    places, colours = np.arange(len(names)), [_OWN["color"]] * len(known) + [_FRONT["color"]] * len(values)
    axes.barh(places, [*known, *values], height=0.6, color=colours)
    axes.set_yticks(places, names)
    axes.set_xlabel(label)
    axes.grid(visible=True, axis="x", color="0.9", linewidth=0.5)
    axes.set_axisbelow(True)


def _label(name: str, facts: Mapping[str, Any]) -> str:
    kind = WISHES[name]
    unit = printed([facts.get("units", {}).get(name, kind.unit)])
    return f"{with_unit(NAMES[name], unit)}, {'more' if kind.more else 'less'} is better"
