"""Figures of simulations: short and long, with and without waves, of one frequency and of many."""

import numpy as np
import pytest

import wavesweep
from wavesweep.program import plots
from wavesweep.program.plots.sampling import extremes
from wavesweep.program.spec import load
from wavesweep.simulation.table import simulate as simulation_tables


def test_a_long_run_keeps_its_extremes_in_few_points():
    values = np.random.default_rng(0).standard_normal(60_001)
    times, kept = extremes(np.arange(60_001.0), values)
    assert len(kept) <= 2100
    assert np.all(np.diff(times) > 0)
    assert (kept.min(), kept.max(), kept[-1]) == (values.min(), values.max(), values[-1])
    assert np.array_equal(values[times.astype(int)], kept)


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
