"""The figure of a comparison: stable walls and their feel, and the responses, a colour per spec."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.columns import Columns
from wavesweep.plots.layout import is_logarithmic
from wavesweep.plots.measured import (
    coloured,
    draw_responses,
    draw_walls,
    highest,
    response_handle,
    response_points,
    wall_handles,
    walls_by_kind,
)
from wavesweep.plots.planes import view_of
from wavesweep.plots.refine import Curve, Interval, curves_of
from wavesweep.plots.responses import rounded
from wavesweep.plots.style import (
    DOUBTFUL,
    TWO_COLUMNS,
    at_hand,
    by_factors,
    distinct_colour,
    family_colours,
    figure,
    fitting,
    incomplete,
    label,
    note_assumptions,
    printed,
    shortened,
    symbol,
    valued,
    wide,
    with_unit,
)
from wavesweep.spec.keys import KEYS
from wavesweep.tables.columns import felt_unit, unlike_units

_WALLS = (("high", "low"), ("felt_high", "felt_low"))
_RESPONSES = (("admittance_abs", "admittance", "mm/N"), ("impedance_abs", "impedance", "N/m"))
_MARKERS = "os^Dv<>P"
_DASHES = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)))
_CLIPPED = {"marker": "o", "markersize": 3, "markerfacecolor": "white", "linestyle": ""}
_LOWER = {"linestyle": ":", "linewidth": 0.8}
_DOUBTED = {"marker": "x", "markersize": 3, "color": DOUBTFUL, "linestyle": ""}
_FAINT = 0.35  # opacity
_FEW = 25  # samples of a curve up to which each is marked
_MOST_NAMED = 8  # values of the other axes in the legend
_ALONE = "black"  # the colour of a spec without values of its own where others have them

Key = tuple[tuple[str, float], ...]  # the values of the axes that vary besides the one that is drawn over


def compare(
    columns: Columns,
    facts: Mapping[str, Any],
    responses: Columns | None = None,
    of_responses: Mapping[str, Any] | None = None,
) -> Any:
    """Draw a `compare` table; responses, of_responses: columns and facts of its `compare-bode`, drawn below if they are given.

    Above are the ends of all stable intervals of K_VE, and the static stiffness that the hand feels there, over the damping of
    the wall, or else the first axis that has several values; those of a spec without that axis are lines from side to side.
    Samples are joined by a line if they have equally many intervals. If the swept range and not the loop ends an interval, its
    end is hollow. Responses of unstable loops are faint. If further axes vary, colours are their values, and specs differ by
    their marks and dashes alone.
    """
    specs = list(dict.fromkeys(columns["spec"].tolist()))
    if responses is not None:
        responses = {**responses, "admittance_abs": 1e3 * responses["admittance_abs"]}
    height = 2.9 if responses is None else 5.2
    with figure(TWO_COLUMNS, height) as canvas:
        grid = canvas.subplots(1 if responses is None else 2, 2, squeeze=False)
        title_of_x, places, over_damping = _abscissa(columns, facts, specs)
        looks = _Looks(specs, _keys(columns, responses, places, specs))
        tables = facts.get("specs") or {specs[0]: facts.get("spec", {})}
        curves = {
            spec: _curves_over(_rows_of(columns, spec), places[spec], tables.get(spec, {}), 0.75 * height / len(grid))
            for spec in specs
        }
        unit = printed(unlike_units(facts).get("felt_high", (felt_unit(facts),)))
        for axes, names, title in zip(grid[0], _WALLS, (f"ends of stable {_stiffness(columns)}", "felt there"), strict=True):
            _walls(axes, columns, curves, names, looks)
            axes.set_xlabel(title_of_x)
            axes.set_ylabel(with_unit(title, unit))
        measured = _measured(grid[0, 0], facts, looks) if over_damping else []
        for axes, (name, title, of_port) in zip(grid[1] if responses is not None else (), _RESPONSES, strict=False):
            _curves(axes, responses, looks, name)
            draw_responses(axes, facts, name, {spec: looks.of(spec, ())["color"] for spec in specs})
            axes.set_ylabel(at_hand(title, name, of_port, of_responses or facts))
        for axes in grid.flat:
            axes.grid(visible=True, color="0.9", linewidth=0.5)
        canvas.align_ylabels()
        handles, labels = _handles(looks, columns, responses, facts)
        if any(response_points(facts, spec) for spec in specs):
            measured.append(response_handle())
        handles, labels = [*handles, *measured], [*labels, *(each.get_label() for each in measured)]
        canvas.legend(handles, labels, loc="outside lower center", ncols=min(4, fitting(labels, wide(TWO_COLUMNS))))
        note_assumptions(canvas, facts)
    return canvas


def _measured(axes: Any, facts: Mapping[str, Any], looks: _Looks) -> list[Any]:
    """Draw the walls that were measured of each spec, and give their entries of the legend."""
    colours = coloured(facts, "z_width", {spec: looks.of(spec, ())["color"] for spec in looks.specs})
    walls = {spec: walls_by_kind(facts, spec) for spec in colours}
    if not walls:
        return []
    axes.set_ylim(0, max(axes.get_ylim()[1], 1.06 * max(map(highest, walls.values()))))
    spans = axes.get_xlim(), axes.get_ylim()
    for spec, each in walls.items():
        draw_walls(axes, each, colours[spec])
    kinds = dict.fromkeys(kind for each in walls.values() for kind in each)
    together = {kind: np.hstack([each[kind] for each in walls.values() if kind in each]) for kind in kinds}
    return wall_handles(together, *spans, "black" if len(walls) == 1 else "0.4")


def _stiffness(columns: Columns) -> str:
    """The name of the wall's stiffness, if all specs have the same."""
    names = set(columns["along"].tolist())
    return symbol(names.pop()) if len(names) == 1 else "stiffness of the wall"


