"""The figure of elasticities: for each limit, bars of how much each number of the loop moves it."""

from collections.abc import Mapping
from math import ceil
from textwrap import wrap
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns, axes_of
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.plots.labels import assumption, printed, symbol
from wavesweep.program.plots.style import (
    GRID,
    TWO_COLUMNS,
    distinct_colour,
    figure,
    is_narrow,
    note_below,
)
from wavesweep.program.tables.kind import plain
from wavesweep.sensitivity.table import KEPT, ends_of, mode_words

MOST_NUMBER_BARS = 12  # numbers of a panel that have bars
MOST_FIGURE_PANELS = 8  # ends of intervals
NO_ELASTICITY = 1e-9  # an elasticity up to which a number has no effect but that of rounding
_QUANTITIES = {"end": "the limit", "felt": "the stiffness felt there"}
_LOOKS = {  # of bars; the second is hatched, since its grey is much the same
    "end": {"facecolor": distinct_colour(0), "edgecolor": "white", "linewidth": 0},
    "felt": {
        "facecolor": distinct_colour(1),
        "edgecolor": "white",
        "linewidth": 0,
        "hatch": "////",
    },
}


def why(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `why` table: a panel per end and crossing, with the numbers that move it most and
    how many are left out."""
    panels = [(rows, *_with_bars(rows)) for rows in ends_of(columns)]
    shown = [panel for panel in panels if panel[1]][:MOST_FIGURE_PANELS]
    across = min(1 if is_narrow() else 2, len(shown))
    lines = [shown[start : start + across] for start in range(0, len(shown), max(across, 1))]
    # In inches: title and axis of a panel, and each number.
    heights = [0.95 + 0.17 * max(1, *(len(numbers) for _, numbers, _ in line)) for line in lines]
    with figure(TWO_COLUMNS, 0.5 + sum(heights)) as canvas:
        if shown:
            grid = canvas.subplots(len(lines), across, squeeze=False, height_ratios=heights).ravel()
        else:
            grid = ()
        for axes, panel in zip(grid, shown, strict=False):
            _draw(axes, *panel)
        for axes in grid[len(shown) :]:
            axes.set_visible(False)
        # say which bars are of which quantity, if there are several
        from matplotlib.patches import Patch

        if len({quantity for rows, *_ in shown for quantity in rows["quantity"].tolist()}) > 1:
            canvas.legend(
                [Patch(**look) for look in _LOOKS.values()],
                _QUANTITIES.values(),
                loc="outside upper center",
                ncols=2,
            )
        if shown:
            elasticity = "elasticity: per cent of the limit per per cent of the number"
        else:
            elasticity = ""
        # ends that have no bars, how many are not drawn, and a table without ends
        notes = [
            *dict.fromkeys(
                f"{_end(rows)}: no bars, {_why_none(rows)}." for rows, bars, _ in panels if not bars
            )
        ][:MOST_FIGURE_PANELS]
        for rows, *_ in panels:
            if (np.abs(rows["elasticity_down"] - rows["elasticity"]) > NO_ELASTICITY).any():
                notes.append("Strokes: if the number falls, where that differs.")
                break
        drawn = sum(bool(bars) for _, bars, _ in panels)
        notes += (
            [f"Shown: {MOST_FIGURE_PANELS} of {drawn} ends."] if drawn > MOST_FIGURE_PANELS else []
        )
        if not panels:
            doubts = ", ".join(facts.get("doubts") or ())
            unknown = f"No end of an interval is known in the range ({doubts})."
            notes += [unknown if doubts else "Stability sets no end of an interval in the range."]
        note_below(canvas, *notes, assumption(facts), axis=elasticity)
    return canvas


def _with_bars(rows: Columns) -> tuple[list[str], str]:
    """The numbers with bars, from the largest on, and a note on those that are left out."""
    largest: dict[str, float] = {}
    sizes = np.fmax(np.abs(rows["elasticity"]), np.abs(rows["elasticity_down"]))
    for number, elasticity in zip(rows["number"].tolist(), sizes.tolist(), strict=True):
        if not np.isnan(elasticity):
            largest[number] = max(largest.get(number, 0.0), elasticity)
    order = sorted(
        (number for number, size in largest.items() if size > NO_ELASTICITY),
        key=lambda number: -largest[number],
    )
    rest, missing = order[MOST_NUMBER_BARS:], len(set(rows["number"].tolist())) - len(largest)
    if rest:
        notes = [f"{len(rest)} more, each at most {largest[rest[0]]:.2g}"]
    else:
        notes = []
    notes += [f"{still} without effect"] if (still := len(largest) - len(order)) else []
    notes += [f"{missing} not given ({_why_missing(rows)})"] if missing else []
    return order[:MOST_NUMBER_BARS], "; ".join(notes)


def _why_none(rows: Columns) -> str:
    """Why a panel has no bars."""
    if (rows["limit_value"] == 0).all():
        return "as a limit of 0 has no changes in per cent"
    missing = np.isnan(rows["elasticity"]).all()
    if missing:
        return f"since they are not known ({_why_missing(rows)})"
    return "since no number moves it"


def _why_missing(rows: Columns) -> str:
    return ", ".join(filter(None, dict.fromkeys(rows["doubt"].tolist()))) or "the limit is 0"


def _draw(axes: Any, rows: Columns, numbers: list[str], note: str) -> None:
    kinds = [quantity for quantity in _QUANTITIES if quantity in rows["quantity"].tolist()]
    for index, quantity in enumerate(kinds):
        shown = (
            (rows["quantity"] == quantity)
            & np.isin(rows["number"].astype(str), numbers)
            & ~np.isnan(rows["elasticity"])
        )
        at = [
            numbers.index(number) + (index - (len(kinds) - 1) / 2) * 0.4
            for number in rows["number"][shown].tolist()
        ]
        up = rows["elasticity"][shown]
        down = rows["elasticity_down"][shown]
        axes.barh(at, up, height=0.8 / len(kinds), **_LOOKS[quantity])
        other = np.abs(down - up) > NO_ELASTICITY
        axes.plot(down[other], np.array(at)[other], "k|", markersize=9)
    # What they keep stands below, as there is no room beside the bars.
    kept = [symbol(number) + KEPT[number] for number in numbers if number in KEPT]
    note = "; ".join([*kept, *([note] if note else [])])
    axes.set_yticks(range(len(numbers)), [_in_lines(symbol(number)) for number in numbers])
    axes.set_ylim(max(len(numbers), 1) - 0.4, -0.6)
    axes.axvline(0, color="black", linewidth=0.6)
    axes.margins(x=0.08)
    axes.grid(**GRID, axis="x")
    axes.set_axisbelow(True)
    axes.set_title("\n".join(_title(rows)), fontsize=7, loc="left")
    axes.set_xlabel("\n".join(wrap(note, _letters())), fontsize=7, color="0.3")


def _in_lines(name: str) -> str:
    """A name beside bars, in two lines if it is long."""
    # A name of up to 18 letters is in one line.
    return "\n".join(wrap(name, max(18, ceil(len(name) / 2))))


def _title(rows: Columns) -> list[str]:
    """The limit, and the mode that sets it."""
    first = {name: column[0] for name, column in rows.items()}
    if first["corner"]:
        corner = f" (crossing {first['crossing'] + 1} of a corner)"
    else:
        corner = ""
    mode = mode_words(*(plain(first[name]) for name in ("omega", "hz", "second_hz")))
    if not np.isnan(first["damping_ratio"]):
        mode += f", damping ratio {first['damping_ratio']:.2g} just inside"
    swept = ", ".join(f"{symbol(name)} = {first[name]:.5g}" for name in axes_of(rows))
    states = wrap(first["states"].replace(" %", "\u00a0%"), _letters())
    return [*([swept] if swept else []), f"{_end(rows)}{corner}", *wrap(mode, _letters()), *states]


def _letters() -> int:
    if is_narrow():
        return 34
    return 46  # letters of a line above a panel


def _end(rows: Columns) -> str:
    of_end = int(
        np.argmax(rows["quantity"] == "end")
    )  # the other quantity is the stiffness felt there
    limit, unit = rows["limit_value"][of_end], printed(rows["unit"][of_end : of_end + 1])
    if rows["side"][0] == "low":
        inside = rounded_up(limit, 5)
    else:
        inside = rounded_down(limit, 5)
    return f"{rows['side'][0]} end, {symbol(rows['along'][0])} = {inside} {unit}".rstrip()
