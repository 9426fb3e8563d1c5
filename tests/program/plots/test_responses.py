"""The figure of responses: phases, the static limit, many curves, one frequency."""

from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.program import plots

pytestmark = pytest.mark.slow


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