def _handles(
    looks: _Looks, columns: Columns, responses: Columns | None, facts: Mapping[str, Any]
) -> tuple[list[Any], list[str]]:
    """The entries of the legend: the specs, the values of further axes, and the other marks that the figure has."""
    from matplotlib.lines import Line2D

    stable, grey = columns["intervals"] > 0, {"color": "0.4"}
    clipped = stable & np.isnan(columns["high_omega"])
    ended = ", or nothing is known beyond" if (clipped & incomplete(columns)).any() else ""
    marks = [
        (clipped, _CLIPPED | grey, f"the swept range ends it{ended}"),
        (stable & (columns["low"] > 0), _LOWER | grey, "lower end of a further interval"),
        (~columns["certified"] & stable, _DOUBTED, "not certified"),
    ]
    if responses is not None:
        marks.append((~responses["stable"], grey | {"alpha": _FAINT}, "faint: unstable"))
    entries = [(looks.of(spec, ()), shortened(spec)) for spec in looks.specs]
    chosen = np.unique(np.linspace(0, len(looks.colours) - 1, _MOST_NAMED).round().astype(int)) if looks.colours else ()
    for key, colour in [list(looks.colours.items())[at] for at in chosen]:
        entries.append(({"color": colour, "linewidth": 2}, ", ".join(valued(*each, facts) for each in key)))
    entries += [(look, said) for rows, look, said in marks if rows.any()]
    return [Line2D([], [], **look) for look, _ in entries], [said for _, said in entries]


class _Looks:
    """Colour, marker and dashes of each spec or, if further axes vary, its marker and dashes, and a colour of each value."""

    def __init__(self, specs: list[str], keys: list[Key]) -> None:
        self.specs, self.colours = specs, dict(zip(keys, family_colours(len(keys)), strict=True))

    def of(self, spec: str, key: Key) -> dict[str, Any]:
        """The look of the curve of a spec at some values."""
        number = self.specs.index(spec)
        colour = distinct_colour(number)
        if self.colours:
            colour = self.colours[key] if key else _ALONE
        return {
            "color": colour, "marker": _MARKERS[number % len(_MARKERS)], "markersize": 3,
            "linestyle": _DASHES[number % len(_DASHES)],
        }  # fmt: skip


def _keys(columns: Columns, responses: Columns | None, places: Mapping[str, np.ndarray], specs: list[str]) -> list[Key]:
    """The different values of further axes, of all curves."""
    found: dict[Key, None] = {}
    for spec in specs:
        rows = _rows_of(columns, spec)
        found |= dict.fromkeys(key for key, _ in _split(rows, _others(rows, places[spec])))
        if responses is not None:
            found |= dict.fromkeys(key for key, _ in _split(_rows_of(responses, spec), _beside(responses)))
    return sorted(key for key in found if key)


def _rows_of(columns: Columns, spec: str) -> Columns:
    return {key: column[columns["spec"] == spec] for key, column in columns.items()}


