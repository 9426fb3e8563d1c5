"""The figures of a simulation: forces, positions and energies over time, and the response next
to that of the linear loop."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.program.analyses.plane_columns import spec_of
from wavesweep.program.columns import Columns, complex_columns, run_column
from wavesweep.program.plots.labels import assumption, at_hand, printed, with_unit
from wavesweep.program.plots.sampling import POINTS_OF_A_LINE, extremes
from wavesweep.program.plots.style import (
    GRID,
    IDEAL,
    LINES,
    TWO_COLUMNS,
    distinct_colour,
    figure,
    fitting,
    is_narrow,
    note_below,
    paler,
    warn_above,
    wide,
)
from wavesweep.program.tables.columns import signals_of
from wavesweep.simulation.keys import RANDOM

_DETAIL_FRAMES = 40
FRAME = "length of the frame"  # in ticks, beside the columns
_LINEAR_POINTS = 800  # of the linear loop next to a simulation
_DETAIL_TICKS = 800  # at least, of a drawn loop
_ALIKE = 20.0  # times as large, at most, is a signal that shares a panel with another
_TITLE = 20  # letters in a line of a panel's name
Panel = tuple[str, Sequence[tuple[str, str, str, bool]]]
"""The name of an axis, and column, label and colour of its signals, and whether they are held
over a tick."""
# panel and its unit; column, label and number of the colour of each signal, and whether it is held
_AT_THE_HAND = (
    ("hand force", "N", "f_h", "hand", 2, True),
    ("position", "mm", "x_s", "avatar", 1, True),
    ("position", "mm", "x", "device", 0, False),
    ("control force", "N", "f_m", "asked for", 4, True),
    ("control force", "N", "f_device", "exerted", 0, True),
    ("control force", "N", "F_s", "slow wall", 1, True),
    ("energy", "J", "energy_channel", "kept by channel", 3, False),
    ("energy", "J", "energy_device", "taken by motors", 0, False),
    ("energy", "J", "energy_hand", "given by hand", 2, False),
)
_DRAWN = {
    "device": "hand",
    "asked for": "against the hand",
    "taken by motors": "taken by this force",
}  # in a drawn loop


def simulate(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `simulate` table: hand force, positions and wall, control force, energies, one below
    the other.

    Of a drawn loop first its inputs, outputs and named signals, so that after a step this is the
    figure of step responses.

    At the left is the whole run; if it is long, as the band between the extremes. At the right are
    some frames in detail: around a change of contact, if possible after the run has settled;
    without contact around the start of a step or a pulse, or at the end.
    """
    spans = _spans(columns, facts)
    frames = _frames(facts)
    rows = [
        *_ports(columns, facts),
        *_at_the_hand(columns, facts),
        *frames,
        *_messages(columns, facts),
    ]
    columns = {**columns, FRAME: _lengths(columns)} if frames else columns
    with figure(TWO_COLUMNS, (1.7 if is_narrow() else 1.6) * len(rows)) as canvas:
        grid = canvas.subplots(len(rows), len(spans), sharex="col", squeeze=False)
        for row, (title, signals) in zip(grid, rows, strict=True):
            for axes, span in zip(row, spans, strict=True):
                wall = (
                    facts["spec"]["simulate"].get("wall") if title.startswith("position") else None
                )
                _draw_panel(
                    axes, {name: column[span] for name, column in columns.items()}, signals, wall
                )
            row[0].set_ylabel(title)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
        if len(spans) > 1:
            grid[0, 0].axvspan(
                *columns["time_s"][spans[1]][[0, -1]], color=paler("0.75", 0.6), linewidth=0
            )
            if is_narrow():
                grid[-1, 1].set_xlabel("shaded time (s)")
            else:
                grid[0, 1].set_title("the shaded stretch in detail")
        for row in grid:
            _draw_legend(canvas, row)
        warn_above(canvas, _unstable(facts))
        note_below(canvas, _in_turn(facts), assumption(facts))
        canvas.align_ylabels()
    return canvas


