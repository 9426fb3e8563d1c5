"""The figure of responses: phases, the static limit, many curves, one frequency."""

import numpy as np
import pytest

import wavesweep
from wavesweep import plots

pytestmark = pytest.mark.slow


def figure_of(*, bode, **more):
    """The figure of the responses of a loop with waves."""
    from wavesweep.sweep import responses

    spec = wavesweep.load({"controller": {"kind": "pmw"}, "bode": bode} | more)
    table = responses([spec])
    return table.columns, plots.bode(table.columns, table.facts)


def test_phases_are_those_of_the_table_and_lines_break_at_the_jumps(responses):
    figure = plots.bode(responses, {})
    (phase,) = [axes for axes in figure.axes if axes.get_ylabel() == "phase of admittance (deg)"]
    expected = responses["admittance_deg"][: np.unique(responses["frequency_hz"]).size]
    drawn = phase.lines[0].get_ydata()
    assert np.array_equal(drawn[~np.isnan(drawn)], expected)
    assert np.abs(np.diff(expected)).max() > 180
    assert np.nanmax(np.abs(np.diff(drawn))) <= 180
    assert set(np.diff(phase.get_yticks())) <= {45.0, 90.0}


def test_the_static_limit_is_a_mark_at_the_left_edge():
    columns, figure = figure_of(bode={"frequency_hz": [0.0, 0.1, 1.0, 10.0, 25.0]})
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    (mark,) = [line for line in axes.lines if line.get_marker() == "<"]
    assert mark.get_xdata() == axes.get_xlim()[0] == 0.1
    assert mark.get_ydata() == 1e3 * columns["admittance_abs"][0]


def test_one_frequency_is_drawn_over_the_axis_that_varies():
    columns, figure = figure_of(bode={"frequency_hz": [5.0], "b": {"start": 5, "stop": 200, "num": 40, "scale": "log"}})
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    assert len(axes.lines) == 1
    assert np.array_equal(axes.lines[0].get_ydata(), 1e3 * columns["admittance_abs"])
    assert "b" in figure.axes[2].get_xlabel()
    assert "at 5 Hz" in figure.get_suptitle()


def test_more_than_a_dozen_curves_have_a_scale_of_colours():
    for count, legend in ((12, 13), (13, 2)):
        _, figure = figure_of(bode={"frequency_hz": [0.1, 1.0, 30.0], "b": {"start": 5, "stop": 200, "num": count}})
        assert any("b" in axes.get_ylabel() and "N·s/m" in axes.get_ylabel() for axes in figure.axes) == (count > 12)
        assert len(figure.legends[0].get_texts()) == legend


def test_the_slow_nyquist_frequency_is_marked():
    _, figure = figure_of(bode={"frequency_hz": {"start": 1, "stop": 50, "num": 20}})
    assert "slow Nyquist frequency, 25 Hz" in [text.get_text() for text in figure.legends[0].get_texts()]