def _others(rows: Columns, place: np.ndarray) -> list[str]:
    """The axes of a spec that the figure is not drawn over."""
    return [name for name in _axes_of(rows) if not np.array_equal(rows[name], place, equal_nan=True)]


def _beside(responses: Columns) -> list[str]:
    return list(responses)[: list(responses).index("spec")]


def _axes_of(columns: Columns) -> list[str]:
    names = list(columns)
    return names[1 : names.index("along")]


def _abscissa(columns: Columns, facts: Mapping[str, Any], specs: list[str]) -> tuple[str, dict[str, np.ndarray], bool]:
    """The title of the axis to draw over, where it puts the rows of each spec, NaN without a place, and whether it is damping.

    The title is empty if no axis has several values.

    It is the damping of the wall, which a drawn loop calls by the name in its [ports], or else the first with several values.
    """
    several = [name for name in _axes_of(columns) if len(np.unique(columns[name][~np.isnan(columns[name])])) > 1]
    dampings = {spec: _damping(facts.get("specs", {}).get(spec, {})) for spec in specs}
    x = next((name for name in ("B_VE", *(name for name, *_ in dampings.values())) if name in several), None)
    if x:
        title = with_unit(symbol(x), printed(dict.fromkeys(unit for *_, unit in dampings.values())))
    else:
        dampings = dict.fromkeys(specs, (next(iter(several), None), np.nan, ""))
        title = label(several[0], facts) if several else ""
    places = {}
    for spec, (name, value, _) in dampings.items():
        rows = columns["spec"] == spec
        found = columns[name][rows] if name in columns else np.full(rows.sum(), np.nan)
        places[spec] = np.where(np.isnan(found), value, found)
    return title, places, x is not None


def _damping(spec: Mapping[str, Any]) -> tuple[str, float, str]:
    """The number of a spec that is the damping of its wall, its own value, NaN if there is none, and its unit."""
    name = spec.get("ports", {}).get("wall", {}).get("damping")
    if name is None:
        return "B_VE", spec.get("environment", {}).get("B_VE", np.nan), KEYS["environment.B_VE"].unit
    return name, spec["numbers"][name]["value"], spec["numbers"][name]["unit"]


def _curves_over(rows: Columns, place: np.ndarray, tables: Mapping[str, Any], height: float) -> list[tuple[Key, Columns]]:
    """The rows of each curve of a spec, with further ones between them as `refine` computes these; "" is where they are.

    place: of the rows, see `_abscissa`. tables: of the spec. height: of a panel, inches. `given` marks rows of the table.
    """
    members = [
        (key, {**each, "given": each["interval"] >= 0}) for key, each in _split({**rows, "": place}, _others(rows, place))
    ]
    x = next((name for name in _axes_of(rows) if np.array_equal(rows[name], place)), "")
    if not x or len(np.unique(place)) < 2:
        return members
    view = view_of(x, is_logarithmic(place), wide(TWO_COLUMNS) / 2, height)
    curves = curves_of([each for _, each in members], view, {"spec": tables})
    return [(key, _rows_of_curve(curve, set(each[""].tolist()))) for (key, each), curve in zip(members, curves, strict=True)]


def _rows_of_curve(curve: Curve, given: set[float]) -> Columns:
    """The rows of a curve; given: the places that the table has."""
    none = Interval(np.nan, np.nan, False, False, certified=True)
    found = [(x, n, len(some), each) for x, some, _ in curve.slices() for n, each in enumerate(some or (none,))]
    columns = {name: np.array([getattr(each, name) for *_, each in found]) for name in ("low", "high", "felt_low", "felt_high")}
    columns |= {name: np.array([row[at] for row in found]) for at, name in enumerate(("", "interval", "intervals"))}
    columns["high_omega"] = np.array([0.0 if each.high_real else np.nan for *_, each in found])
    columns["certified"] = np.array([each.certified for *_, each in found])
    return columns | {"given": np.array([x in given for x, *_ in found])}


