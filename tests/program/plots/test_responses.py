"""The figure of responses: phases, the static limit, many curves, one frequency."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import wavesweep
from wavesweep.program import plots

pytestmark = pytest.mark.slow


def figure_of(*, bode, **more):
    """The figure of the responses of a loop with waves."""
    from wavesweep.program.tables.response_table import responses

    spec = wavesweep.load({"controller": {"kind": "pmw"}, "bode": bode} | more)
    table = responses([spec])
    return table.columns, plots.bode(table.columns, table.facts)


def test_phases_are_those_of_the_table_and_lines_break_at_the_jumps(responses):
    calm = responses | {"impedance_deg": 0 * responses["impedance_deg"]}  # one that wraps often would draw both on
    figure = plots.bode(calm, {})
    (phase,) = [axes for axes in figure.axes if axes.get_ylabel() == "phase of admittance (deg)"]
    expected = responses["admittance_deg"][: np.unique(responses["frequency_hz"]).size]
    drawn = phase.lines[0].get_ydata()
    assert np.array_equal(drawn[~np.isnan(drawn)], expected)
    assert np.abs(np.diff(expected)).max() > 180
    assert np.nanmax(np.abs(np.diff(drawn))) <= 180
    assert set(np.diff(phase.get_yticks())) <= {45.0, 90.0}


def test_all_phases_of_a_figure_are_drawn_on_if_one_wraps_often(responses):
    turned = responses["impedance_deg"] - 360 * 0.2 * responses["frequency_hz"]
    figure = plots.bode(responses | {"impedance_deg": (turned + 180) % 360 - 180}, {})
    phases = [axes for axes in figure.axes if axes.get_ylabel().startswith("phase of")]
    assert len(phases) == 2
    for axes in phases:
        drawn = axes.lines[0].get_ydata()
        assert np.nanmin(drawn) < -180


@pytest.mark.sample(1)
@pytest.mark.parametrize(("every", "whole"), [(1, True), (20, False)])
@pytest.mark.thorough
def test_phases_that_jump_often_go_on_as_far_as_frequencies_tell_how(responses, every, whole):
    one = {name: column[:400:every] for name, column in responses.items()}
    turned = one["admittance_deg"] - 360 * 0.2 * one["frequency_hz"]  # late by 0.2 s: ten turns at 50 Hz
    figure = plots.bode(one | {"admittance_deg": (turned + 180) % 360 - 180}, {})
    (phase,) = [axes for axes in figure.axes if axes.get_ylabel() == "phase of admittance (deg)"]
    drawn, expected = phase.lines[0].get_ydata(), np.unwrap(responses["admittance_deg"][:400], period=360)[::every]
    expected = expected - 360 * 0.2 * one["frequency_hz"]
    known = ~np.isnan(drawn)
    assert drawn[known] == pytest.approx(expected[known], abs=1e-6)
    assert known.all() == whole
    assert known.sum() > 10
    assert ("Left out: phases" in figure.get_supxlabel()) != whole


def test_phases_fill_their_axes_and_no_second_scale_stands_beside_a_logarithmic_one(responses):
    above, _, below, _ = plots.bode(responses, {}).axes
    assert above.get_yscale() == "log"
    assert not above.child_axes
    drawn = np.concatenate([line.get_ydata() for line in below.lines if len(line.get_ydata()) > 2]).astype(float)
    low, high = below.get_ylim()
    assert np.nanmax(drawn) - np.nanmin(drawn) > 0.85 * (high - low)


@pytest.mark.thorough
def test_the_static_limit_is_a_mark_at_the_left_edge():
    columns, figure = figure_of(bode={"frequency_hz": [0.0, 0.1, 1.0, 10.0, 25.0]})
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    (mark,) = [line for line in axes.lines if line.get_marker() == "<"]
    assert mark.get_xdata() == axes.get_xlim()[0] == 0.1
    assert mark.get_ydata() == 1e3 * columns["admittance_abs"][0]


@pytest.mark.thorough
def test_one_frequency_is_drawn_over_the_axis_that_varies():
    columns, figure = figure_of(bode={"frequency_hz": [5.0], "b": {"start": 5, "stop": 200, "num": 40, "scale": "log"}})
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    assert len(axes.lines) == 1
    assert np.array_equal(axes.lines[0].get_ydata(), 1e3 * columns["admittance_abs"])
    assert "b" in figure.axes[2].get_xlabel()
    assert "At 5 Hz" in figure.get_supxlabel()


@pytest.mark.sample(1)
@pytest.mark.parametrize("impedances", [[10.0, 20.0], [10.0]])
@pytest.mark.parametrize("frequencies", [[3.0, 4.0], [3.0, 3.1], [1.0, 25.0]])
def test_a_phase_that_hardly_varies_has_two_ticks_at_least(frequencies, impedances):
    _, figure = figure_of(bode={"frequency_hz": frequencies, "b": impedances})
    for axes in figure.axes[2:4]:
        low, high = axes.get_ylim()
        assert sum(low <= tick <= high for tick in axes.get_yticks()) >= 2


@pytest.mark.thorough
def test_more_than_a_dozen_curves_have_a_scale_of_colours():
    for count, legend in ((12, 13), (13, 2)):
        _, figure = figure_of(bode={"frequency_hz": [0.1, 1.0, 30.0], "b": {"start": 5, "stop": 200, "num": count}})
        assert any("b" in axes.get_ylabel() and "N·s/m" in axes.get_ylabel() for axes in figure.axes) == (count > 12)
        assert len(figure.legends[0].get_texts()) == legend


@pytest.mark.thorough
def test_of_very_many_curves_some_are_drawn_in_blocks_or_at_once_and_one_sentence_says_so(monkeypatch):
    from wavesweep.program.tables.response_table import responses

    axes = {"b": {"start": 5, "stop": 200, "num": 40}, "B_VE": {"start": 0, "stop": 5, "num": 10}}
    spec = wavesweep.load({"controller": {"kind": "pmw"}, "bode": {"frequency_hz": [0.1, 1.0, 30.0]} | axes})
    table, said = responses([spec]), []
    whole = plots.bode(table.columns, table.facts)
    curves = [line for line in whole.axes[0].lines if len(line.get_xdata()) == 3]
    assert len(curves) == 10 * 20
    assert "Shown: 20 of 40 values of b." in whole.get_supxlabel()
    monkeypatch.setattr("wavesweep.program.sweep.running.ROWS_OF_BLOCK", 100)
    for kept in (10**6, 500):
        monkeypatch.setattr(plots, "ROWS_IN_MEMORY", kept)
        drawn = plots.drawn(table, said.append)
        assert sum(len(block["b"]) for block in drawn.blocks()) == 1200
        pictures = []
        monkeypatch.setattr(
            "wavesweep.program.plots.figure_files.save", lambda figure, *_, keep=pictures: keep.append(figure._repr_png_())
        )
        drawn.figure(None)
        assert pictures == [whole._repr_png_()]
    assert said == ["figure of spec: shown: 20 of 40 values of b"] * 2


@pytest.mark.thorough
def test_a_spec_without_an_axis_of_the_others_is_one_curve(responses):
    """Its values of that axis are missing, and a missing one is unequal to itself."""
    rows = {name: column[responses["spec"] == responses["spec"][0]] for name, column in responses.items()}
    other = {**rows, "spec": np.full(rows["spec"].size, "other", object), "b": np.full(rows["b"].size, np.nan)}
    first = rows["b"] == rows["b"][0]
    both = {name: np.concatenate([column, other[name][first]]) for name, column in rows.items()}
    figure = plots.bode(both, {})
    curves = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 2]
    assert len(curves) == len(np.unique(rows["b"])) + 1
    assert [text.get_text() for text in figure.legends[0].get_texts()].count("other") == 1


@pytest.mark.thorough
def test_stable_and_unstable_curves_are_named_apart_beside_a_scale_of_colours():
    """Of 14 curves only the second is stable."""
    _, figure = figure_of(
        bode={"frequency_hz": [0.1, 1.0, 30.0], "b": {"start": 5, "stop": 200, "num": 14}},
        environment={"integration": "explicit", "K_VE": 500.0},
    )
    axes = figure.axes[0]
    curves = [line for line in axes.lines if len(line.get_xdata()) > 2]
    assert [min(to_rgb(line.get_color())) > 0.6 for line in curves].count(True) == len(curves) - 1  # the faint ones
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [name.endswith("unstable") for name in names].count(True) == 1
    assert len(names) == 3


def test_the_slow_nyquist_frequency_is_that_of_the_slow_rate_where_rates_do_not_divide():
    columns, figure = figure_of(bode={"frequency_hz": [1.0, 40.0]}, rates={"slow_hz": 60.0})
    np.testing.assert_allclose(columns["omega_Ts"], 2 * np.pi * columns["frequency_hz"] / 60, rtol=1e-12)
    assert "slow Nyquist frequency, 30 Hz" in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.thorough
def test_axes_at_the_hand_have_the_units_of_a_loop_that_turns():
    from wavesweep.program.tables.response_table import responses

    paths = [Path(__file__).parents[3] / "sweeps" / "recipes" / f"{name}.toml" for name in ("wheel", "engine")]
    bode = ["bode.frequency_hz=[1, 2]"]
    for specs, titles in (
        (paths[:1], ["admittance (mrad/(N·m))", "impedance (N·m/rad)"]),
        (paths[1:], ["admittance (mm/N)", "impedance (N/m)"]),
        (paths, ["admittance\n(mrad/(N·m) or mm/N)", "impedance\n(N·m/rad or N/m)"]),
    ):
        table = responses([wavesweep.load(path, bode) for path in specs])
        figure = plots.bode(table.columns, table.facts)
        assert [axes.get_ylabel() for axes in figure.axes[:2]] == titles
