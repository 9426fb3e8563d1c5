"""The figure of a design study: the front of two wishes, or the wishes of the best designs, beside the spec's own design."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.plots.refine import spec_of
from wavesweep.plots.style import (
    ONE_COLUMN,
    TWO_COLUMNS,
    Look,
    at_hand,
    by_factors,
    family_looks,
    figure,
    label,
    note_assumptions,
    printed,
    wide,
    with_unit,
)
from wavesweep.spec.design import WISHES
from wavesweep.tables.columns import fields
from wavesweep.tables.design import margins_of, wish_of

NAMES = {
    "z_width": "stiffest wall",
    "felt": "stiffness felt",
    "free_motion": "impedance of free motion",
    "transparency": "error of the response",
    "channel": "norm of the wave channel",
    "port": "margin of the hand's port",
    "damping_ratio": "least damping ratio of all modes",
    "settling": "time constant of the slowest mode",
    "delay_margin": "delay margin",
    "chatter": "force of the encoder's rounding, at most",
    "depth": "depth at the force of the motors",
}
_LIST = 3  # designs that are listed
_FRONT = {"marker": "o", "markersize": 4, "color": "#0072B2", "linestyle": "-", "linewidth": 0.8}
_OWN = {"marker": "X", "markersize": 8, "color": "#D55E00", "markeredgecolor": "white", "linestyle": "none"}


def design(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Any:
    """Draw a `design` table: one wish over the other and, below, the varied numbers along the front.

    All values are the worst over what designs have to hold for. The labels of the axes say which side is better. Up to three
    designs are no front: their numbers are a list, with those of the spec's own design, beside the admittances of all. A single
    one has the next best design beside it.
    """
    from matplotlib.ticker import FixedLocator, MaxNLocator

    wishes = list(facts["spec"]["design"]["wish"])
    free = [name for name in wishes if not {"at_least", "at_most"} & set(facts["spec"]["design"]["wish"][name])]
    x, y = free if len(free) == 2 else [wishes[0], wishes[1] if len(wishes) > 1 else wishes[0]]
    varied = list(facts["spec"]["design"]["vary"])
    if len(columns[x]) <= _LIST:
        return _draw_list(columns, facts, wishes, varied)
    kinds = {field.name: field.kind for field in fields("zwidth", varied, facts=facts)}
    down = -(-len(varied) // 3)
    width = TWO_COLUMNS if len(varied) > 1 else ONE_COLUMN
    with figure(width, 2.8 + 1.3 * down) as canvas:
        across = min(3, len(varied))
        grid = canvas.add_gridspec(1 + down, across, height_ratios=[2.2, *[1] * down])
        front = canvas.add_subplot(grid[0, :])
        order = np.argsort(columns[x], kind="stable")
        own = facts.get("own", {})
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


def _draw_list(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any], wishes: list[str], varied: list[str]) -> Any:
    """A list of the wishes, their margins and the varied numbers of a few designs, beside their admittances."""
    spec, count = spec_of(facts), len(columns[wishes[0]])
    own = {name: spec.own(spec.names.find(name).path) for name in varied} if spec else {}
    shown = {"spec's own": {**facts.get("own", {}), **own}}
    for at in range(count):
        shown[f"found ({at + 1})" if count > 1 else "found"] = {name: columns[name][at].item() for name in (*wishes, *varied)}
    for each in facts.get("runners_up", ())[: count == 1]:
        shown["next best"] = {**each["wishes"], **each["numbers"]}
    beside, cells = wide(TWO_COLUMNS) > 1.5 * ONE_COLUMN, []
    for name in wishes:
        title = _label(name, facts)  # in a narrow figure without what is better
        cells.append([title if beside else title.rpartition(",")[0], *(_number(each.get(name)) for each in shown.values())])
        wish = wish_of(name, facts)
        if wish.bound is not None:
            margins = (margins_of({name: each.get(name)}, facts).get(name) for each in shown.values())
            said = f"   margin to {wish.kind.bound.replace('_', ' ')} {wish.bound:g}"
            cells.append([said, *("" if share is None else f"{100 * share:.3g} %" for share in margins)])
    cells += [[label(name, facts), *(_number(each.get(name)) for each in shown.values())] for name in varied]
    height = max(2.4, 0.9 + 0.2 * len(cells))
    with figure(TWO_COLUMNS, height if beside else height + 2) as canvas:
        left, right = canvas.subplots(*((1, 2) if beside else (2, 1)), **({"width_ratios": [2, 1]} if beside else {}))
        widths = [0.55, *[0.45 / len(shown)] * len(shown)]
        table = left.table(
            cells, colLabels=["", *shown], colWidths=widths, cellLoc="left", colLoc="left", loc="center", edges="horizontal"
        )
        table.auto_set_font_size(value=False)
        table.set_fontsize(6)
        for cell in table.get_celld().values():
            cell.PAD = 0.02
            cell.set_linewidth(0.5)
        left.set_axis_off()
        designs = [{name: each[name] for name in varied} for each in [*shown.values()][1:]]
        right.set_visible(_draw_admittances(right, spec, [{}, *designs], [*shown][1:]))
        note_assumptions(canvas, facts)
    return canvas


def _number(value: float | None) -> str:
    return "not known" if value is None or np.isnan(value) else f"{value:.5g}"


def _draw_admittances(axes: Any, spec: Any, designs: list[dict[str, float]], names: list[str]) -> bool:
    """The admittances of the spec with the numbers of some designs, its own first; whether there is one."""
    if spec is None or spec.without_hand():
        return False
    from wavesweep.response.steady import respond
    from wavesweep.sweep.drawn_loops import loop_at_hand
    from wavesweep.sweep.experiment import radius_of

    frequency = np.array([each for each in spec.frequency_hz if each > 0])
    looks = (Look(_OWN["color"], (0, (1.5, 0.8))), *family_looks(len(names)))
    for numbers, name, look in zip(designs, ["the spec's own", *names], looks, strict=True):
        paths = {spec.names.find(each).path: value for each, value in numbers.items()}
        whole = {path for path in paths if isinstance(spec.values.get(path), int)}
        one = spec.with_values({path: int(value) if path in whole else float(value) for path, value in paths.items()})
        found, stable = respond(loop_at_hand(one), frequency).admittance.ravel(), radius_of(one) < 1
        state = {"label": name} if stable else {"label": f"{name}, unstable", "alpha": 0.35}
        axes.loglog(frequency, 1e3 * np.abs(found), color=look.colour, linestyle=look.line, **state)
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(at_hand("admittance", "admittance_abs", "mm/N", {"spec": spec.tables()}))
    axes.grid(visible=True, color="0.9", linewidth=0.5)
    axes.legend(loc="best", fontsize=7)
    return True


def _label(name: str, facts: Mapping[str, Any]) -> str:
    kind = WISHES[name]
    unit = printed([facts.get("units", {}).get(name, kind.unit)])
    return f"{with_unit(NAMES[name], unit)}, {'more' if kind.more else 'less'} is better"