def _walls(axes: Any, columns: Columns, curves: Mapping[str, list], names: tuple[str, str], looks: _Looks) -> None:
    """curves: of each spec, see `_curves_over`."""
    everywhere = np.concatenate([curve[""] for some in curves.values() for _, curve in some])
    known = everywhere[~np.isnan(everywhere)]
    for number, (spec, some) in enumerate(curves.items()):
        for key, curve in some:
            across, count = curve[""], len(curve["high"])
            if not known.size:
                across = np.full(count, float(number))
            both = known.size and np.isnan(across).any()  # a line from side to side
            if both:
                across = np.repeat([known.min(), known.max()], count)
            tiled = {name: np.tile(each, 2) if both else each for name, each in curve.items()}
            _ends(axes, across, tiled, names, looks.of(spec, key))
    if is_logarithmic(known):
        by_factors(axes.xaxis, known.min(), known.max())
    axes.set_ylim(0, 1.06 * max(np.nanmax(columns[names[0]], initial=0.0), 1e-3))
    if not known.size:
        axes.set_xticks(range(len(curves)), list(curves))


def _split(rows: Columns, others: list[str]) -> Iterator[tuple[Key, dict[str, np.ndarray]]]:
    """Yield the rows of each combination of the other axes, and its values of those that vary."""
    if not others:
        yield (), dict(rows)
        return
    keys = np.nan_to_num(np.stack([rows[name] for name in others], axis=1).astype(float), nan=-1.0)
    different, which = np.unique(keys, axis=0, return_inverse=True)
    varied = np.flatnonzero(np.ptp(different, axis=0) > 0).tolist()
    for number, values in enumerate(different):
        chosen = which.reshape(-1) == number
        yield tuple((others[at], float(values[at])) for at in varied), {key: column[chosen] for key, column in rows.items()}


def _ends(axes: Any, across: np.ndarray, curve: Columns, names: tuple[str, str], style: Mapping[str, Any]) -> None:
    """Draw upper and lower ends.

    Samples are not joined if they have different numbers of intervals, or intervals apart: one begins or ends in between.
    """
    few, given = len(np.unique(across[curve["given"]])) <= _FEW, curve["given"]
    for number in range(int(curve["intervals"].max(initial=0))):
        here = np.flatnonzero((curve["interval"] == number) & (curve["intervals"] > 0))
        here = here[np.argsort(across[here], kind="stable")]
        at, clipped = across[here], np.isnan(curve["high_omega"][here])
        ordinal = np.searchsorted(np.unique(across), at)
        low, high = curve["low"][here], curve["high"][here]
        apart = (low[1:] > high[:-1]) | (high[1:] < low[:-1])
        cuts = np.flatnonzero((np.diff(curve["intervals"][here]) != 0) | (np.diff(ordinal) > 1) | apart) + 1
        for part in np.split(np.arange(len(at)), cuts):
            every = {"markevery": np.flatnonzero(given[here][part])}
            marker = style["marker"] if few or len(part) == 1 else ""
            axes.plot(at[part], curve[names[0]][here][part], **{**style, "marker": marker}, **every)
            below = np.where(low > 0, curve[names[1]][here], np.nan)[part]
            axes.plot(at[part], below, **_LOWER, color=style["color"], marker=marker and ".", markersize=2, **every)
        lost = ~curve["certified"][here]
        axes.plot(at[lost], curve[names[0]][here][lost], **_DOUBTED)
        shown = clipped & given[here]
        shown = shown if few else shown & (np.arange(len(at)) % max(1, len(at) // _FEW) == 0)
        axes.plot(at[shown], curve[names[0]][here][shown], **{**style, "linestyle": "", "markerfacecolor": "white"})


def _curves(axes: Any, columns: Columns, looks: _Looks, name: str) -> None:
    least = columns["frequency_hz"][columns["frequency_hz"] > 0].min(initial=np.inf)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for spec in looks.specs:
        for key, curve in _split(_rows_of(columns, spec), _beside(columns)):
            shown = (curve["frequency_hz"] > 0) & (curve[name] > 0)
            alpha = 1.0 if curve["stable"].all() else _FAINT
            line = {**looks.of(spec, key), "alpha": alpha} | ({"marker": ""} if shown.sum() > 1 else {})
            axes.plot(curve["frequency_hz"][shown], curve[name][shown], **line)
            static = (curve["frequency_hz"] == 0) & (curve[name] > 0)
            if static.any() and least < np.inf:  # the static limit, at the left edge
                edge = {"color": line["color"], "alpha": alpha, "clip_on": False, "zorder": 4}
                axes.plot(least, curve[name][static][0], marker="<", markersize=4, **edge)
            doubted = shown & rounded(curve, name)
            axes.plot(curve["frequency_hz"][doubted], curve[name][doubted], **_DOUBTED)
    axes.set_xlabel("frequency (Hz)")
