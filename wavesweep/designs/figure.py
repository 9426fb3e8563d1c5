"""The figure of a design study: the front of two wishes, or a few designs next to the nominal
one."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.designs.table import margins_of, wish_of
from wavesweep.designs.wish_keys import WISHES, word_of
from wavesweep.program.analyses.plane_columns import spec_of
from wavesweep.program.columns import Columns
from wavesweep.program.plots.labels import (
    assumption,
    at_hand,
    label,
    printed,
    symbol,
    unit,
    valued,
    with_unit,
)
from wavesweep.program.plots.scales import by_factors
from wavesweep.program.plots.style import (
    FAINT_COLOUR,
    GRID,
    TWO_COLUMNS,
    Look,
    family_looks,
    figure,
    is_narrow,
    note_below,
    paler,
)
from wavesweep.program.tables.columns import fields

# inches above and below each panel, so that what stands below one and above the next do not meet
BETWEEN_PANELS = 0.07
_ACROSS = 3  # panels
_FRONT = {"marker": "o", "markersize": 4, "color": "#0072B2", "linestyle": "-", "linewidth": 0.8}
_OWN = {
    "marker": "X",
    "markersize": 8,
    "color": "#D55E00",
    "markeredgecolor": "white",
    "linestyle": "none",
}
_NOMINAL = Look("#D55E00", (0, (1.5, 0.8)))


def design(columns: Columns, facts: Mapping[str, Any]) -> Any:
    """Draw a `design` table: one wish over the other and, below, the varied numbers along the
    front.

    All values are the worst over what designs have to hold for. The labels of the axes say which
    side is better. Up to three designs are not a front: each wish and each number has a panel with
    its value in every design and in the nominal one, and the admittances are below. A single design
    has the next best one next to it.
    """
    wishes, varied = list(facts["spec"]["design"]["wish"]), list(facts["spec"]["design"]["vary"])
    free = [
        name
        for name in wishes
        if not {"at_least", "at_most"} & set(facts["spec"]["design"]["wish"][name])
    ]
    x, y = free if len(free) == 2 else (wishes * 2)[:2]
    if len(columns[x]) <= 3:  # designs that are shown one by one
        return _draw_few(columns, facts, wishes, varied)
    across = 1 if is_narrow() else min(_ACROSS, len(varied))
    down, nominal = -(-len(varied) // across), facts.get("own", {})
    with figure(TWO_COLUMNS, 2.8 + 1.3 * down) as canvas:
        canvas.get_layout_engine().set(h_pad=BETWEEN_PANELS)
        grid = canvas.add_gridspec(1 + down, across, height_ratios=[2.2, *[1] * down])
        front, order = canvas.add_subplot(grid[0, :]), np.argsort(columns[x], kind="stable")
        _draw_front(front, columns, order, nominal, {name: _label(name, facts) for name in (x, y)})
        kinds = {field.name: field.kind for field in fields("zwidth", varied, facts=facts)}
        for place, name in enumerate(varied):
            panel = canvas.add_subplot(grid[1 + place // across, place % across])
            panel.plot(columns[x][order], columns[name][order], **_FRONT | {"markersize": 2.5})
            panel.set_title(label(name, facts), fontsize=7)
            if front.get_xscale() == "log":
                by_factors(panel.xaxis, columns[x].min(), columns[x].max())
            _scale_numbers(panel, columns[name], kinds[name] == "integer")
            if place + across >= len(varied):
                panel.set_xlabel(_label(x, facts).rpartition(", ")[0], fontsize=7)
        unknown = [WISHES[word_of(name)].title for name in (x, y) if nominal.get(name) is None]
        missing = f"The nominal design is not shown: its {' and its '.join(unknown)} is not known, as where it is unstable."
        note_below(canvas, missing * bool(nominal and unknown), *_studied(facts), assumption(facts))
    return canvas


def _by_factors_if_wide(axis: Any, values: np.ndarray) -> None:
    """Give an axis a scale of factors if its values vary by much."""
    values = values[np.isfinite(values)]
    if values.size and values.min() > 0 and values.max() > 5 * values.min():
        by_factors(axis, values.min(), values.max())


def _scale_numbers(panel: Any, values: np.ndarray, whole: bool) -> None:
    """The axis of a varied number along the front, where whole numbers are at their ticks."""
    from matplotlib.ticker import FixedLocator, MaxNLocator

    _by_factors_if_wide(panel.yaxis, values)
    if whole:
        varies = values.max() > values.min()
        panel.yaxis.set_major_locator(
            MaxNLocator(integer=True) if varies else FixedLocator(values[:1])
        )
        panel.set_ylim(values.min() - 0.5, values.max() + 0.5)
    panel.grid(**GRID)
    panel.tick_params(labelsize=7)


def _draw_front(
    axes: Any,
    columns: Columns,
    order: np.ndarray,
    nominal: Mapping[str, Any],
    labels: dict[str, str],
) -> None:
    """The second of two wishes over the first one, and the nominal design if both are known of
    it; labels: of both axes."""
    x, y = labels
    axes.plot(columns[x][order], columns[y][order], label="designs that were found", **_FRONT)
    if nominal.get(x) is not None and nominal.get(y) is not None:
        axes.plot(nominal[x], nominal[y], label="nominal design", **_OWN)
    for name, axis in ((x, axes.xaxis), (y, axes.yaxis)):
        axis.set_label_text(
            labels[name] if axis is axes.xaxis else ",\n".join(labels[name].rsplit(", ", 1))
        )
        _by_factors_if_wide(axis, columns[name])
    axes.grid(**GRID, which="both")
    axes.figure.legend(loc="outside upper center", ncols=2)


def _draw_few(
    columns: Columns, facts: Mapping[str, Any], wishes: list[str], varied: list[str]
) -> Any:
    """A panel for each wish and each varied number, with its value in each design, and the
    admittances of all."""
    spec, count = spec_of(facts), len(columns[wishes[0]])
    if spec:
        nominal = {name: spec.own(spec.names.find(name).path) for name in varied}
    else:
        nominal = {}
    designs: dict[str, Mapping[str, Any]] = {"nominal": {**facts.get("own", {}), **nominal}}
    for index in range(count):
        designs[f"found ({index + 1})" if count > 1 else "found"] = {
            name: columns[name][index].item() for name in (*wishes, *varied)
        }
    for runner_up in facts.get("runners_up", ())[: count == 1]:
        designs["next best"] = {**runner_up["wishes"], **runner_up["numbers"]}
    looks, hand = (
        [_NOMINAL, *family_looks(len(designs) - 1)],
        spec is not None and not spec.without_hand(),
    )
    across = 1 if is_narrow() else 2
    down, row = -(-len([*wishes, *varied]) // across), 0.65 + 0.17 * len(designs)
    with figure(TWO_COLUMNS, row * down + 2.4 * hand) as canvas:
        canvas.get_layout_engine().set(h_pad=BETWEEN_PANELS)
        grid = canvas.add_gridspec(
            down + hand, across, height_ratios=[*[row] * down, *[2.4] * hand]
        )
        for place, name in enumerate((*wishes, *varied)):
            axes = canvas.add_subplot(grid[place // across, place % across])
            _draw_values(
                axes, name, [numbers.get(name) for numbers in designs.values()], looks, facts
            )
            axes.set_yticks(range(len(designs)), [*designs] * (place % across == 0))
        if hand:
            _draw_admittances(canvas.add_subplot(grid[-1, :]), spec, designs, varied, looks)
        note_below(canvas, *_studied(facts), assumption(facts))
    return canvas


def _listed(name: str, values: Iterable[float], facts: Mapping[str, Any]) -> str:
    """A number with its values and unit."""
    numbers = ", ".join(f"{value:g}" for value in values)
    return f"{symbol(name)} = {numbers} {unit(name, facts)}".rstrip()


def _studied(facts: Mapping[str, Any]) -> list[str]:
    """Sentences on the walls and the band that each wish is for, and on what designs have to
    hold for."""
    tables, study = facts["spec"], facts["spec"]["design"]
    wall = tables.get("ports", {}).get("wall") or {"stiffness": "K_VE", "damping": "B_VE"}
    names, environment = (
        {"walls": wall["stiffness"], "B_VE": wall["damping"]},
        tables.get("environment", {}),
    )
    constants = {key: [environment[place]] for key, place in names.items() if place in environment}
    wishes = []
    for name, options_given in study["wish"].items():
        options = WISHES[word_of(name)].options
        walls = constants | options_given
        words = [
            _listed(names[key], walls[key], facts)
            for key in names
            if key in options and key in walls
        ]
        words += (
            [f"{options_given['band_hz'][0]:g} to {options_given['band_hz'][1]:g} Hz"]
            if "band_hz" in options_given
            else []
        )
        wishes += [f"{WISHES[word_of(name)].title} with {', '.join(words)}"] if words else []
    scenarios = []
    for name, range_of_name in tables.get("for_all", {}).items():
        if isinstance(range_of_name, Mapping) and "values" in range_of_name:
            scenarios.append(_listed(name, range_of_name["values"], facts))
        elif isinstance(range_of_name, Mapping) and "start" in range_of_name:
            span = f"{symbol(name)} from {range_of_name['start']:g} to {range_of_name['stop']:g} {unit(name, facts)}"
            scenarios.append(span.rstrip())
    sentences = "; ".join(wishes), f"worst for {'; '.join(scenarios)}" if scenarios else ""
    return [f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences if sentence]


def _draw_values(
    axes: Any,
    name: str,
    values: Sequence[float | None],
    looks: Sequence[Look],
    facts: Mapping[str, Any],
) -> None:
    """The values of a wish or a number, each with its text, and for a wish its bound with the
    margins to it."""
    margins: list[float | None] = [None] * len(values)
    if name in facts["spec"]["design"]["wish"]:
        wish = wish_of(name, facts)
        axes.set_title(_label(name, facts).replace(", ", ",\n", 1), fontsize=7)
        if wish.bound is not None:
            margins = [margins_of({name: value}, facts).get(name) for value in values]
            axes.axvline(wish.bound, color="0.5", linewidth=0.8, linestyle="--")
            bound = f"{wish.kind.bound.replace('_', ' ')} {wish.bound:g}"
            axes.set_xlabel(f"{bound}, with margins", fontsize=7)
    else:
        axes.set_title(label(name, facts), fontsize=7)
    for place, (value, margin, look) in enumerate(zip(values, margins, looks, strict=True)):
        if value is not None and np.isfinite(value):
            said = f"{value:.4g}"
            if margin is not None:
                said += f" ({float(f'{100 * margin:.3g}'):g} %)"
            axes.plot([value], [place], "X" if place == 0 else "o", color=look.colour, markersize=5)
        elif place == 0 and facts.get("own_unstable"):
            said = "unstable"
        else:
            said = "not known"
        beside = {"xycoords": ("axes fraction", "data"), "ha": "left", "va": "center"}
        axes.annotate(said, (1.03, place), **beside, fontsize=7)
    axes.margins(x=0.1)
    axes.set_ylim(len(values) - 0.5, -0.5)
    axes.locator_params(axis="x", nbins=4)
    axes.tick_params(labelsize=7)
    axes.grid(**GRID, axis="x")


def _draw_admittances(
    axes: Any, spec: Any, designs: Mapping[str, Mapping[str, Any]], varied: list[str], looks: Any
) -> None:
    """The admittances of the spec with the numbers of each design, its own first."""
    from wavesweep.engine.response import respond
    from wavesweep.program.analyses.spec_loops import loop_at_hand
    from wavesweep.program.sweep.grid import own_loop

    frequency = np.array([f for f in spec.frequency_hz if f > 0])
    for (name, numbers), look in zip(designs.items(), looks, strict=True):
        values = {}
        for name_varied in varied if name != "nominal" else ():
            path = spec.names.find(name_varied).path
            kind = int if isinstance(spec.values.get(path), int) else float
            values[path] = kind(numbers[name_varied])
        changed = spec.with_values(values)
        admittance = 1e3 * np.abs(respond(loop_at_hand(changed), frequency).admittance.ravel())
        colour = look.colour
        said = name
        if not own_loop(changed).radii() < 1:
            colour = paler(look.colour, FAINT_COLOUR)
            said = f"{name}, unstable"
        axes.loglog(frequency, admittance, color=colour, linestyle=look.line, label=said)
    tables = {"spec": spec.tables()}
    walls = [valued(path.rpartition(".")[2], spec.own(path), tables) for path in spec.wall]
    axes.set_title(f"with {', '.join(walls)}" if walls else "", fontsize=7)
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(at_hand("admittance", "admittance_abs", "mm/N", tables))
    axes.grid(**GRID)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)


def _label(name: str, facts: Mapping[str, Any]) -> str:
    kind = WISHES[word_of(name)]
    unit = printed([facts.get("units", {}).get(name, kind.unit)])
    wishes = facts["spec"]["design"]["wish"]
    title = kind.title
    if f"{word_of(name)}_2" in wishes and "cut" in wishes[name]:
        title += f" at {wishes[name]['cut']}"
    return f"{with_unit(title, unit)}, {'more' if kind.more else 'less'} is better"
