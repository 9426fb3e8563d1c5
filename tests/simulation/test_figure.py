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


@pytest.mark.slow
def test_ages_have_an_axis_of_their_own_and_no_wall_is_drawn_that_is_not_there():
    """A master that a message 2 ticks old draws back: one force, in newtons, and ages in seconds."""
    loop = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 50.0, "B": 0.0},
        "block": {"master": {"type": "mass", "mass": 0.3, "damping": 8.0}, "back": {"type": "channel", "late": 2}},
        "signals": {"felt": "K*back.y + B*master.v"},
        "wire": {"back.u": "master.x", "master.f": "hand - felt"},
        "ports": {
            "hand": {"force": "hand", "displacement": "master.x", "reaction": "felt"},
            "wall": {"stiffness": "K", "damping": "B"},
        },
        "simulate": {"input": "step", "at_s": 0.0, "duration_s": 0.05, "messages": {"back": [0, 2]}},
    }
    table, *_ = simulation_tables(load(loop).asking("simulate"))
    axes = plots.simulate(table.columns, table.facts).axes
    drawn = {panel.get_ylabel().replace("\n", " "): [line.get_label() for line in panel.lines] for panel in axes}
    assert drawn["signals"] == ["felt"]
    assert drawn["age of messages (s)"] == ["age_of_back"]
    assert drawn["control force (N)"] == ["against the hand"]
