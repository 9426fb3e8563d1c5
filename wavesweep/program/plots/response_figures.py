"""Figures of frequency responses, of tables and of curves of any origin."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.program.columns import SPARED, Columns, axes_of
from wavesweep.program.plots.figure_layout import where
from wavesweep.program.plots.labels import (
    assumption,
    at_hand,
    label,
    printed,
    shortened,
    valued,
    with_unit,
)
from wavesweep.program.plots.sampling import Blocks, shown_curves
from wavesweep.program.plots.scales import (
    by_factors,
    goes_by_factors,
    in_degrees,
    scale_magnitudes,
)
from wavesweep.program.plots.style import (
    FAINT_COLOUR,
    GRID,
    IDEAL,
    LINES,
    TWO_COLUMNS,
    distinct_look,
    family_looks,
    family_map,
    figure,
    fitting,
    is_narrow,
    note_below,
    paler,
    wide,
)

_MARKS = "osv^D<>p"
Say = Callable[[str], None]
_Response = tuple[str, dict[str, np.ndarray]]  # the values of the axes, in words, and the rows
_TOO_FAST = (
    "Left out: phases beyond which the frequencies are too far apart to tell how often they turn."
)
NYQUIST = "slow Nyquist frequency, {:.4g} Hz"


@dataclass(frozen=True)
class Curve:
    """The rows of one spec at one combination of the axes, the label and the style of their
    curve."""

    rows: dict[str, np.ndarray]
    label: str
    style: dict[str, Any]


@dataclass(frozen=True, eq=False)
class _Quantity:
    """What a pair of panels shows: the stem of its columns, the labels of magnitude and phase, and
    the unit of its curves.

    unit: None for all curves.
    """

    stem: str
    magnitude: str
    phase: str
    unit: str | None = None


def bode(table: Columns | Blocks, facts: Mapping[str, Any], say: Say = lambda _: None) -> Any:
    """Draw a `bode` table: magnitude and phase of admittance and impedance over Hz.

    Direct coupling at the fast rate is the ideal, dashed black. If a loop is unstable, its curve is
    faint. Inaccurate numbers are crossed out, unknown ones left out. Phases are those of the table,
    from -180 to 180 degrees, interrupted at the jumps; if these are many, phases go on (see
    `continued`). The static limit (0 Hz) is a mark at the left edge. One frequency is drawn over
    the axis that varies. More than a dozen curves have a scale of colours; of hundreds some are
    shown (see `shown_curves`). say: called with a sentence if some are left out.
    """
    columns, left_out = _shown(table, facts, say)
    columns = {**columns, "admittance_abs": 1e3 * columns["admittance_abs"]}
    return _drawn(columns, at_both_ports(facts), left_out, facts)


def at_both_ports(facts: Mapping[str, Any]) -> list[_Quantity]:
    """Admittance and impedance at the hand."""
    quantities = []
    for name, unit in (("admittance", "mm/N"), ("impedance", "N/m")):
        magnitude = at_hand(name, f"{name}_abs", unit, facts)
        quantities.append(_Quantity(name, magnitude, f"phase of {name} (deg)"))
    return quantities


def bode_ports(table: Columns | Blocks, facts: Mapping[str, Any], say: Say = lambda _: None) -> Any:
    """Draw a `bode-ports` table as `bode` draws one: a curve for each pair of input and output,
    and panels for each unit."""
    columns, left_out = _shown(table, facts, say)
    names = [
        f"{source} to {output}"
        for source, output in zip(columns["from_input"], columns["to_output"], strict=True)
    ]
    if len(set(columns["spec"].tolist())) > 1:
        names = [
            f"{shortened(spec)}: {name}" for spec, name in zip(columns["spec"], names, strict=True)
        ]
    quantities = []
    for unit in dict.fromkeys(columns["unit"].tolist()):
        magnitude = with_unit("magnitude", printed([unit or "1"]))
        quantities.append(_Quantity("response", magnitude, "phase (deg)", unit))
    return _drawn({**columns, "spec": np.array(names, object)}, quantities, left_out, facts)


def _shown(table, facts, say) -> tuple[Columns, str]:
    columns, left_out = shown_curves(table)
    if left_out:
        say(f"figure of {facts['spec_name']}: {left_out[0].lower()}{left_out[1:-1]}")
    return columns, left_out


def _drawn(
    columns: Columns, quantities: Sequence[_Quantity], left_out: str, facts: Mapping[str, Any]
) -> Any:
    """The figure of the curves of a table."""
    x = "frequency_hz"
    place = ""
    swept = _swept(columns)
    if swept and len(np.unique(columns["frequency_hz"])) == 1:
        x = swept[0]
        place = f"At {columns['frequency_hz'][0]:g} Hz."
    curves, scale = _curves(columns, x, facts)
    return draw_curves(curves, quantities, x, facts, scale, (place, left_out, assumption(facts)))


def draw_curves(
    curves: Sequence[Curve],
    quantities: Sequence[_Quantity],
    x: str,
    facts: Mapping[str, Any],
    scale: tuple[str, Any] | None = None,
    notes: Sequence[str] = (),
) -> Any:
    """A magnitude above a phase for each quantity; in a narrow figure all panels are below each
    other.

    scale: of the colours of many curves, and the axis that it is for.
    """
    over_frequency = x == "frequency_hz"
    marks = _marks(curves if over_frequency else [], facts)
    named = [curve.label for curve in curves if curve.label]
    marked_specs = [spec for mark in marks for spec in mark.colours]
    words = [*named, *marked_specs, NYQUIST.format(1e3) if over_frequency else ""]
    in_a_row = fitting(words, wide(TWO_COLUMNS))
    rows_of_legend = ceil(len(named) / in_a_row)
    across = 1 if is_narrow() else min(2, len(quantities))
    down = 2 * ceil(len(quantities) / across)
    too_fast = False
    # All phases of a figure are drawn on beyond 180 degrees, or none is.
    goes_on = False
    if over_frequency and not marked_specs:
        goes_on = any(_goes_on(_curves_of(quantity, curves), quantity) for quantity in quantities)
    with figure(TWO_COLUMNS, 2.0 * down + 0.17 * rows_of_legend) as canvas:
        grid = canvas.subplots(down, across, sharex=True, squeeze=False)
        pairs = np.stack([grid[::2].ravel(), grid[1::2].ravel()], axis=1)
        for axes in pairs[len(quantities) :].ravel():
            axes.set_visible(False)
        for number, (quantity, (above, below)) in enumerate(zip(quantities, pairs, strict=False)):
            of_quantity = _curves_of(quantity, curves)
            magnitude = (above, f"{quantity.stem}_abs", quantity.magnitude)
            phase = (below, f"{quantity.stem}_deg", quantity.phase)
            for axes, name, title in (magnitude, phase):
                marked = [mark.draw(axes, name) for mark in marks]
                too_fast |= _draw_panel(axes, of_quantity, name, x, marked, goes_on)
                axes.set_ylabel(title)
                if over_frequency:
                    _mark_nyquist(axes, curves, number == 0 and axes is above)
        for axes in pairs[: len(quantities)][-across:, 1]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("frequency (Hz)" if over_frequency else label(x, facts))
        canvas.align_ylabels()
        note_below(canvas, _TOO_FAST if too_fast else "", *notes)
        if scale is not None:
            canvas.colorbar(scale[1], ax=grid, label=label(scale[0], facts), aspect=40, pad=0.01)
        panels_with_others = pairs[:, 0]
        if quantities[0].unit is None:  # all panels of the hand have the same curves
            panels_with_others = pairs[:1, 0]
        _add_legend(canvas, panels_with_others, in_a_row)
    return canvas


def _add_legend(canvas: Any, panels: Iterable[Any], in_a_row: int) -> None:
    """Add the legend of the curves of some panels above all of them."""
    handles: list[Any] = []
    labels: list[str] = []
    for axes in panels:
        handles_here, labels_here = axes.get_legend_handles_labels()
        handles += handles_here
        labels += labels_here
    if handles:
        columns = min(in_a_row, len(handles))
        canvas.legend(handles, labels, loc="outside upper center", ncols=columns)


def _marks(curves: Sequence[Curve], facts: Mapping[str, Any]) -> list[Any]:
    """What was measured of the specs of the curves."""
    module = offered("marks")
    specs: dict[str, None] = {}
    for curve in curves:
        specs |= dict.fromkeys(curve.rows["spec"].tolist())
    if module:
        return [module.responses(facts, specs)]
    return []


def _curves_of(quantity: _Quantity, curves: Sequence[Curve]) -> list[Curve]:
    """The curves that are drawn in the panels of a quantity."""
    return [
        curve for curve in curves if quantity.unit is None or curve.rows["unit"][0] == quantity.unit
    ]


def _swept(columns: Columns) -> list[str]:
    """The axes that have several values, the longest first."""
    count = {
        name: len(np.unique(columns[name][~np.isnan(columns[name])]))
        for name in axes_of(columns, "spec")
    }
    return sorted((name for name in count if count[name] > 1), key=lambda name: -count[name])


def _jumps(degrees: np.ndarray) -> np.ndarray:
    """The places behind which a phase jumps from one end of its range to the other."""
    return np.flatnonzero(np.abs(np.diff(degrees)) > 180)


def continued(degrees: np.ndarray) -> np.ndarray:
    """A phase that goes on at 180 degrees; NaN from where its samples do not tell any more how
    often it turns."""
    degrees = degrees.astype(float)
    places = np.flatnonzero(~np.isnan(degrees))
    steps = (np.diff(degrees[places]) + 180) % 360 - 180
    degrees[places[1:]] = degrees[places[:1]] + np.cumsum(steps)
    sizes = np.pad(np.abs(steps), 1)
    larger_neighbour = np.maximum(sizes[:-2], sizes[2:])
    # Degrees between neighbours: a step of the first beside one of the second, as no resonance has
    # between two of its samples, may be whole turns more.
    fast = np.flatnonzero((sizes[1:-1] > 135.0) & (larger_neighbour > 60.0))
    if fast.size:
        degrees[places[fast[0] + 1] :] = np.nan
    return degrees


def _torn_where_it_wraps(places, phases):
    """The places and values of a phase, with NaN where it wraps, so that no line is drawn across
    the panel there."""
    jumps = _jumps(phases) + 1
    return np.insert(places.astype(float), jumps, np.nan), np.insert(phases, jumps, np.nan)


def _draw_panel(
    axes: Any, curves: list[Curve], name: str, x: str, marked: Sequence[np.ndarray], goes_on: bool
) -> bool:
    """Draw a magnitude or a phase; gives whether a phase turns too fast to be drawn.

    marked: places along the figure of what capabilities have marked in it. goes_on: whether phases
    are drawn on beyond 180 degrees.
    """
    everywhere = np.concatenate([curve.rows[x] for curve in curves]).astype(float)
    logarithmic = goes_by_factors(everywhere[everywhere > 0])
    everywhere = np.concatenate([everywhere, *marked])
    least_positive = everywhere[everywhere > 0].min(initial=np.inf)
    quantity, _, suffix = name.partition("_")
    is_phase = suffix == "deg"
    too_fast = False
    for curve in curves:
        rows = where(curve.rows, np.argsort(curve.rows[x], kind="stable"))
        places = rows[x]
        values = rows[name]
        if is_phase and goes_on:
            values = continued(rows[name])
            too_fast |= bool((np.isnan(values) & ~np.isnan(rows[name])).any())
        static = np.zeros(len(places), bool)
        if logarithmic and x == "frequency_hz":
            static = places == 0
        line = places[~static], values[~static]
        if is_phase and not goes_on:
            line = _torn_where_it_wraps(*line)
        _draw_line(axes, *line, curve)
        colour = curve.style["color"]
        # A static limit of 0 has no place on a scale of factors, and no phase.
        if (static & (rows[f"{quantity}_abs"] > 0)).any():
            mark = {"marker": "<", "markersize": 4, "clip_on": False, "zorder": 4}
            axes.plot(least_positive, values[static][0], **mark, color=colour)
        accurate = rows[f"{quantity}_error"] <= SPARED  # and the worst gain alone is lost
        crossed = (rows["doubt"] == "rounding") & ~accurate & ~static
        if crossed.any():
            axes.plot(places[crossed], values[crossed], "x", markersize=4, color=colour)
    if is_phase:
        in_degrees(axes, goes_on)
    else:
        scale_magnitudes(axes)
    low = least_positive if logarithmic else everywhere.min()
    high = everywhere.max()
    if logarithmic:
        by_factors(axes.xaxis, low, high)
    if high > everywhere.min():
        axes.set_xlim(low, high)
    axes.grid(which="major", **GRID)
    return too_fast


def _goes_on(curves: Sequence[Curve], quantity: _Quantity) -> bool:
    """Whether a phase of a quantity wraps often over frequency, in any of its curves."""
    for curve in curves:
        order = np.argsort(curve.rows["frequency_hz"], kind="stable")
        degrees = curve.rows[f"{quantity.stem}_deg"][order]
        # Jumps of a phase, up to which it stays between -180 and 180 degrees.
        if _jumps(degrees).size > 2:
            return True
    return False


def _draw_line(axes: Any, places: np.ndarray, values: np.ndarray, curve: Curve) -> None:
    """Draw a line with gaps at NaN, and a mark at each point that it does not join with others."""
    is_known = np.pad(~np.isnan(values), 1)
    alone = np.flatnonzero(is_known[1:-1] & ~is_known[:-2] & ~is_known[2:]).tolist()
    style = dict(curve.style)
    marked = "marker" in style
    if alone and not marked:
        style |= {"marker": "o", "markersize": 3, "markevery": alone}
    axes.plot(places, values, label=curve.label or None, **style)
    if alone and marked:  # in addition to the marks that distinguish the specs
        mark = {"marker": style["marker"], "linestyle": "none", "markersize": 3.5}
        axes.plot(places[alone], values[alone], **mark, color=style["color"])


def _mark_nyquist(axes: Any, curves: Sequence[Curve], named: bool) -> None:
    """A line at the Nyquist frequency of the slow rate (omega T_s is pi).

    There is none if the specs have different slow rates.
    """
    hertz = np.concatenate([curve.rows["frequency_hz"] for curve in curves])
    turns = np.concatenate([curve.rows["omega_Ts"] for curve in curves])
    slow = np.pi * hertz[hertz > 0] / turns[hertz > 0]
    if len(slow) and np.ptp(slow) <= 1e-9 * slow[0] and hertz.min() < slow[0] < 0.99 * hertz.max():
        words = {"label": NYQUIST.format(slow[0])} if named else {}
        axes.axvline(
            slow[0], color="0.45", linestyle=(0, (1, 2)), linewidth=1.0, zorder=1.5, **words
        )


def _curves(
    columns: Columns, x: str, facts: Mapping[str, Any]
) -> tuple[list[Curve], tuple[str, Any] | None]:
    """The curves and, if they are many, the axis that the scale of colours is for, and the
    scale."""
    axes = [name for name in _swept(columns) if name != x]
    specs = list(dict.fromkeys(columns["spec"].tolist()))
    by_spec = [_responses(where(columns, columns["spec"] == spec), axes, facts) for spec in specs]
    scale = None
    # Curves that a legend can tell apart; more have a scale of colours.
    if axes and sum(map(len, by_spec)) > 12:
        scale = (axes[0], _scale(columns[axes[0]]))
    curves = []
    for index, (spec, responses) in enumerate(zip(specs, by_spec, strict=True)):
        styles = _styles(index, responses, len(specs) > 1, scale)
        named: set[str] = set()
        for (place, rows), style in zip(responses, styles, strict=True):
            shown = place if len(responses) > 1 and scale is None else ""
            pieces = [rows] if x == "frequency_hz" else _by_stability(rows)
            for piece in pieces:
                curve = _curve(piece, spec, shown, style)
                if curve.label in named:
                    curve = replace(curve, label="")
                curves.append(curve)
                named.add(curve.label)
    return curves, scale


def _styles(
    index: int, responses: Sequence[_Response], several_specs: bool, scale: tuple[str, Any] | None
) -> list[dict[str, Any]]:
    """The styles of the responses of a spec; index: its place among the specs, scale: see
    `_curves`."""
    family = len(responses) > 1
    if scale is not None:
        axis, colours = scale
        thin = {"linestyle": LINES[index % len(LINES)], "linewidth": 0.8}
        if not family:
            return [{"color": distinct_look(index).colour, **thin}]
        return [{"color": colours.to_rgba(rows[axis][0]), **thin} for _, rows in responses]
    looks = family_looks(len(responses)) if family else [distinct_look(index)]
    marker: dict[str, Any] = {}
    if family and several_specs:
        marker = {"marker": _MARKS[index % len(_MARKS)], "markevery": 0.12, "markersize": 3.5}
    return [{"color": look.colour, "linestyle": look.line, **marker} for look in looks]


def _scale(values: np.ndarray) -> Any:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    numbers = values[~np.isnan(values)]
    by_factors_of_values = goes_by_factors(numbers[numbers > 0]) and numbers.min() > 0
    norm = LogNorm if by_factors_of_values else Normalize
    return ScalarMappable(norm(float(numbers.min()), float(numbers.max())), family_map())


def _responses(columns: Columns, axes: list[str], facts: Mapping[str, Any]) -> list[_Response]:
    """Return the rows of each combination of the axes, with its name; rows that an ignored axis
    repeats count once."""
    values = np.zeros((len(columns["spec"]), max(1, len(axes))))
    for number, name in enumerate(axes):
        values[:, number] = columns[name]
    values[np.isnan(values)] = np.inf  # an axis of other specs; NaN would not be equal to itself
    different, number_of = np.unique(values, axis=0, return_inverse=True)
    responses: dict[bytes, _Response] = {}
    for number, combination in enumerate(different):
        rows = where(columns, number_of.reshape(-1) == number)
        places = [
            (name, value)
            for name, value in zip(axes, combination, strict=False)
            if np.isfinite(value)
        ]
        place = ", ".join(valued(name, value, facts) for name, value in places)
        bytes_of_rows = b"".join(rows[name].tobytes() for name in rows if name.endswith("_re"))
        responses.setdefault(bytes_of_rows, (place, rows))
    return list(responses.values())


def _by_stability(rows: dict[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """The rows of stable and of unstable loops, if there are both; each has gaps where the
    others are."""
    stable = rows["stable"]
    if stable.all() or not stable.any():
        return [rows]
    swept = _swept(rows)
    numbers = [
        name for name, column in rows.items() if column.dtype.kind == "f" and name not in swept
    ]
    pieces = []
    for kind in (True, False):
        piece = dict(rows)
        for name in numbers:
            piece[name] = np.where(stable == kind, rows[name], np.nan)
        piece["stable"] = np.full(stable.size, kind)
        pieces.append(piece)
    return pieces


def _curve(rows: dict[str, np.ndarray], spec: str, place: str, style: dict[str, Any]) -> Curve:
    words = [shortened(spec)]
    if rows.get("controller", ("drawn",))[0] == "dc":
        style = {"color": IDEAL, "linestyle": "--", "zorder": 3}
        words = [f"{words[0]} (ideal)"]
    if place:
        words.append(place)
    if not rows["stable"].all():
        style = {**style, "color": paler(style["color"], FAINT_COLOUR)}
        refuted = (rows["doubt"] == "unstable").any()
        words.append("unstable" if refuted else "not known to be stable")
    return Curve(rows, ", ".join(words), style)
