"""In figures of every kind but intervals: what the legend shows is drawn, and what is drawn in red is said to be so."""

import tomllib

import numpy as np
import pytest
from matplotlib.colors import same_color, to_hex
from matplotlib.lines import Line2D
from support.drawn import DRIVE

import wavesweep
from wavesweep.margins.table import margins
from wavesweep.poles.table import poles
from wavesweep.program import plots
from wavesweep.program.plots.style import DOUBTFUL

pytestmark = [pytest.mark.whole, pytest.mark.slow]
LATE = {
    "environment": {"delay": 20, "integration": "explicit"},
    "controller": {"kind": "pmw-lm", "Kp": 10.0},
    "sweep": {"K_VE": [0.0, 10.0, 1000.0], "b": [1.0, 20.0], "B_VE": [0.0]},
}


def passivity(_):
    rows = wavesweep.passivity(LATE)
    return plots.passivity({name: rows[name].to_numpy() for name in rows}, rows.attrs["facts"])


def of_table(draw, table):
    return draw(table.columns, table.facts)


FIGURES = {
    "bode": lambda request: plots.bode(request.getfixturevalue("responses"), {}),
    "passivity": passivity,
    "poles": lambda _: of_table(plots.poles, poles(wavesweep.load(tomllib.loads(DRIVE)))),
    "margins": lambda _: of_table(plots.margins, margins(wavesweep.load(tomllib.loads(DRIVE)), None)),
}


@pytest.mark.parametrize("kind", FIGURES)
def test_a_legend_shows_what_is_drawn(kind, request, monkeypatch):
    monkeypatch.setattr("wavesweep.program.plots.style._settle", lambda _: None)
    figure = FIGURES[kind](request)
    drawn, red = set(), False
    for axes in figure.axes:
        for line in axes.lines:
            if len(line.get_xdata()):
                drawn.add((to_hex(line.get_color()), str(line.get_marker())))
                red |= same_color(line.get_color(), DOUBTFUL)
        drawn |= {(to_hex(each.get_facecolor()), "area") for each in axes.patches}
    handles = [
        handle
        for legend in (*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes)))
        for handle in legend.legend_handles
    ]
    assert handles
    said = {
        (to_hex(each.get_color()), str(each.get_marker()))
        if isinstance(each, Line2D)
        else (to_hex(each.get_facecolor()), "area")
        for each in handles
    }
    assert said <= drawn, sorted(said - drawn)
    assert not red or any(same_color(colour, DOUBTFUL) for colour, _ in said)
    assert np.isfinite([each for axes in figure.axes for each in (*axes.get_xlim(), *axes.get_ylim())]).all()
