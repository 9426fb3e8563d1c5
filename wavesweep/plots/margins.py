"""Figures of passivity: the excess of the wave channel's norm over 1, the margin at the hand's port, and filter orders."""

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.chosen import Loops
from wavesweep.plots.layout import is_logarithmic
from wavesweep.plots.style import (
    DOUBTFUL,
    TWO_COLUMNS,
    assumed,
    at_hand,
    by_factors,
    distinct_colour,
    family_looks,
    figure,
    fitting,
    label,
    lines_of,
    symbol,
    valued,
    wide,
)

_TOLERANCE = 1e-10  # of the norm: what is nearer to 1 counts as passive
_LINEAR = 1e-4  # of the largest margin, about zero, that is drawn evenly; beyond it margins go by factors
_PASSIVE, _COLOUR = "#009E73", distinct_colour(0)  # the shade of what is passive, and the dots
_UNSTABLE = {"marker": "x", "markersize": 3.5, "color": DOUBTFUL, "linestyle": "none", "clip_on": False}
_NAME = 40  # letters of the name of a dot with those of its axes
_FLOOR = 1e-10
_PANELS = (("channel_norm", "pmw: channel norm - 1"), ("bank_norm", "pmw-lm, way out: norm - 1"))


def passivity(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `passivity` table: norm less 1 on a logarithmic scale, and the port's margin; passive is shaded.

    If an axis has many values, they are lines over it, a family for the next axis; otherwise each combination is a dot.
    """
    loops = Loops(lambda: (columns,))
    loops.add(columns)
    return passivity_of(loops, facts)


def passivity_of(loops: Loops, facts: Mapping[str, Any]) -> Any:
    """The same for a table that need not fit into memory."""
    columns = loops.chosen()
    # A margin that is below 0 by rounding alone counts as 0, by the verdict of the table.
    margin = np.where(columns["port_passive"], np.fmax(columns["port_margin"], 0.0), columns["port_margin"])
    columns = {**columns, "port_margin": 1e3 * margin}
    return _draw_lines(columns, loops, facts) if loops.roles else _draw_dots(columns, loops, facts)


def _draw_lines(columns: Columns, loops: Loops, facts: Mapping[str, Any]) -> Any:
    shown = loops.roles
    x, family, *_ = [*shown, None]
    members = shown[family] if family else ()
    with figure(TWO_COLUMNS, 2.9) as canvas:
        channel, port = canvas.subplots(1, 2)
        for look, value in zip(family_looks(max(1, len(members))), members or (None,), strict=True):
            rows = _where(columns, {family: (value,)} if family else {})
            order = np.argsort(rows[x], kind="stable")
            name = None if value is None else valued(family, value, facts)
            style = {"color": look.colour, "linestyle": look.line, "marker": ".", "markersize": 2.5, "linewidth": 1}
            for panel, values in ((channel, _excess(rows)), (port, rows["port_margin"])):
                panel.plot(rows[x][order], values[order], label=name, **style)
        _mark_unstable(port, columns[x], columns["port_margin"], columns["stable"])
        for panel in (channel, port):
            if is_logarithmic(columns[x]):
                by_factors(panel.xaxis, columns[x].min(), columns[x].max())
            panel.set_xlim(columns[x].min(), columns[x].max())
        _finish(channel.yaxis, port.yaxis, (channel, port), columns, facts)
        _legend(canvas, port)
        _note(canvas, label(x, facts), _left_out(loops.several, shown), _said(facts))
    return canvas


def _draw_dots(columns: Columns, loops: Loops, facts: Mapping[str, Any]) -> Any:
    count = len(columns["channel_norm"])
    places = np.arange(count)
    names = [", ".join(valued(name, columns[name][row], facts) for name in loops.several) for row in range(count)]
    axes = ""
    if max(map(len, names), default=0) > _NAME:  # their values alone, which leave room for the panels
        axes = "\n".join(wrap(", ".join(symbol(name) for name in loops.several), 12 * (2 + count // 3)))
        names = [", ".join(_value(name, columns[name][row], facts) for name in loops.several) for row in range(count)]
    note = f"Shown: {count} of {loops.rows} combinations." if count < loops.rows else ""
    with figure(TWO_COLUMNS, 1.5 + 0.2 * count) as canvas:
        channel, port = canvas.subplots(1, 2, sharey=True)
        panels = ((channel, _excess(columns), "channel_passive"), (port, columns["port_margin"], "port_passive"))
        for panel, values, verdict in panels:
            # Filled where passive: a margin just below zero looks like zero.
            for passes, face, name in ((True, _COLOUR, "passive"), (False, "white", "not passive")):
                drawn = (columns[verdict] == passes) & (columns["stable"] | (panel is channel))
                of_both = (columns["port_passive"] == passes) | (columns["channel_passive"] == passes)
                said = name if panel is port and of_both.any() else None
                panel.plot(values[drawn], places[drawn], "o", color=_COLOUR, markerfacecolor=face, markersize=4, label=said)
            panel.grid(visible=True, axis="y", color="0.9", linewidth=0.5)
        _mark_unstable(port, columns["port_margin"], places, columns["stable"])
        channel.set_yticks(places, names)
        channel.set_ylabel(axes)
        channel.set_ylim(count - 0.4, -0.6)
        _finish(channel.xaxis, port.xaxis, (channel, port), columns, facts)
        _legend(canvas, port, "range of what is passive")
        _note(canvas, "", note, _said(facts))
    return canvas


def _value(name: str, value: float, facts: Mapping[str, Any]) -> str:
    return valued(name, value, facts).removeprefix(f"{symbol(name)} = ")


def _mark_unstable(port: Any, x: np.ndarray, y: np.ndarray, stable: np.ndarray) -> None:
    """Cross out the margins of unstable loops: they are not passive, also if the margin is positive."""
    if not stable.all():
        port.plot(x[~stable], y[~stable], label="unstable, not passive", **_UNSTABLE)


def _excess(columns: Columns) -> np.ndarray:
    """Norm less 1, or 0 below the tolerance."""
    return np.maximum(columns["channel_norm"] - 1, _TOLERANCE)


def _finish(channel_axis: Any, port_axis: Any, panels: tuple[Any, Any], columns: Columns, facts: Mapping[str, Any]) -> None:
    """Scale, shade and label both axes of values, in either direction."""
    channel, port = panels
    upright = channel_axis.axis_name == "y"
    if np.isnan(columns["channel_norm"]).all():
        # Without a channel there is nothing that could generate energy.
        channel.text(0.5, 0.5, "no wave channel", ha="center", va="center", transform=channel.transAxes)
        channel_axis.set_ticks([])
    else:
        top = 3 * _excess(columns)[~np.isnan(columns["channel_norm"])].max()
        (channel.set_yscale if upright else channel.set_xscale)("log")
        (channel.set_ylim if upright else channel.set_xlim)(_TOLERANCE / 10, max(top, 1e-2))
        (channel.axhspan if upright else channel.axvspan)(_TOLERANCE / 10, _TOLERANCE, color=_PASSIVE, alpha=0.2, linewidth=0)
    channel_axis.set_label_text("channel norm - 1")
    _scale_margin(port, columns["port_margin"], upright)
    port_axis.set_label_text(at_hand("port margin", "port_margin", "mm/N", facts))


def _scale_margin(port: Any, margin: np.ndarray, upright: bool) -> None:
    known = margin[~np.isnan(margin)]
    largest = float(np.abs(known).max(initial=0.0)) or 1.0
    linear = _LINEAR * largest
    (port.set_yscale if upright else port.set_xscale)("symlog", linthresh=linear)
    bottom, top = min(float(known.min(initial=0.0)) * 2, -linear), max(float(known.max(initial=0.0)) * 2, linear)
    (port.set_ylim if upright else port.set_xlim)(bottom, top)
    # Decades next to the linear part would stand on the 0. Side by side there is room for every other one.
    decades = (10.0 ** np.arange(np.ceil(np.log10(linear)) + 1, np.ceil(np.log10(largest)) + 1))[:: -1 if upright else -2][::-1]
    ticks = [tick for tick in (*-decades[::-1], 0.0, *decades) if bottom <= tick <= top]
    (port.yaxis if upright else port.xaxis).set_ticks(ticks)
    (port.axhspan if upright else port.axvspan)(0, top, color=_PASSIVE, alpha=0.2, linewidth=0)


def _where(columns: Columns, wanted: Mapping[str, tuple]) -> dict[str, np.ndarray]:
    kept = np.ones(len(columns["channel_norm"]), bool)
    for name, values in wanted.items():
        kept &= np.isin(columns[name], values)
    return {name: column[kept] for name, column in columns.items()}


def _said(facts: Mapping[str, Any]) -> str:
    return f"Assumes: {assumed(facts)}." if facts.get("assumes") else ""


def _legend(canvas: Any, panel: Any, shaded: str = "passive") -> None:
    from matplotlib.patches import Patch

    handles, labels = panel.get_legend_handles_labels()
    shade = Patch(color=_PASSIVE, alpha=0.2, linewidth=0)
    labels = [*labels, shaded]
    canvas.legend([*handles, shade], labels, loc="outside upper center", ncols=fitting(labels, wide(TWO_COLUMNS)))


def _left_out(several: Mapping[str, tuple], shown: Mapping[str, tuple]) -> str:
    parts = [f"{len(v)} of {len(several[n])} values of {n}" for n, v in shown.items() if 1 < len(v) < len(several[n])]
    parts += [f"{n} at {v[0]:g} alone, of {len(several[n])} values" for n, v in shown.items() if len(v) == 1]
    return f"Shown: {'; '.join(parts)}." if parts else ""


def _note(canvas: Any, axis: str, *notes: str) -> None:
    lines = [line for line in (axis, *(line for note in notes for line in lines_of(note))) if line]
    if lines:
        canvas.supxlabel("\n".join(lines), fontsize=8)


def passivity_filters(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Any:
    """Draw a `passivity-filters` table: without the local model at the left, with it at the right."""
    del facts
    orders = np.unique(columns["lp1_order"]).tolist()
    with figure(TWO_COLUMNS, 2.9) as canvas:
        panels = canvas.subplots(1, 2, sharey=True)
        for panel, (name, title) in zip(panels, _PANELS, strict=True):
            for look, order in zip(family_looks(len(orders)), orders, strict=True):
                rows = columns["lp1_order"] == order
                excess = np.maximum(columns[name][rows] - 1, _FLOOR)
                style = {"color": look.colour, "linestyle": look.line, "marker": ".", "linewidth": 1}
                panel.plot(columns["lp1_cutoff_hz"][rows], excess, label=f"{order}", **style)
            panel.set_yscale("log")
            panel.set_xlabel("LP1 cutoff (Hz)")
            panel.set_ylabel(title)
            panel.grid(visible=True, color="0.9", linewidth=0.5)
        panels[0].set_ylim(_FLOOR / 3, 1)
        handles, labels = panels[0].get_legend_handles_labels()
        canvas.legend(
            handles, labels, title="order of LP1", loc="outside upper center", ncols=min(8, fitting(labels, wide(TWO_COLUMNS)))
        )
    return canvas