def _draw_panel(axes: Any, columns: Columns, signals: Sequence[tuple], wall: float | None) -> None:
    """Draw some signals in a panel, and a wall (m) as a line."""
    for signal in signals:
        _draw_signal(axes, columns, *signal, len(signals) == 1)
    if wall is not None:
        axes.axhline(1e3 * wall, color=IDEAL, linewidth=0.8, linestyle="--", label="wall")
    axes.grid(**GRID)
    axes.margins(x=0)


def _draw_legend(canvas: Any, row: Any) -> None:
    """Draw the legend of a row outside of its panels: a signal that fills its panel leaves no
    corner free."""
    from matplotlib.ticker import ScalarFormatter
    from matplotlib.transforms import blended_transform_factory

    handles, labels = row[-1].get_legend_handles_labels()
    place = {
        "loc": "center left",
        "bbox_to_anchor": (1.0, 0.5),
        "handlelength": 1.2,
        "borderpad": 0.2,
    }
    if is_narrow():
        across = fitting(labels, wide(TWO_COLUMNS), 7)
        row[0].set_title("\n".join([" "] * -(-len(labels) // across)))  # room for the legend
        left = blended_transform_factory(canvas.transFigure, row[0].transAxes)
        place |= {
            "loc": "lower left",
            "bbox_to_anchor": (0.0, 0.98),
            "ncols": across,
            "columnspacing": 0.8,
        }
        place |= {"bbox_transform": left}
        for axes in row:  # no power of ten above the panel, where the legend is
            if isinstance(axes.yaxis.get_major_formatter(), ScalarFormatter):
                axes.yaxis.set_major_formatter("{x:g}")
    if handles:
        row[0 if is_narrow() else -1].legend(handles, labels, fontsize=7, **place).set_in_layout(
            not is_narrow()
        )


def _at_the_hand(columns: Columns, facts: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield the panels of what a simulation with a hand has."""
    left_out = () if "max_force" in facts["spec"]["simulate"] else ("f_device",)
    words = _DRAWN if "block" in facts["spec"] else {}
    left_out = {
        *left_out,
        *(name for name in ("f_h", "energy_hand") if name in columns and not columns[name].any()),
    }
    present = (
        signal for signal in _AT_THE_HAND if signal[2] in columns and signal[2] not in left_out
    )
    for (title, unit), signals in groupby(present, key=lambda signal: signal[:2]):
        named = [
            (name, words.get(said, said), distinct_colour(n), held)
            for *_, name, said, n, held in signals
        ]
        yield at_hand(title, "", unit, facts), named


def _ports(columns: Columns, facts: Mapping[str, Any]) -> list[Panel]:
    """Panels of inputs that are not at rest, of outputs, and of all other signals.

    Outputs of one unit and about one size share a panel, with the inputs that are like them.
    """
    units = {name: field.unit for name, field in signals_of(facts).items() if name in columns}
    sizes = {
        name: np.abs(columns[name]).max(initial=0.0, where=np.isfinite(columns[name]))
        for name in units
    }
    ports = facts["spec"].get("ports", {})
    entries, outputs = (
        [run_column(side, name) for name in ports.get(side, {})] for side in ("inputs", "outputs")
    )
    inputs = [name for name in entries if name in units and columns[name].any()]
    outputs = [name for name in outputs if name in units]
    unlisted = [name for name in units if name not in (*entries, *outputs)]

    def alike(one: str, other: str) -> bool:
        low, high = sorted((sizes[one], sizes[other]))
        return units[one] == units[other] and (low == 0 or high <= _ALIKE * low)

    panels: list[list[str]] = []
    for name in outputs:
        with_those = next(
            (panel for panel in panels if all(alike(name, shown) for shown in panel)), None
        )
        panels += [[name]] if with_those is None else []
        if with_those is not None:
            with_those.append(name)
    titles = [", ".join(panel) for panel in panels]
    panels = [[*panel, *(name for name in inputs if alike(name, panel[0]))] for panel in panels]
    alone = [name for name in inputs if not any(name in panel for panel in panels)]
    named = [
        *((name, [name]) for name in alone),
        *zip(titles, panels, strict=True),
        *([("signals", unlisted)] if unlisted else []),
    ]
    return [
        (
            "\n".join(
                wrap(
                    with_unit(
                        title, "" if names is unlisted else printed([units[names[0]] or "1"])
                    ),
                    _TITLE,
                )
            ),
            [
                (name, name, IDEAL if name in inputs else distinct_colour(n), True)
                for n, name in enumerate(names)
            ],
        )
        for title, names in named
    ]


def _frames(facts: Mapping[str, Any]) -> list[Panel]:
    """The panel of the lengths of frames, if these were drawn or measured."""
    return (
        [("frame (ticks)", [(FRAME, "frame", distinct_colour(0), True)])]
        if "frames" in facts
        else []
    )


def _lengths(columns: Columns) -> np.ndarray:
    """The length of the frame that each tick is in; of the last one, which may go on, NaN."""
    number = columns["frame"]
    lengths = np.bincount(number - number[:1].sum(), minlength=1).astype(float)
    lengths[-1] = np.nan
    return lengths[number - number[:1].sum()]


def _messages(columns: Columns, facts: Mapping[str, Any]) -> list[Panel]:
    """The panel of how late messages or slow results come, if some do and it is known of which
    channel."""
    channels = [
        name for name, block in facts["spec"].get("block", {}).items() if block["type"] == "channel"
    ]
    if "late" not in columns or not columns["late"].any() or len(channels) > 1:
        return []
    return [
        (
            "late (ticks)",
            [
                (
                    "late",
                    f"messages of {channels[0]}" if channels else "slow results",
                    distinct_colour(0),
                    False,
                )
            ],
        )
    ]


def _in_turn(facts: Mapping[str, Any]) -> str:
    """Where frames are from, and the patterns of late and lost messages that a run repeats."""
    words = {0: "in time", 1: "1 tick late"}
    patterns = facts["spec"]["simulate"].get("messages", {}).items()
    frames, begin = facts["spec"]["simulate"].get("frames"), ""
    if isinstance(frames, str):
        seed = facts["spec"]["simulate"]["seed"]
        begin = (
            f"Frames at random, seed {seed}. "
            if frames == RANDOM
            else f"Frames as they were measured, {frames}. "
        )
    said = [
        f"{name} {', '.join(each if isinstance(each, str) else words.get(each, f'{each} ticks late') for each in late)}"
        for name, late in patterns
    ]
    return begin + (f"Messages, repeated: {'; '.join(said)}." if said else "")


def _unstable(facts: Mapping[str, Any]) -> str:
    """The title of a run of an unstable loop, or of one that stopped early; otherwise empty."""
    linear, stopped = (
        facts.get("linear_loop", {"stable": True}),
        facts.get("ticks", {}).get("stopped"),
    )
    radius = linear.get("spectral_radius")
    said = [
        "unstable" + (f": spectral radius {radius:.6g} per frame" if radius is not None else "")
    ] * (not linear["stable"])
    return "; ".join([*said, *([f"stopped, {stopped}"] if stopped else [])])


def _spans(columns: Columns, facts: Mapping[str, Any]) -> list[slice]:
    """Return the whole span, and that of the detail if it is shorter."""
    rows = len(columns["tick"])
    if "block" in facts["spec"]:  # of a drawn loop a frame may be a tick
        length = max(_DETAIL_FRAMES * (1 + int(columns["phase"].max(initial=0))), _DETAIL_TICKS)
    else:
        rates = facts["spec"]["rates"]
        length = _DETAIL_FRAMES * int(rates.get("ratio") or rates["fast_hz"] / rates["slow_hz"])
    if rows <= 2 * length:
        return [slice(None)]
    start = min(max(_event(columns, facts) - length // 4, 0), rows - length)
    return [slice(None), slice(start, start + length)]


def _event(columns: Columns, facts: Mapping[str, Any]) -> int:
    """Return the tick at the centre of the detail."""
    rows = len(columns["tick"])
    changes = np.flatnonzero(np.diff(columns.get("touching", np.zeros(rows)))) + 1
    if len(changes):
        later = changes[changes >= rows // 2]
        return int(later[0] if len(later) else changes[-1])
    options = facts["spec"]["simulate"]
    return (
        int(np.searchsorted(columns["time_s"], options["at_s"]))
        if options["input"] in ("step", "pulse")
        else rows
    )


def _draw_signal(
    axes: Any, columns: Columns, name: str, label: str, colour: str, held: bool, alone: bool
) -> None:
    """Draw a signal. It is left out if the controller does not have it; a held one is drawn with
    its steps.

    How late messages are is drawn as a dot in each tick. alone: whether no other signal is in the
    panel.
    """
    times, values, style = (
        columns["time_s"],
        columns[name] * (1e3 if name in ("x", "x_s") else 1),
        {},
    )
    if np.isnan(values).all():
        return
    if held and 1 < len(values) <= POINTS_OF_A_LINE:  # the last value is held for a tick as well
        times, values = np.append(times, 2 * times[-1] - times[-2]), np.append(values, values[-1])
        style = {"drawstyle": "steps-post"}
    before = len(axes.get_lines())
    style |= {"marker": "."} if len(values) == 1 else {}
    # wide and pale, so that an energy on another is seen
    below = not before and not held and not alone
    if name == "late":
        axes.plot(
            *extremes(columns["time_s"], values), ".", color=colour, markersize=2.5, label=label
        )
        most = max(int(values.max()), 0)
        ticks = [*[-1] * bool((values < 0).any()), *range(0, most + 1, max(1, round(most / 4)))]
        axes.set_yticks(ticks, ["lost" if tick < 0 else f"{tick}" for tick in ticks])
        return
    style |= {"linestyle": LINES[before % len(LINES)], "linewidth": 1.8 if below else 0.9}
    axes.plot(
        *extremes(times, values), color=paler(colour, 0.5 if below else 1), label=label, **style
    )


def simulate_response(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `simulate-response` table: dots for the estimates of the run, a line for the linear
    loop.

    The line is computed between the frequencies of the table and an octave beyond them; without the
    spec, or of an unstable loop, there are marks at these frequencies alone.
    """
    from wavesweep.engine.response import respond
    from wavesweep.program.analyses.spec_loops import loop_at_hand
    from wavesweep.program.plots.response_figures import Curve, at_both_ports, draw_curves

    spec, frequency_hz = spec_of(facts), columns["frequency_hz"]
    linear = {
        name.removeprefix("linear_"): column
        for name, column in columns.items()
        if name.startswith("linear_")
    }
    linear, look = (
        linear | {"frequency_hz": frequency_hz},
        {"marker": "_", "markersize": 14, "linestyle": "none"},
    )
    if spec is not None and not np.isnan(linear["admittance_abs"]).all():
        band = np.geomspace(
            frequency_hz.min() / 2, min(2 * frequency_hz.max(), spec.tick_hz / 2), _LINEAR_POINTS
        )
        frequency, look = np.unique(np.concatenate([band, frequency_hz])), {}
        response = respond(loop_at_hand(spec), frequency)
        linear = {
            "frequency_hz": frequency,
            **complex_columns("admittance", response.admittance.ravel()),
        }
        linear |= complex_columns("impedance", response.impedance.ravel())
    slow, curves = float(np.median(columns["omega_Ts"] / frequency_hz)), []
    for values, name, style in (
        (linear, "linear loop", {"color": IDEAL, "linewidth": 0.9, **look}),
        (
            columns,
            "simulated",
            {"color": distinct_colour(0), "marker": "o", "markersize": 3, "linestyle": "none"},
        ),
    ):
        count = len(values["frequency_hz"])
        marks = {
            "omega_Ts": slow * values["frequency_hz"],
            "admittance_abs": 1e3 * values["admittance_abs"],
        }
        marks |= dict.fromkeys(("spec", "doubt"), np.full(count, "", object))
        marks |= dict.fromkeys(("admittance_error", "impedance_error"), np.zeros(count))
        curves.append(Curve({**values, **marks}, name, style))
    return draw_curves(curves, at_both_ports(facts), "frequency_hz", facts)
