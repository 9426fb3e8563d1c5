"""The figures of a simulation: forces, positions and energies over time, and the response next
to that of the linear loop."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import groupby
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np

from wavesweep.program.analyses.plane_columns import spec_of
from wavesweep.program.columns import Columns, age_column, complex_columns, run_column
from wavesweep.program.plots.labels import assumption, at_hand, printed, with_unit
from wavesweep.program.plots.sampling import MOST_PLACES, extremes
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
from wavesweep.simulation.measured_run import BESIDE
from wavesweep.simulation.table import set_in

_DETAIL_FRAMES = 40  # that a detail shows
FRAME = "length of the frame"  # in ticks, beside the columns


class Signal(NamedTuple):
    """A signal in a panel: its column, label and colour, and whether it is held over a tick."""

    column: str
    label: str
    colour: str
    held: bool


Panel = tuple[str, Sequence[Signal]]
"""The name of an axis, and its signals."""
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
    "slow wall": "wall",
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
    rows = [*_ports(columns, facts), *_at_the_hand(columns, facts)]
    rows = [(title, [*_with_measured(signals, columns)]) for title, signals in rows]
    rows += [*frames, *_messages(columns, facts)]
    if frames:
        columns = {**columns, FRAME: _lengths(columns)}
    wall = facts["spec"]["simulate"].get("wall")
    with figure(TWO_COLUMNS, (1.7 if is_narrow() else 1.6) * len(rows)) as canvas:
        grid = canvas.subplots(len(rows), len(spans), sharex="col", squeeze=False)
        for row, (title, signals) in zip(grid, rows, strict=True):
            for axes, span in zip(row, spans, strict=True):
                seen = {name: column[span] for name, column in columns.items()}
                wall_place = wall if title.startswith("position") else None
                # draw some signals in a panel, and a wall (m) as a line
                for signal in signals:
                    _draw_signal(axes, seen, signal, alone=len(signals) == 1)
                if wall_place is not None:
                    axes.axhline(
                        1e3 * wall_place, color=IDEAL, linewidth=0.8, linestyle="--", label="wall"
                    )
                axes.grid(**GRID)
                axes.margins(x=0)
            row[0].set_ylabel(title)
        for axes in grid[-1]:
            axes.set_xlabel("time (s)")
        if len(spans) > 1:
            grid[0, 0].axvspan(
                *columns["time_s"][spans[1]][[0, -1]], color=paler("0.75", 0.6), linewidth=0
            )
            grid[-1, 1].locator_params(axis="x", nbins=2)
            if is_narrow():
                grid[-1, 1].set_xlabel("shaded time (s)")
            else:
                grid[0, 1].set_title("the shaded stretch in detail")
        for row in grid:
            _draw_legend(canvas, row)
        warn_above(canvas, _unstable(facts))
        note_below(canvas, assumption(facts))
        canvas.align_ylabels()
    return canvas


def _with_measured(signals: Sequence[Signal], columns: Columns) -> Iterator[Signal]:
    """Yield signals, and each as a log has it below it."""
    for signal in signals:
        measured = f"{BESIDE}{signal.column}"
        if measured in columns:
            yield Signal(measured, f"{signal.label}, measured", paler("0.2", 0.6), True)
        yield signal


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
        transform = blended_transform_factory(canvas.transFigure, row[0].transAxes)
        place |= {
            "loc": "lower left",
            "bbox_to_anchor": (0.0, 0.98),
            "ncols": across,
            "columnspacing": 0.8,
        }
        place |= {"bbox_transform": transform}
        for axes in row:  # no power of ten above the panel, where the legend is
            if isinstance(axes.yaxis.get_major_formatter(), ScalarFormatter):
                axes.yaxis.set_major_formatter("{x:g}")
    if handles:
        row[0 if is_narrow() else -1].legend(handles, labels, fontsize=7, **place).set_in_layout(
            not is_narrow()
        )


def _at_the_hand(columns: Columns, facts: Mapping[str, Any]) -> Iterator[Panel]:
    """Yield the panels of what a simulation with a hand has."""
    words = _DRAWN if "block" in facts["spec"] else {}
    left_out = set() if "max_force" in facts["spec"]["simulate"] else {"f_device"}
    for name in ("f_h", "energy_hand"):
        if name in columns and not columns[name].any():
            left_out.add(name)
    if words and "f_m" in columns and np.array_equal(columns["f_m"], columns.get("F_s")):
        left_out.add("F_s")  # no other force than this one
    present = [panel for panel in _AT_THE_HAND if panel[2] in columns and panel[2] not in left_out]
    for (title, unit), rows in groupby(present, key=lambda row: row[:2]):
        signals = []
        for *_, name, usual, number, is_held in rows:
            signals.append(Signal(name, words.get(usual, usual), distinct_colour(number), is_held))
        yield at_hand(title, "", unit, facts), signals


def _ports(columns: Columns, facts: Mapping[str, Any]) -> list[Panel]:
    """Panels of inputs that are not at rest, of outputs, and of all other signals.

    Outputs of one unit and about one size share a panel, with the inputs that are like them.
    """
    fields = signals_of(facts).items()
    units = {
        name: field.unit
        for name, field in fields
        if name in columns and not name.startswith(BESIDE)
    }
    alike = _likeness(columns, units)
    ports = facts["spec"].get("ports", {})
    entries = [run_column("inputs", name) for name in ports.get("inputs", {})]
    listed = [run_column("outputs", name) for name in ports.get("outputs", {})]
    outputs = [name for name in listed if name in units]
    inputs = [name for name in entries if name in units and columns[name].any()]
    unlisted = [name for name in units if name not in (*entries, *listed)]
    groups = _groups_of(outputs, alike)
    panels: list[Panel] = []
    for name in inputs:
        if not any(alike(name, group[0]) for group in groups):
            panels.append(_panel(name, [name], inputs, units[name]))
    for group in groups:
        beside = [name for name in inputs if alike(name, group[0])]
        panels.append(_panel(", ".join(group), [*group, *beside], inputs, units[group[0]]))
    ages = [name for name in unlisted if name.startswith(age_column(""))]
    named = [name for name in unlisted if name not in ages]
    if named:
        panels.append(_panel("signals", named, inputs, None))
    if any(columns[name].any() for name in ages):
        panels.append(_panel("age of messages", ages, inputs, units[ages[0]]))
    return panels


def _likeness(columns: Columns, units: Mapping[str, str]) -> Callable[[str, str], bool]:
    """Tells of two signals whether they have one unit and about one size."""
    sizes = {}
    for name in units:
        column = columns[name]
        sizes[name] = np.abs(column).max(initial=0.0, where=np.isfinite(column))

    def alike(first: str, second: str) -> bool:
        low, high = sorted((sizes[first], sizes[second]))
        # A signal shares a panel with others up to 20 times as large.
        return units[first] == units[second] and (low == 0 or high <= 20.0 * low)

    return alike


def _groups_of(names: Sequence[str], alike: Callable[[str, str], bool]) -> list[list[str]]:
    """Signals in groups, in each of which all are alike; each joins the first group that it may."""
    groups: list[list[str]] = []
    for name in names:
        shared = [group for group in groups if all(alike(name, member) for member in group)]
        if shared:
            shared[0].append(name)
        else:
            groups.append([name])
    return groups


def _panel(title: str, names: Sequence[str], inputs: Collection[str], unit: str | None) -> Panel:
    """A panel of signals of a drawn loop; unit: None if they have several."""
    shown_unit = "" if unit is None else printed([unit or "1"])
    signals = []
    for number, name in enumerate(names):
        colour = IDEAL if name in inputs else distinct_colour(number)
        signals.append(Signal(name, name, colour, True))
    # Letters in a line of a panel's name.
    return "\n".join(wrap(with_unit(title, shown_unit), 20)), signals


def _frames(facts: Mapping[str, Any]) -> list[Panel]:
    """The panel of the lengths of frames, if these were drawn or measured."""
    if "frames" not in facts:
        return []
    return [("frame (ticks)", [Signal(FRAME, "frame", distinct_colour(0), True)])]


def _lengths(columns: Columns) -> np.ndarray:
    """The length of the frame that each tick is in; of the last one, which may go on, NaN."""
    number = columns["frame"]
    lengths = np.bincount(number - number[:1].sum(), minlength=1).astype(float)
    lengths[-1] = np.nan
    return lengths[number - number[:1].sum()]


def _messages(columns: Columns, facts: Mapping[str, Any]) -> list[Panel]:
    """The panel of how late messages or slow results come, if some do and it is known of which
    channel."""
    blocks = facts["spec"].get("block", {})
    channels = [name for name, block in blocks.items() if block["type"] == "channel"]
    if "late" not in columns or not columns["late"].any() or len(channels) > 1:
        return []
    label = f"messages of {channels[0]}" if channels else "slow results"
    return [("late (ticks)", [Signal("late", label, distinct_colour(0), False)])]


def _unstable(facts: Mapping[str, Any]) -> str:
    """The title of a run of a loop that is not known to be stable, or of one that stopped early;
    otherwise empty."""
    linear = facts.get("linear_loop", {"stable": True})
    stopped = facts.get("ticks", {}).get("stopped")
    said = []
    if not linear["stable"]:
        radius = linear.get("spectral_radius")
        if radius in (None, 1):  # numbers overflow, or rounding hides on which side of 1 it is
            said.append("not known to be stable")
        else:
            said.append(f"unstable: spectral radius {radius:.6g} per frame")
    if stopped:
        said.append(f"stopped, {stopped}")
    return "; ".join(said)


def _spans(columns: Columns, facts: Mapping[str, Any]) -> list[slice]:
    """Return the whole span, and that of the detail if it is shorter."""
    rows = len(columns["tick"])
    if "block" in facts["spec"]:  # of a drawn loop a frame may be a tick
        # Ticks at least, of a drawn loop.
        length = max(_DETAIL_FRAMES * (1 + int(columns["phase"].max(initial=0))), 800)
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
    if options["input"] in ("step", "pulse"):
        return set_in(columns, options["at_s"])
    return rows


def _draw_signal(axes: Any, columns: Columns, signal: Signal, *, alone: bool) -> None:
    """Draw a signal. It is left out if the controller does not have it; a held one is drawn with
    its steps.

    How late messages are is drawn as a dot in each tick. alone: whether no other signal is in the
    panel.
    """
    times, values = columns["time_s"], columns[signal.column]
    if signal.column.removeprefix(BESIDE) in ("x", "x_s"):
        values = 1e3 * values  # mm
    if np.isnan(values).all():
        return
    if signal.column == "late":
        # draw how late messages are, with their own ticks of the axis; lost ones are at -1
        look = {"color": signal.colour, "markersize": 2.5, "label": signal.label}
        axes.plot(*extremes(times, values), ".", **look)
        highest = max(int(values.max()), 0)
        places = list(range(0, highest + 1, max(1, round(highest / 4))))
        if (values < 0).any():
            places = [-1, *places]
        axes.set_yticks(places, ["lost" if place < 0 else f"{place}" for place in places])
        return
    before = len(axes.get_lines())
    # wide and pale, so that an energy on another is seen
    below = not before and not signal.held and not alone
    style = {"linestyle": LINES[before % len(LINES)], "linewidth": 1.8 if below else 0.9}
    if len(values) == 1:
        style["marker"] = "."
    if signal.held and 1 < len(values) <= MOST_PLACES:
        # the last value is held for a tick as well
        times = np.append(times, 2 * times[-1] - times[-2])
        values = np.append(values, values[-1])
        style["drawstyle"] = "steps-post"
    colour = paler(signal.colour, 0.5 if below else 1)
    axes.plot(*extremes(times, values), color=colour, label=signal.label, **style)


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
    linear = {"frequency_hz": frequency_hz}
    for name, column in columns.items():
        if name.startswith("linear_"):
            linear[name.removeprefix("linear_")] = column
    look: dict[str, Any] = {"marker": "_", "markersize": 14, "linestyle": "none"}
    if spec is not None and not np.isnan(linear["admittance_abs"]).all():
        highest = min(2 * frequency_hz.max(), spec.tick_hz / 2)
        # Points of the linear loop next to a simulation.
        band = np.geomspace(frequency_hz.min() / 2, highest, 800)
        frequency = np.unique(np.concatenate([band, frequency_hz]))
        response = respond(loop_at_hand(spec), frequency)
        linear = {"frequency_hz": frequency}
        linear |= complex_columns("admittance", response.admittance.ravel())
        linear |= complex_columns("impedance", response.impedance.ravel())
        look = {}
    slow = float(np.median(columns["omega_Ts"] / frequency_hz))
    line = {"color": IDEAL, "linewidth": 0.9, **look}
    dots = {"color": distinct_colour(0), "marker": "o", "markersize": 3, "linestyle": "none"}
    curves = []
    for values, name, style in ((linear, "linear loop", line), (columns, "simulated", dots)):
        count = len(values["frequency_hz"])
        marks = {"omega_Ts": slow * values["frequency_hz"]}
        marks["admittance_abs"] = 1e3 * values["admittance_abs"]
        marks |= dict.fromkeys(("spec", "doubt"), np.full(count, "", object))
        marks |= dict.fromkeys(("admittance_error", "impedance_error"), np.zeros(count))
        curves.append(Curve({**values, **marks}, name, style))
    return draw_curves(curves, at_both_ports(facts), "frequency_hz", facts)
