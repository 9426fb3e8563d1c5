"""Figures of passivity: the excess of the wave channel's norm over 1, the margin at the hand's
port, and filter orders."""

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.engine.norms import NORM_TOLERANCE
from wavesweep.program.columns import Columns, axes_of
from wavesweep.program.plots.figure_layout import rows_with
from wavesweep.program.plots.labels import assumption, at_hand, label, symbol, valued
from wavesweep.program.plots.sampling import Blocks, shown_loops
from wavesweep.program.plots.scales import by_factors, is_logarithmic
from wavesweep.program.plots.style import (
    DOUBTFUL,
    GRID,
    TWO_COLUMNS,
    distinct_colour,
    family_looks,
    figure,
    fitting,
    is_narrow,
    note_below,
    wide,
)

_PASSIVE = {"color": "#CCECE3", "linewidth": 0}  # of the shade
_COLOUR = distinct_colour(0)  # of the dots
_UNSTABLE = {
    "marker": "x",
    "markersize": 3.5,
    "color": DOUBTFUL,
    "linestyle": "none",
    "clip_on": False,
}


def passivity(table: Columns | Blocks, facts: Mapping[str, Any]) -> Any:
    """Draw a `passivity` table: norm less 1 on a logarithmic scale, and the port's margin; passive
    is shaded.

    If an axis has many values, they are lines over it, a family for the next axis; otherwise each
    combination is a dot.
    """
    columns, roles, left_out = shown_loops(table)
    # A margin that is below 0 by rounding alone counts as 0, by the verdict of the table.
    margin = np.where(
        columns["port_passive"], np.fmax(columns["port_margin"], 0.0), columns["port_margin"]
    )
    columns = {**columns, "port_margin": 1e3 * margin}
    if roles:
        return _draw_lines(columns, roles, left_out, facts)
    return _draw_dots(columns, left_out, facts)


def _draw_lines(
    columns: Columns, roles: Mapping[str, Sequence[float]], left_out: str, facts: Mapping[str, Any]
) -> Any:
    x, family, *_ = [*roles, None]
    members = roles[family] if family else (None,)
    with figure(TWO_COLUMNS, 5.2 if is_narrow() and _has_channel(columns) else 2.9) as canvas:
        channel, port = _panels(canvas, columns)
        for look, value in zip(family_looks(len(members)), members, strict=True):
            rows = rows_with(columns, {family: value} if family else {})
            order = np.argsort(rows[x], kind="stable")
            name = valued(family, value, facts) if family else None
            style = {
                "color": look.colour,
                "linestyle": look.line,
                "marker": ".",
                "markersize": 2.5,
                "linewidth": 1,
            }
            for panel, values in (
                (channel, _excess(rows["channel_norm"])),
                (port, rows["port_margin"]),
            ):
                if panel is not None:
                    panel.plot(rows[x][order], values[order], label=name, **style)
        _mark_unstable(port, columns[x], columns["port_margin"], columns["stable"])
        for panel in filter(None, (channel, port)):
            if is_logarithmic(columns[x]):
                by_factors(panel.xaxis, columns[x].min(), columns[x].max())
            panel.set_xlim(columns[x].min(), columns[x].max())
        _scale(channel and channel.yaxis, port.yaxis, columns, facts)
        _legend(canvas, port, "passive")
        note_below(canvas, left_out, assumption(facts), axis=label(x, facts))
    return canvas


