"""Figures of frequency responses, of tables and of curves of any origin."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesweep.capabilities import modules
from wavesweep.engine.stability.certificate import SPARED
from wavesweep.program.columns import Columns, axes_of
from wavesweep.program.plots.figure_layout import where
from wavesweep.program.plots.labels import assumption, at_hand, label, printed, shortened, valued, with_unit
from wavesweep.program.plots.sampling import Blocks, shown_curves
from wavesweep.program.plots.scales import add_decibels, by_factors, goes_by_factors, in_degrees, scale_magnitudes
from wavesweep.program.plots.style import (
    FAINT,
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

_MOST_CURVES = 12  # that a legend can tell apart; more have a scale of colours
_MARKS = "osv^D<>p"
_WRAPS = 2  # jumps of a phase, up to which it stays between -180 and 180 degrees
_TURN, _BESIDE = 135.0, 60.0  # degrees between neighbours: a step of the first beside one of the second, as no resonance has
# between two of its samples, may be whole turns more
Say = Callable[[str], None]
_Response = tuple[str, dict[str, np.ndarray]]  # the values of the axes, in words, and the rows
_TOO_FAST = "Left out: phases beyond which the frequencies are too far apart to tell how often they turn."
NYQUIST = "slow Nyquist frequency, {:.4g} Hz"


@dataclass(frozen=True)
class Curve:
    """The rows of one spec at one combination of the axes, the label and the style of their curve."""

    rows: dict[str, np.ndarray]
    label: str
    style: dict[str, Any]


@dataclass(frozen=True, eq=False)
class _Quantity:
    """What a pair of panels shows: the stem of its columns, the labels of magnitude and phase, and the unit of its curves.

    unit: None for all curves.
    """

    stem: str
    magnitude: str
    phase: str
    unit: str | None = None


def bode(table: Columns | Blocks, facts: Mapping[str, Any], say: Say = lambda _: None) -> Any:
    """Draw a `bode` table: magnitude and phase of admittance and impedance over Hz, with decibels at the right.

    Direct coupling at the fast rate is the ideal, dashed black. If a loop is unstable, its curve is faint. Inaccurate
    numbers are crossed out, unknown ones left out. Phases are those of the table, from -180 to 180 degrees, interrupted at the
    jumps; if these are many, phases go on (see `continued`). The static limit (0 Hz) is a mark at the left edge. One frequency
    is drawn over the axis that varies. More than a dozen curves have a scale of colours; of hundreds some are shown (see
    `shown_curves`). say: called with a sentence if some are left out.
    """
    columns, left_out = _shown(table, facts, say)
    columns = {**columns, "admittance_abs": 1e3 * columns["admittance_abs"]}
    return _drawn(columns, at_both_ports(facts), left_out, facts)


def at_both_ports(facts: Mapping[str, Any]) -> list[_Quantity]:
    """Admittance and impedance at the hand."""
    units = (("admittance", "mm/N"), ("impedance", "N/m"))
    return [_Quantity(name, at_hand(name, f"{name}_abs", unit, facts), f"phase of {name} (deg)") for name, unit in units]


def bode_ports(table: Columns | Blocks, facts: Mapping[str, Any], say: Say = lambda _: None) -> Any:
    """Draw a `bode-ports` table as `bode` draws one: a curve for each pair of input and output, and panels for each unit."""
    columns, left_out = _shown(table, facts, say)
    several = len(set(columns["spec"].tolist())) > 1
    pairs = zip(*(columns[name].tolist() for name in ("spec", "from_input", "to_output")), strict=True)
    names = [f"{shortened(spec)}: " * several + f"{source} to {output}" for spec, source, output in pairs]
    units = list(dict.fromkeys(columns["unit"].tolist()))
    quantities = [_Quantity("response", with_unit("magnitude", printed([unit or "1"])), "phase (deg)", unit) for unit in units]
    return _drawn({**columns, "spec": np.array(names, object)}, quantities, left_out, facts)


def _shown(table, facts, say) -> tuple[Columns, str]:
    columns, left_out = shown_curves(table)
    if left_out:
        say(f"figure of {facts['spec_name']}: {left_out[0].lower()}{left_out[1:-1]}")
    return columns, left_out


def _drawn(columns: Columns, quantities: Sequence[_Quantity], left_out: str, facts: Mapping[str, Any]) -> Any:
    """The figure of the curves of a table."""
    single = len(np.unique(columns["frequency_hz"])) == 1
    x = next(iter(_swept(columns)), "frequency_hz") if single else "frequency_hz"  # or the longest axis
    curves, scale = _curves(columns, x, facts)
    place = "" if x == "frequency_hz" else f"At {columns['frequency_hz'][0]:g} Hz."
    return draw_curves(curves, quantities, x, facts, scale, (place, left_out, assumption(facts)))


def draw_curves(
    curves: Sequence[Curve],
    quantities: Sequence[_Quantity],
    x: str,
    facts: Mapping[str, Any],
    scale: tuple[str, Any] | None = None,
    notes: Sequence[str] = (),
) -> Any:
    """A magnitude above a phase for each quantity; in a narrow figure all panels are below each other.

    scale: of the colours of many curves, and the axis that it is for.
    """
    specs = dict.fromkeys(name for curve in curves for name in curve.rows["spec"].tolist())
    marks = [module.responses(facts, specs if x == "frequency_hz" else ()) for module in modules("marks")]
    named = [curve.label for curve in curves if curve.label]
    words = [*named, *(spec for mark in marks for spec in mark.colours), NYQUIST.format(1e3) if x == "frequency_hz" else ""]
    in_a_row = fitting(words, wide(TWO_COLUMNS))
    across = 1 if is_narrow() else min(2, len(quantities))
    shape = 2 * -(-len(quantities) // across), across
    too_fast = False
    with figure(TWO_COLUMNS, 2.0 * shape[0] + 0.17 * -(-len(named) // in_a_row)) as canvas:
        grid = canvas.subplots(*shape, sharex=True, squeeze=False)
        pairs = np.stack([grid[::2].ravel(), grid[1::2].ravel()], axis=1)
        # All phases of a figure are drawn on beyond 180 degrees, or none is.
        goes_on = (
            x == "frequency_hz"
            and not any(mark.colours for mark in marks)
            and any(_goes_on(curves, quantity) for quantity in quantities)
        )
        for axes in pairs[len(quantities) :].ravel():
            axes.set_visible(False)
        for number, (quantity, (above, below)) in enumerate(zip(quantities, pairs, strict=False)):
            of_quantity = [curve for curve in curves if quantity.unit is None or curve.rows["unit"][0] == quantity.unit]
            for axes, suffix, title in ((above, "abs", quantity.magnitude), (below, "deg", quantity.phase)):
                name = f"{quantity.stem}_{suffix}"
                marked = [mark.draw(axes, name) for mark in marks]
                too_fast |= _draw_panel(axes, of_quantity, name, x, marked, goes_on)
                axes.set_ylabel(title)
                if x == "frequency_hz":
                    _mark_nyquist(axes, curves, number == 0 and axes is above)
            add_decibels(above)
        for axes in pairs[: len(quantities)][-across:, 1]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("frequency (Hz)" if x == "frequency_hz" else label(x, facts))
        canvas.align_ylabels()
        note_below(canvas, _TOO_FAST if too_fast else "", *notes)
        if scale is not None:
            canvas.colorbar(scale[1], ax=grid, label=label(scale[0], facts), aspect=40, pad=0.01)
        # All panels of the hand have the same curves.
        _draw_legend(canvas, pairs[: 1 if quantities[0].unit is None else None, 0], in_a_row)
    return canvas


def _draw_legend(canvas: Any, panels: Sequence[Any], in_a_row: int) -> None:
    """Draw one legend of the curves of these panels."""
    entries = [entry for axes in panels for entry in zip(*axes.get_legend_handles_labels(), strict=True)]
    if entries:
        handles, labels = zip(*entries, strict=True)
        canvas.legend(handles, labels, loc="outside upper center", ncols=min(in_a_row, len(handles)))


def _swept(columns: Columns) -> list[str]:
    """The axes that have several values, the longest first."""
    count = {name: len(np.unique(columns[name][~np.isnan(columns[name])])) for name in axes_of(columns, "spec")}
    return sorted((name for name in count if count[name] > 1), key=lambda name: -count[name])


def _jumps(degrees: np.ndarray) -> np.ndarray:
    """The places behind which a phase jumps from one end of its range to the other."""
    return np.flatnonzero(np.abs(np.diff(degrees)) > 180)


def continued(degrees: np.ndarray) -> np.ndarray:
    """A phase that goes on at 180 degrees; NaN from where its samples do not tell any more how often it turns."""
    degrees = degrees.astype(float)
    places = np.flatnonzero(~np.isnan(degrees))
    steps = (np.diff(degrees[places]) + 180) % 360 - 180
    sizes = np.pad(np.abs(steps), 1)
    fast = np.flatnonzero((sizes[1:-1] > _TURN) & (np.maximum(sizes[:-2], sizes[2:]) > _BESIDE))
    degrees[places[1:]] = degrees[places[:1]] + np.cumsum(steps)
    degrees[places[fast[0] + 1] if fast.size else degrees.size :] = np.nan
    return degrees


def _draw_panel(axes: Any, curves: list[Curve], name: str, x: str, marked: Sequence[np.ndarray], goes_on: bool) -> bool:
    """Draw a magnitude or a phase; gives whether a phase turns too fast to be drawn.

    marked: places along the figure of what capabilities have marked in it. goes_on: whether phases are drawn on beyond 180
    degrees.
    """
    everywhere = np.concatenate([curve.rows[x] for curve in curves]).astype(float)
    logarithmic = goes_by_factors(everywhere[everywhere > 0])
    everywhere = np.concatenate([everywhere, *marked])
    positive = everywhere[everywhere > 0].min(initial=np.inf)
    ordered = [where(curve.rows, np.argsort(curve.rows[x], kind="stable")) for curve in curves]
    phase, too_fast = name.endswith("_deg"), False
    goes_on &= phase
    for curve, rows in zip(curves, ordered, strict=True):
        quantity = name.partition("_")[0]
        places, values = rows[x], continued(rows[name]) if goes_on else rows[name]
        too_fast |= bool((np.isnan(values) & ~np.isnan(rows[name])).any())
        lost = (rows["doubt"] == "rounding") & ~(rows[f"{quantity}_error"] <= SPARED)  # and not the worst gain alone
        static = places == 0 if logarithmic and x == "frequency_hz" else np.zeros(len(places), bool)
        line = (places[~static], values[~static])
        if phase and not goes_on:  # no line is drawn across the panel where a phase wraps
            jumps = _jumps(line[1]) + 1
            line = np.insert(line[0].astype(float), jumps, np.nan), np.insert(line[1], jumps, np.nan)
        _draw_line(axes, *line, curve)
        edge = {"color": curve.style["color"]}
        # A static limit of 0 has no place on a scale of factors, and no phase.
        if (static & (rows[f"{quantity}_abs"] > 0)).any():
            axes.plot(positive, values[static][0], marker="<", markersize=4, clip_on=False, zorder=4, **edge)
        crossed = lost & ~static
        if crossed.any():
            axes.plot(places[crossed], values[crossed], "x", markersize=4, **edge)
    if name.endswith("_abs"):
        scale_magnitudes(axes)
    else:
        in_degrees(axes, goes_on)
    _scale_along(axes, positive if logarithmic else everywhere.min(), everywhere, logarithmic)
    axes.grid(which="major", **GRID)
    return too_fast


def _scale_along(axes: Any, low: float, places: np.ndarray, logarithmic: bool) -> None:
    """Give the axis along a panel its scale, and its ends if it has several places; low: the lower one."""
    if logarithmic:
        by_factors(axes.xaxis, low, places.max())
    if places.max() > places.min():
        axes.set_xlim(low, places.max())


def _goes_on(curves: Sequence[Curve], quantity: _Quantity) -> bool:
    """Whether a phase of a quantity wraps often over frequency."""
    of_quantity = (curve.rows for curve in curves if quantity.unit is None or curve.rows["unit"][0] == quantity.unit)
    phases = (rows[f"{quantity.stem}_deg"][np.argsort(rows["frequency_hz"], kind="stable")] for rows in of_quantity)
    return any(_jumps(degrees).size > _WRAPS for degrees in phases)


def _draw_line(axes: Any, places: np.ndarray, values: np.ndarray, curve: Curve) -> None:
    """Draw a line with gaps at NaN, and a mark at each point that it does not join with others."""
    is_known = np.pad(~np.isnan(values), 1)
    alone = np.flatnonzero(is_known[1:-1] & ~is_known[:-2] & ~is_known[2:]).tolist()
    marked = "marker" in curve.style
    style = curve.style | ({"marker": "o", "markersize": 3, "markevery": alone} if alone and not marked else {})
    axes.plot(places, values, label=curve.label or None, **style)
    if alone and marked:  # in addition to the marks that distinguish the specs
        axes.plot(places[alone], values[alone], curve.style["marker"], markersize=3.5, color=curve.style["color"])


def _mark_nyquist(axes: Any, curves: Sequence[Curve], named: bool) -> None:
    """A line at the Nyquist frequency of the slow rate (omega T_s is pi); none if the specs have different slow rates."""
    hertz, turns = (np.concatenate([curve.rows[name] for curve in curves]) for name in ("frequency_hz", "omega_Ts"))
    slow = np.pi * hertz[hertz > 0] / turns[hertz > 0]
    if len(slow) and np.ptp(slow) <= 1e-9 * slow[0] and hertz.min() < slow[0] < 0.99 * hertz.max():
        words = {"label": NYQUIST.format(slow[0])} if named else {}
        axes.axvline(slow[0], color="0.45", linestyle=(0, (1, 2)), linewidth=1.0, zorder=1.5, **words)


def _curves(columns: Columns, x: str, facts: Mapping[str, Any]) -> tuple[list[Curve], tuple[str, Any] | None]:
    """The curves and, if they are many, the axis that the scale of colours is for, and the scale."""
    axes = [name for name in _swept(columns) if name != x]
    specs = list(dict.fromkeys(columns["spec"].tolist()))
    by_spec = [_responses(where(columns, columns["spec"] == spec), axes, facts) for spec in specs]
    several = len(axes) > 0 and sum(map(len, by_spec)) > _MOST_CURVES
    scale = (axes[0], _scale(columns[axes[0]])) if several else None
    curves = []
    for index, (spec, responses) in enumerate(zip(specs, by_spec, strict=True)):
        styles = _styles(index, responses, len(specs) > 1, scale)
        named: set[str] = set()
        for (place, rows), style in zip(responses, styles, strict=True):
            shown = place if len(responses) > 1 and scale is None else ""
            for piece in _by_stability(rows) if x != "frequency_hz" else [rows]:
                curve = _curve(piece, spec, shown, style)
                curves.append(replace(curve, label="") if curve.label in named else curve)
                named.add(curve.label)
    return curves, scale


def _styles(
    index: int, responses: Sequence[_Response], several_specs: bool, scale: tuple[str, Any] | None
) -> list[dict[str, Any]]:
    """The styles of the responses of a spec; index: its place among the specs, scale: see `_curves`."""
    family = len(responses) > 1
    looks = family_looks(len(responses)) if family else [distinct_look(index)]
    if scale is None:
        marker = (
            {"marker": _MARKS[index % len(_MARKS)], "markevery": 0.12, "markersize": 3.5} if family and several_specs else {}
        )
        return [{"color": look.colour, "linestyle": look.line} | marker for look in looks]
    axis, colours = scale
    thin = {"linestyle": LINES[index % len(LINES)], "linewidth": 0.8}
    if not family:
        return [{"color": looks[0].colour} | thin]
    return [{"color": colours.to_rgba(rows[axis][0])} | thin for _, rows in responses]


def _scale(values: np.ndarray) -> Any:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    finite = values[~np.isnan(values)]
    norm = LogNorm if goes_by_factors(finite[finite > 0]) and finite.min() > 0 else Normalize
    return ScalarMappable(norm(float(finite.min()), float(finite.max())), family_map())


def _responses(columns: Columns, axes: list[str], facts: Mapping[str, Any]) -> list[_Response]:
    """Return the rows of each combination of the axes, with its name; rows that an ignored axis repeats count once."""
    values = np.stack([columns[name].astype(float) for name in axes] or [np.zeros(len(columns["spec"]))], axis=1)
    values = np.where(np.isnan(values), np.inf, values)  # an axis of other specs; NaN would not be equal to itself
    different, number_of = np.unique(values, axis=0, return_inverse=True)
    responses: dict[bytes, _Response] = {}
    for number, combination in enumerate(different):
        rows = where(columns, number_of.reshape(-1) == number)
        places = [(name, value) for name, value in zip(axes, combination, strict=False) if np.isfinite(value)]
        place = ", ".join(valued(name, value, facts) for name, value in places)
        responses.setdefault(b"".join(rows[name].tobytes() for name in rows if name.endswith("_re")), (place, rows))
    return list(responses.values())


def _by_stability(rows: dict[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """The rows of stable and of unstable loops, if there are both; each has gaps where the others are."""
    stable, places = rows["stable"], _swept(rows)
    if stable.all() or not stable.any():
        return [rows]
    numbers = [name for name, column in rows.items() if column.dtype.kind == "f" and name not in places]
    return [
        {
            **rows,
            **{name: np.where(stable == kind, rows[name], np.nan) for name in numbers},
            "stable": np.full(stable.size, kind),
        }
        for kind in (True, False)
    ]


def _curve(rows: dict[str, np.ndarray], spec: str, place: str, style: dict[str, Any]) -> Curve:
    ideal, stable = rows.get("controller", ("drawn",))[0] == "dc", rows["stable"].all()
    if ideal:
        style = {"color": IDEAL, "linestyle": "--", "zorder": 3}
    name = shortened(spec)
    state = "" if stable else "unstable" if (rows["doubt"] == "unstable").any() else "not known to be stable"
    words = [f"{name} (ideal)" if ideal else name, place, state]
    return Curve(rows, ", ".join(filter(None, words)), style if stable else {**style, "color": paler(style["color"], FAINT)})
