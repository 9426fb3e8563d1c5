"""Figures of simulations: short and long, with and without waves, of one frequency and of many."""

import numpy as np
import pytest

import wavesweep
from wavesweep.program import plots
from wavesweep.program.plots.sampling import extremes
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