def _row_names(columns: Columns, facts: Mapping[str, Any]) -> tuple[str, list[str]]:
    """What the rows differ by: their names and, if these would leave no room for the panels, one
    name for all of their axes."""
    count = len(columns["channel_norm"])
    swept = [name for name in axes_of(columns, "channel_norm") if len(np.unique(columns[name])) > 1]
    names = []
    for row in range(count):
        names.append(", ".join(valued(name, columns[name][row], facts) for name in swept))
    if max(map(len, names), default=0) <= 40:  # letters of the name of a dot with those of its axes
        return "", names
    axes = "\n".join(wrap(", ".join(symbol(name) for name in swept), 12 * (2 + count // 3)))
    values = []
    for name in names:
        values.append(", ".join(each.partition(" = ")[2] for each in name.split(", ")))
    return axes, values


def _draw_dots(columns: Columns, left_out: str, facts: Mapping[str, Any]) -> Any:
    count = len(columns["channel_norm"])
    places, (axes, names) = np.arange(count), _row_names(columns, facts)
    with figure(
        TWO_COLUMNS, (1.5 + 0.2 * count) * (2 if is_narrow() and _has_channel(columns) else 1)
    ) as canvas:
        channel, port = _panels(canvas, columns, sharey=True)
        panels = (
            (channel, _excess(columns["channel_norm"]), "channel_passive"),
            (port, columns["port_margin"], "port_passive"),
        )
        for panel, values, verdict in panels[channel is None :]:
            # Filled where passive: a margin just below zero looks like zero.
            for passes, face, name in ((True, _COLOUR, "passive"), (False, "white", "not passive")):
                drawn = (columns[verdict] == passes) & (columns["stable"] | (panel is channel))
                of_both = (columns["port_passive"] == passes) | (
                    columns["channel_passive"] == passes
                )
                said = name if panel is port and of_both.any() else None
                panel.plot(
                    values[drawn],
                    places[drawn],
                    "o",
                    color=_COLOUR,
                    markerfacecolor=face,
                    markersize=4,
                    label=said,
                )
            panel.grid(**GRID, axis="y")
        _mark_unstable(port, columns["port_margin"], places, columns["stable"])
        first = channel or port
        first.set_yticks(places, names)
        first.set_ylabel(axes)
        first.set_ylim(count - 0.4, -0.6)
        _scale(channel and channel.xaxis, port.xaxis, columns, facts)
        _legend(canvas, port, "range of what is passive")
        note_below(canvas, left_out, assumption(facts))
    return canvas


def _has_channel(columns: Columns) -> bool:
    return not np.isnan(columns["channel_norm"]).all()


def _panels(canvas: Any, columns: Columns, **shared: bool) -> Sequence[Any]:
    """The panels of the channel and of the port; without a channel there is one, as nothing
    could generate energy."""
    if not _has_channel(columns):
        return None, canvas.subplots()
    return canvas.subplots(*((2, 1) if is_narrow() else (1, 2)), **shared)


def _mark_unstable(port: Any, x: np.ndarray, y: np.ndarray, stable: np.ndarray) -> None:
    """Cross out the margins of unstable loops: they are not passive, also if the margin is
    positive."""
    crossed = ~stable & np.isfinite(x) & np.isfinite(y)
    if crossed.any():
        port.plot(x[crossed], y[crossed], label="unstable, not passive", **_UNSTABLE)


def _excess(norm: np.ndarray) -> np.ndarray:
    """Norm less 1, or 0 below the tolerance."""
    return np.maximum(norm - 1, NORM_TOLERANCE)


def _scale(channel: Any, port: Any, columns: Columns, facts: Mapping[str, Any]) -> None:
    """Scale, shade and label the axes of values of both panels, in either direction."""
    if channel is not None:
        most = max(3 * _excess(np.nanmax(columns["channel_norm"])), 1e-2)
        _set(channel, "log", (NORM_TOLERANCE / 10, most), (NORM_TOLERANCE / 10, NORM_TOLERANCE))
        channel.set_label_text("channel norm - 1")
    margin = columns["port_margin"][~np.isnan(columns["port_margin"])]
    largest = float(np.abs(margin).max(initial=0.0)) or 1.0
    linear = 1e-4 * largest  # about zero, margins are drawn evenly; beyond it they go by factors
    bottom, top = (
        min(float(margin.min(initial=0.0)) * 2, -linear),
        max(float(margin.max(initial=0.0)) * 2, linear),
    )
    _set(port, "symlog", (bottom, top), (0.0, top), linthresh=linear)
    # Decades next to the linear part would stand on the 0. Side by side there is room for every
    # other one.
    every = -1 if port.axis_name == "y" else -2
    shown = np.floor(np.log10(max(-bottom, top)))
    decades = (10.0 ** np.arange(np.ceil(np.log10(linear)) + 1, shown + 1))[::every][::-1]
    port.set_ticks([tick for tick in (*-decades[::-1], 0.0, *decades) if bottom <= tick <= top])
    if not margin.size:
        port.axes.text(
            0.5, 0.5, "no margin is known", ha="center", va="center", transform=port.axes.transAxes
        )
    port.set_label_text(at_hand("port margin", "port_margin", "mm/N", facts))


def _set(
    axis: Any,
    scale: str,
    limits: tuple[float, float],
    passive: tuple[float, float],
    **options: float,
) -> None:
    """Give an axis a scale and limits, and shade the range of what is passive."""
    upright, axes = axis.axis_name == "y", axis.axes
    (axes.set_yscale if upright else axes.set_xscale)(scale, **options)
    (axes.set_ylim if upright else axes.set_xlim)(limits)
    (axes.axhspan if upright else axes.axvspan)(*passive, **_PASSIVE)


def _legend(canvas: Any, panel: Any, shaded: str) -> None:
    from matplotlib.patches import Patch

    handles, labels = panel.get_legend_handles_labels()
    handles, labels = [*handles, Patch(**_PASSIVE)], [*labels, shaded]
    canvas.legend(
        handles, labels, loc="outside upper center", ncols=fitting(labels, wide(TWO_COLUMNS))
    )


def passivity_ports(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `passivity-ports` table: Llewellyn's index at the left, the margin at the right, a
    curve per combination."""
    axes = [name for name in columns if name not in ("frequency_hz", "llewellyn", "damping_margin")]
    starts = np.flatnonzero(np.diff(columns["frequency_hz"], prepend=np.inf) < 0)
    curves = np.split(np.arange(columns["frequency_hz"].size), starts[1:])
    # Curves of the index over frequency.
    shown = [curves[at] for at in np.unique(np.linspace(0, len(curves) - 1, 8).astype(int))]
    with figure(TWO_COLUMNS, 5.2 if is_narrow() else 2.9) as canvas:
        panels = canvas.subplots(*((2, 1) if is_narrow() else (1, 2)))
        for look, rows in zip(family_looks(len(shown)), shown, strict=True):
            name = ", ".join(valued(axis, columns[axis][rows[0]], facts) for axis in axes)
            for panel, values in zip(panels, ("llewellyn", "damping_margin"), strict=True):
                style = {"color": look.colour, "linestyle": look.line, "label": name or None}
                panel.plot(columns["frequency_hz"][rows], columns[values][rows], lw=1, **style)
        least = [np.nanmin(columns["damping_margin"][rows], initial=np.inf) for rows in shown]
        # Excess in plenty, as at high frequencies, would hide where there is little.
        highest = 4 * max(map(abs, least))
        panels[1].set_ylim(min(*least, 0.0) - highest / 20, highest)
        for panel, limit, scale in zip(panels, (1.0, 0.0), ("log", "linear"), strict=True):
            ends = columns["frequency_hz"].min(), columns["frequency_hz"].max()
            panel.set(xscale="log", yscale=scale, xlabel="frequency (Hz)", xlim=ends)
            panel.set_ylim(top=max(panel.get_ylim()[1], limit + 0.1))
            panel.axhspan(limit, panel.get_ylim()[1], **_PASSIVE)
            panel.grid(**GRID)
        cut_off = ", up to 1000" * bool((columns["llewellyn"] > 999).any())
        panels[0].set_ylabel("Llewellyn's index" + cut_off)
        panels[1].set_ylabel(at_hand("damping in excess", "damping_margin", "N*s/m", facts))
        _legend(canvas, panels[0], "absolutely stable")
        said = f"Shown: {len(shown)} of {len(curves)} combinations." * (len(shown) < len(curves))
        note_below(canvas, said, assumption(facts))
    return canvas
