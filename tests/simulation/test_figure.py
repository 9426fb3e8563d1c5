"""Figures of simulations: short and long, with and without waves, of one frequency and of many."""

import struct
from pathlib import Path

import numpy as np
import pytest
from matplotlib.ticker import FixedLocator

import wavesweep
from wavesweep.program import plots
from wavesweep.program.analyses.claims import Claim, Property, Scope, Status
from wavesweep.program.plots.sampling import extremes
from wavesweep.program.plots.style import _cut_off, figure
from wavesweep.program.results import fields, read_table, save
from wavesweep.program.spec import load
from wavesweep.simulation.figure import _spans
from wavesweep.simulation.from_spec import simulated
from wavesweep.simulation.record import recorded
from wavesweep.simulation.table import simulate as simulation_tables


def simulation(kind="pmw-lm", **simulate):
    """The columns and facts of a simulation."""
    loop = {"controller": {"kind": kind}, "operator": {"stiffness": 100.0}}
    spec = load(loop | {"simulate": {"frequency_hz": 1} | simulate}).asking("simulate")
    return recorded(simulated(spec)), {"spec": spec.tables()}


def _facts(kind):
    return {"spec": {"rates": {"ratio": 20}, "simulate": {"input": kind, "at_s": 0.1}}}


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "simulate"),
    [
        ("pmw-lm", {"duration_s": 4, "wall": 0.001, "max_force": 0.8}),
        ("dc", {"duration_s": 0.3}),
        ("pmw", {"duration_s": 0}),
        ("pmw", {"duration_s": 0.001}),
    ],
)
def test_every_run_can_be_drawn_the_same_each_time(kind, simulate):
    drawn = simulation(kind, **simulate)
    first, second = (plots.simulate(*drawn)._repr_png_() for _ in range(2))
    assert struct.unpack(">II", first[16:24])[0] == 1400
    assert len(first) < 250_000
    assert first == second


def test_a_long_run_keeps_its_extremes_in_few_points():
    values = np.random.default_rng(0).standard_normal(60_001)
    times, kept = extremes(np.arange(60_001.0), values)
    assert len(kept) <= 1700
    assert np.all(np.diff(times) > 0)
    assert (kept.min(), kept.max(), kept[-1]) == (values.min(), values.max(), values[-1])
    assert np.array_equal(values[times.astype(int)], kept)


@pytest.mark.parametrize("force", [{"duration_s": 10}, {"duration_s": 4, "input": "pulse", "width_s": 0.3}])
def test_the_detail_is_where_contact_changes(force):
    whole, detail = _spans(columns := simulation(wall=0.001, amplitude=3, **force)[0], _facts("sine"))
    assert whole == slice(None)
    assert detail.stop - detail.start == 800
    touching = columns["touching"][detail]
    assert 0 < touching.mean() < 1


@pytest.mark.slow
def test_the_linear_loop_is_drawn_between_the_tones_as_well():
    """Straight lines between three tones hid a resonance between two of them."""
    loop = {"controller": {"kind": "pmw"}, "operator": {"mass": 0.1, "damping": 1.0, "stiffness": 300.0}}
    loop |= {"environment": {"integration": "explicit"}, "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}}}
    simulate = {"input": "stepped-sine", "frequency_hz": [1.0, 4.0, 10.0]}
    *_, table = simulation_tables(load(loop | {"simulate": simulate}))
    figure = plots.simulate_response(table.columns, table.facts)
    line, dots = figure.axes[0].lines[:2]
    frequency, magnitude = line.get_data()
    expected = wavesweep.compile(loop).response(frequency.tolist())
    assert magnitude == pytest.approx(1e3 * expected["admittance_abs"].to_numpy(), rel=1e-9)
    assert magnitude.max() > 3 * dots.get_ydata().max()
    assert (frequency.min(), frequency.max()) == (0.5, 20.0)


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize("size", [4.18408, 0.921, 238.226])
def test_values_that_agree_to_rounding_lie_on_one_another(size):
    """On axes that show some per cent or degrees, with ticks that differ."""
    columns = {field.name: np.full(1, size) for field in fields("simulate-response")}
    columns |= {name: column * (1 + 1e-13) for name, column in columns.items() if name.startswith("linear_")}
    figure = plots.simulate_response(columns, {})
    figure.canvas.draw()
    for axes in figure.axes:
        low, high = axes.get_ylim()
        assert high - low >= (1.0 if "phase" in axes.get_ylabel() else 0.02 * size)
        drawn = np.concatenate([line.get_ydata() for line in axes.lines])
        assert np.ptp(drawn) < 1e-9 * (high - low)
        ticks = [
            tick.get_text() for place, tick in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True) if low < place < high
        ]
        assert len(set(ticks)) == len(ticks) >= 2
        assert axes.yaxis.get_offset_text().get_text() == ""


def test_a_name_that_sticks_out_keeps_its_numbers_and_gets_room():
    """The layout may change the size of a panel, and with it its numbers, without an end."""
    with figure(3, 2) as canvas:
        axes = canvas.subplots()
        axes.plot([0, 1], [-0.00075, 0.00001])
        axes.set_ylabel("energy (J)")
        canvas.draw_without_rendering()
        assert not _cut_off(axes)
        canvas.set_layout_engine("none")
        axes.set_position([0.05, 0.2, 0.9, 0.7])
        canvas.draw_without_rendering()
        ticks = axes.get_yticks()
        assert _cut_off(axes)
        assert set(axes.get_yticks()) <= set(ticks)
        assert isinstance(axes.yaxis.get_major_locator(), FixedLocator)


@pytest.mark.slow
def test_a_loop_without_a_hand_is_drawn_again_from_its_file(tmp_path):
    spec = load(Path(__file__).parents[2] / "sweeps" / "templates" / "drive.toml")
    *_, run = simulation_tables(spec.asking("simulate"))
    _, columns, facts = read_table(save(run, tmp_path / "simulate.parquet"))
    assert list(columns) == list(run.columns)
    assert len(plots.simulate(columns, facts).axes) == 6


def test_outputs_of_one_unit_and_size_share_a_panel_and_lost_messages_are_seen():
    ports = {
        "inputs": {"ref": {"signal": "ref", "unit": "rad/s"}},
        "outputs": {name: {"signal": f"{name}.v", "unit": "rad/s"} for name in ("motor", "load", "slip")},
    }
    block = {"net": {"type": "channel"}}
    spec = {"ports": ports, "block": block, "simulate": {"input": "step", "at_s": 0.0, "messages": {"net": [0, "2 lost", 3]}}}
    columns = {"tick": np.arange(4), "phase": np.zeros(4, int), "time_s": np.arange(4.0), "late": np.array([0, -1, -1, 3])}
    columns |= {"ref": np.ones(4), "motor": np.linspace(0, 1, 4), "load": np.linspace(0, 0.9, 4), "slip": np.full(4, 1e-3)}
    run = Claim(Property("a run", "figures"), Scope(run="messages of net in turn in time, 2 lost"), Status.COMPUTED)
    drawn = plots.simulate(columns, {"spec": spec, "claims": {"spec": run.fact()}})
    assert [axes.get_ylabel() for axes in drawn.axes] == ["motor, load (rad/s)", "slip (rad/s)", "late (ticks)"]
    above, below, messages = drawn.axes
    assert [line.get_label() for line in above.lines] == ["motor", "load", "ref"]
    assert len(below.lines) == 1
    assert messages.lines[0].get_label() == "messages of net"
    assert messages.get_yticklabels()[0].get_text() == "lost"
    assert drawn.get_supxlabel() == "A run with messages of net in turn in time, 2 lost."
