"""A wall that is stable may have to be touched: without it the loop is not."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import wavesweep
from tests.whole.test_what_stays import summary
from wavesweep.program.analyses.free_space import first_unstable_without_wall, radius_without_wall
from wavesweep.program.analyses.own_design import own_design, own_lines
from wavesweep.program.spec import load

COUPLING = {
    "rates": {"fast_hz": 1000, "ratio": 14},
    "device": {"mass": 0.045, "damping": 0.5, "velocity": "difference"},
    "environment": {"K_VE": 50, "B_VE": 1, "integration": "explicit", "delay": "frame"},
    "controller": {"kind": "dc-vc", "K_VC": 150, "B_VC": 3},
    "sweep": {"K_VE": {"start": 0, "stop": 300}, "B_VE": [1.0]},
}


def free(tables):
    return tables | {"environment": tables["environment"] | {"K_VE": 0, "B_VE": 0}}


@pytest.mark.asks("simulation")
def test_a_coupling_that_is_unstable_where_nothing_is_touched_says_so():
    """Its radius is that of the same loop with a wall of 0, marched: what the hand pushes once grows by it."""
    radius = radius_without_wall(load(COUPLING))
    assert wavesweep.compile(COUPLING).spectral_radius() < 1 < radius
    x = wavesweep.compile(free(COUPLING)).simulate(np.append(np.ones(14), np.zeros(14 * 400)))["x"].to_numpy()
    peaks = [np.ptp(x[start : start + 14 * 60]) for start in (14 * 200, 14 * 300)]
    assert (peaks[1] / peaks[0]) ** (1 / 100) == pytest.approx(radius, rel=1e-3)


def test_tables_and_check_say_it_and_a_loop_that_is_stable_there_says_nothing():
    radius = radius_without_wall(load(COUPLING))
    said = f"without its wall the loop is unstable: spectral radius {radius:.6g} per frame"
    for tables, told in ((COUPLING, True), (COUPLING | {"controller": {"kind": "dc-vc", "K_VC": 50, "B_VC": 3}}, False)):
        assert (said in summary(tables)) == told
        assert (f"  {said}" in own_lines(load(tables), own_design(load(tables)))) == told


def test_of_a_sweep_the_first_loop_is_said_that_is_so_by_itself():
    """Axes of the wall do not count; some loops have other branches, and other ticks."""
    coupling = {"K_VC": [50.0, 150.0, 200.0], "rates.ratio": [10, 14], "device.damping": [0.5, 0.0]}
    spec = load(COUPLING | {"sweep": coupling | COUPLING["sweep"]})
    axes = [axis for axis in spec.sweep if axis.path not in spec.wall]
    alone = []
    for values in product(*(axis.values for axis in axes)):
        changes = dict(zip((axis.path for axis in axes), values, strict=True))
        alone.append((values, radius_without_wall(spec.with_values(changes))))
    unstable = [(values, radius) for values, radius in alone if radius]
    assert 0 < len(unstable) < len(alone)
    assert unstable[0] != alone[0]
    assert first_unstable_without_wall(spec, axes) == unstable[0]
    stable = [replace(axis, values=axis.values[:1]) for axis in axes]
    assert first_unstable_without_wall(spec, stable) is None


def test_a_row_of_contact_that_is_empty_for_that_reason_has_it():
    pytest.importorskip("wavesweep.for_all")
    pytest.importorskip("wavesweep.contact")
    tables = COUPLING | {"for_all": {"contact": True}}
    rows = wavesweep.zwidth(tables)
    (row,) = rows[rows["guarantee"] == "contact"].itertuples()
    assert not row.intervals
    assert row.certified
    assert (
        row.counterexample
        == f"without its wall the loop is unstable: spectral radius {radius_without_wall(load(COUPLING)):.6g} per frame"
    )


@pytest.mark.slow
def test_a_row_of_contact_in_frames_has_it_too():
    frames = COUPLING | {"for_all": {"contact": True, "rates.ratio": {"values": [13, 14], "varying": True}}}
    rows = wavesweep.zwidth(frames)
    (row,) = rows[rows["guarantee"] == "contact"].itertuples()
    assert "without its wall the loop is unstable" in row.counterexample
